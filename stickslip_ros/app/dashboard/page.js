// Draws up to 15 frames a second of the motion. The page requests each frame, so that none queue
// up; a hidden page requests none. The charts draw axes and marks only when these change. Lines are
// drawn on a canvas above them. The phase portrait changes in every third frame, since a browser
// composes whatever lies between two changes. This leaves more processor time for a simulation on
// this machine.

// Once paused, ECharts draws the lines over time itself, with cursor and zoom.

const INTERVAL = 1000 / 15;
const FRAMES_OF_PORTRAIT = 3;
const CYCLES_INTERVAL = 500;
const MARGIN = 1.08;
const MARK_WIDTH = 70; // pixels between the texts of two marks
const TITLE = 28; // pixels above the charts of a picture
const page = {};
window.stickslip = page;
const limits = {};
const shown = {};
const kept = {};
const dark = window.matchMedia("(prefers-color-scheme: dark)");
let cyclesDrawn = { at: -Infinity };
let loopDrawn = -Infinity;
let socket;

const chartOf = (name) => window.getElement(page[name])?.chart;

// An axis only grows, so that a decaying vibration is visible. `fit` resets it.
function range(name, lines, span) {
  let [low, high] = limits[name] ?? [Infinity, -Infinity];
  for (const { y } of lines) {
    for (let i = 0; i < y.length; i += 1) {
      if (y[i] < low) low = y[i] * (y[i] < 0 ? MARGIN : 1 / MARGIN);
      if (y[i] > high) high = y[i] * (y[i] > 0 ? MARGIN : 1 / MARGIN);
    }
  }
  limits[name] = [low, high];
  if (!Number.isFinite(low)) return { min: -span, max: span };
  if (high - low >= span) return { min: low, max: high };
  const middle = Math.abs(low + high) < span / 1e3 ? 0 : (low + high) / 2;
  return { min: middle - span / 2, max: middle + span / 2 };
}

function setChanged(name, option) {
  const text = JSON.stringify(option);
  if (shown[name] !== text) chartOf(name).setOption(option);
  shown[name] = text;
}

// Returns the context of an empty canvas on top of a chart.
function canvasOn(chart) {
  const [width, height] = [chart.getWidth(), chart.getHeight()];
  const ratio = window.devicePixelRatio;
  let canvas = chart.getDom().querySelector("canvas.lines");
  if (!canvas) {
    canvas = document.createElement("canvas");
    canvas.className = "lines";
    canvas.style.cssText = "position:absolute;left:0;top:0;width:100%;height:100%;pointer-events:none";
    chart.getDom().append(canvas);
  }
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.lineWidth = 1.3;
  context.lineJoin = "bevel";
  return context;
}

// Returns the linear scales from values to pixels.
function scaleOf(chart, gridIndex) {
  const [x0, y0] = chart.convertToPixel({ gridIndex }, [0, 0]);
  const [x1, y1] = chart.convertToPixel({ gridIndex }, [1, 1]);
  return { x0, y0, x1: x1 - x0, y1: y1 - y0 };
}

function drawLine(context, scale, { x, y }, colour, { dash = [], stepped = false } = {}) {
  context.strokeStyle = colour;
  context.setLineDash(dash);
  context.beginPath();
  let down = false;
  for (let i = 0; i < x.length; i += 1) {
    const px = scale.x0 + x[i] * scale.x1;
    const py = scale.y0 + y[i] * scale.y1;
    if (Number.isNaN(py)) {
      down = false; // samples are missing
    } else if (down) {
      if (stepped) context.lineTo(px, scale.y0 + y[i - 1] * scale.y1);
      context.lineTo(px, py);
    } else {
      context.moveTo(px, py);
      down = true;
    }
  }
  context.stroke();
}

// Two NaN mark forces that arrived and did not act: the force that acted is unknown.
const isHeld = (y, i) => Number.isNaN(y[i]) && !Number.isNaN(y[i - 1]) && !Number.isNaN(y[i + 1]);

function drawDots(context, scale, { x, y }, colour) {
  context.fillStyle = colour;
  for (let i = 0; i < x.length; i += 1) {
    if (!Number.isNaN(y[i])) context.fillRect(scale.x0 + x[i] * scale.x1 - 1, scale.y0 + y[i] * scale.y1 - 1, 2, 2);
  }
}

// Returns the last force where no new one arrived, so that late forces leave no gap.
function heldOf({ x, y }) {
  const line = { x: [], y: [] };
  for (let i = 1; i + 1 < x.length; i += 1) {
    if (isHeld(y, i)) {
      line.x.push(x[i - 1], x[i + 1], x[i + 1], x[i + 1]);
      line.y.push(y[i - 1], y[i - 1], y[i + 1], NaN);
    }
  }
  return line;
}

// Returns what the time plots draw, in the order of their series; then the motions kept.
function layersOf({ lines }) {
  const { BLUE, GREY, ORANGE, GREEN, SKY_BLUE } = page.colours;
  const layers = [
    { name: "slide", grid: 0, line: lines.position, colour: BLUE },
    { name: "slide", grid: 1, line: lines.velocity, colour: BLUE },
    { name: "belt", grid: 1, line: lines.belt, colour: GREY, dash: [5, 4] },
    { name: "control force", grid: 2, line: lines.force, colour: ORANGE, stepped: true },
    { name: "held, no new force", grid: 2, line: heldOf(lines.force), colour: ORANGE, dash: [1.5, 3] },
    { name: "sent, not applied", grid: 2, line: lines.dropped, colour: ORANGE, dots: true },
  ];
  for (const [name, motion] of Object.entries(overlaid())) {
    const look = { name, colour: name === "A" ? GREEN : SKY_BLUE, dash: [2, 2] };
    layers.push({ ...look, grid: 0, line: motion.lines.position });
    layers.push({ ...look, grid: 1, line: motion.lines.velocity });
    layers.push({ ...look, grid: 2, line: motion.lines.force, stepped: true });
  }
  return layers;
}

// A motion that was kept in other units is not comparable.
function overlaid() {
  if (page.overlay === false || !page.motion) return {};
  const same = ([, motion]) => String(motion.labels) === String(page.motion.labels);
  return Object.fromEntries(Object.entries(kept).filter(same));
}

const paint = (context, scale, { line, colour, dots, ...look }) =>
  dots ? drawDots(context, scale, line, colour) : drawLine(context, scale, line, colour, look);

// Draws the lines over time; a motion that was kept may be longer than the window.
function paintLines(context, chart, layers, width) {
  const [left, right] = [-width, 0].map((time) => chart.convertToPixel({ gridIndex: 0 }, [time, 0])[0]);
  context.save();
  context.beginPath();
  context.rect(left, 0, right - left, chart.getHeight());
  context.clip();
  layers.forEach((layer) => paint(context, scaleOf(chart, layer.grid), layer));
  context.restore();
}

function drawMarks(context, chart, marks) {
  if (!marks.length) return;
  const ink = dark.matches ? "#d0d4da" : "#444b55";
  context.fillStyle = ink;
  context.strokeStyle = ink;
  context.setLineDash([1, 3]);
  context.font = "11px sans-serif";
  const [top, inside, bottom] = [0.11, 0.2, 0.91].map((share) => share * chart.getHeight());
  let free = -Infinity;
  for (const [time, text] of marks) {
    const [x] = chart.convertToPixel({ gridIndex: 0 }, [time, 0]);
    if (!chart.containPixel({ gridIndex: 0 }, [x, inside])) continue; // beyond the zoom
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x, bottom);
    context.stroke();
    if (x > free) {
      const room = chart.getWidth() - 16 - x;
      context.textAlign = room < MARK_WIDTH ? "right" : "left";
      context.fillText(text, x + (room < MARK_WIDTH ? -3 : 3), top + 10);
      free = x + MARK_WIDTH;
    }
  }
}

function drawMotion(motion) {
  const { lines, labels, spans, time_label, window: width, end } = motion;
  const last = page.motion;
  const another = last && (String(last.labels) !== String(labels) || end < last.end);
  if (another) page.fit(); // other units, or another run
  page.motion = motion;
  const { position, velocity, belt, force, dropped } = lines;
  const [displacement, speed, push] = labels;
  const old = Object.values(overlaid()).map((each) => each.lines);
  const of = (name) => old.map((each) => each[name]);
  const speeds = range("velocity", [velocity, belt, ...of("velocity")], spans[1]);
  const positions = range("position", [position, ...of("position")], spans[0]);
  const forces = range("force", [force, dropped, ...of("force")], spans[2]);
  const layers = layersOf(motion);
  setChanged("trace", {
    legend: { data: [...new Set(layers.map(({ name }) => name))] },
    xAxis: ["", "", time_label].map((name) => ({ name, min: -width, max: 0 })),
    yAxis: [
      { name: displacement, ...positions },
      { name: speed, ...speeds },
      { name: push, ...forces },
    ],
  });
  const trace = chartOf("trace");
  const context = canvasOn(trace);
  if (!page.paused) paintLines(context, trace, layers, width);
  drawMarks(context, trace, motion.marks);
  if (page.paused || page.frames % FRAMES_OF_PORTRAIT === 0) drawPortrait(motion, positions, speeds);
}

function drawPortrait({ labels, equilibrium, belt_speed }, positions, speeds) {
  const [displacement, speed] = labels;
  setChanged("portrait", {
    xAxis: { name: displacement, ...positions },
    yAxis: { name: speed, ...speeds },
    series: [
      { data: equilibrium === null ? [] : [[equilibrium, 0]] },
      { markLine: { data: [{ yAxis: belt_speed }] } },
    ],
  });
  paintPortrait();
}

function paintPortrait() {
  const { BLUE, GREEN, SKY_BLUE } = page.colours;
  const { orbit } = page.motion.lines;
  const portrait = chartOf("portrait");
  const plane = canvasOn(portrait);
  const scale = scaleOf(portrait, 0);
  for (const [name, each] of Object.entries(overlaid())) {
    drawLine(plane, scale, each.lines.orbit, name === "A" ? GREEN : SKY_BLUE, { dash: [2, 2] });
  }
  drawLine(plane, scale, orbit, BLUE);
  plane.setLineDash([]);
  plane.beginPath();
  const [x, y] = [orbit.x.at(-1), orbit.y.at(-1)];
  plane.arc(scale.x0 + x * scale.x1, scale.y0 + y * scale.y1, 4, 0, 2 * Math.PI);
  plane.fillStyle = BLUE;
  plane.fill();
}

// Draws the friction over the relative speed, of a law with a memory.
function drawLoop({ lines }) {
  const now = performance.now();
  if (!lines.loop || now - loopDrawn < CYCLES_INTERVAL) return;
  loopDrawn = now;
  const chart = chartOf("friction");
  if (chart?.getOption()?.series?.[1]?.name !== "motion") return;
  const { x, y } = lines.loop;
  const data = Array.from(x, (value, i) => [value / page.frictionScale, y[i]]);
  chart.setOption({ series: [{}, { data }] });
}

const paintMarks = () => drawMarks(canvasOn(chartOf("trace")), chartOf("trace"), page.motion.marks);

// Returns the text of a cursor along an axis: values with their units, in the order of the panels.
const reading = (along, labels) => (items) => {
  const quantity = (value, label) => `${Number(value).toPrecision(5)} ${/\((.*)\)/.exec(label)?.[1] ?? ""}`;
  const rows = items
    .filter(({ value }) => value[1] !== null)
    .sort((a, b) => a.axisIndex - b.axisIndex || a.seriesIndex - b.seriesIndex)
    .map(({ marker, seriesName, value, axisIndex }) => `${marker}${seriesName} ${quantity(value[1], labels[axisIndex])}`);
  return [quantity(items[0].axisValue, along), ...rows].join("<br>");
};

const points = ({ x, y }) => Array.from(x, (time, i) => [time, Number.isNaN(y[i]) ? null : y[i]]);

// Hands the lines to ECharts, with a cursor and zoom, or takes them back.
function show(paused) {
  const cursor = { axisPointer: { type: "cross" }, show: paused, trigger: "axis" };
  const { time_label, labels } = page.motion ?? { labels: [] };
  const layers = paused && page.motion ? layersOf(page.motion) : [];
  const series = layers.map(({ name, grid, line, colour, dash, stepped, dots }) => ({
    type: dots ? "scatter" : "line",
    symbolSize: 3,
    showSymbol: Boolean(dots),
    name,
    xAxisIndex: grid,
    yAxisIndex: grid,
    step: stepped ? "end" : false,
    lineStyle: { color: colour, width: 1.3, type: dash ? "dashed" : "solid" },
    itemStyle: { color: colour },
    data: points(line),
  }));
  const options = window.getElement(page.trace).options;
  for (const chart of ["trace", "portrait"].map(chartOf)) {
    chart.dispatchAction({ type: "updateAxisPointer", currTrigger: "leave" });
    chart.dispatchAction({ type: "hideTip" }); // it would look for series that are no more
  }
  chartOf("trace").setOption(
    {
      tooltip: { ...cursor, formatter: reading(time_label, labels) },
      axisPointer: { link: [{ xAxisIndex: "all" }] },
      dataZoom: paused ? [{ type: "inside", xAxisIndex: [0, 1, 2] }] : [],
      series: paused ? series : options.series,
    },
    { replaceMerge: ["dataZoom", "series"] },
  );
  chartOf("portrait").setOption({
    tooltip: { ...cursor, formatter: reading(labels[0], labels.slice(1)) },
    series: [{}, { data: paused && page.motion ? points(page.motion.lines.orbit) : [] }],
  });
  // What is painted above the charts follows their zoom and size.
  for (const [name, paintAbove] of Object.entries({ trace: paintMarks, portrait: paintPortrait })) {
    chartOf(name).off("finished", paintAbove);
    if (paused && page.motion) chartOf(name).on("finished", paintAbove);
  }
  if (paused && page.motion) drawMotion(page.motion);
}

function drawCycles(cycles) {
  const { count, amplitude, stick_fraction, label } = cycles;
  page.measured = cycles;
  const now = performance.now();
  const news = count !== cyclesDrawn.count || label !== cyclesDrawn.label;
  if (!news || (now - cyclesDrawn.at < CYCLES_INTERVAL && !page.final)) return;
  cyclesDrawn = { count, label, at: now };
  const numbered = (values) => values.map((value, index) => [count - values.length + index + 1, value]);
  chartOf("cycles").setOption({
    yAxis: [{ name: label }, {}],
    series: [{ data: numbered(amplitude) }, { data: numbered(stick_fraction) }],
  });
}

// A frame is the length of the JSON, the JSON, then x and y of the lines that it names.
function read(bytes) {
  const [size] = new Uint32Array(bytes, 0, 1);
  const frame = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, size)));
  if (frame.motion) {
    let offset = 4 + size;
    const take = (count) => {
      offset += 4 * count;
      return new Float32Array(bytes, offset - 4 * count, count);
    };
    const lines = Object.entries(frame.motion.counts);
    frame.motion.lines = Object.fromEntries(
      lines.map(([name, count]) => [name, { x: take(count), y: take(count) }]),
    );
  }
  return frame;
}

function draw({ motion, cycles }) {
  if (motion) drawMotion(motion);
  if (motion) drawLoop(motion);
  drawCycles(cycles);
  page.frames += 1;
}

const drawable = () => chartOf("trace")?.getWidth() && chartOf("portrait") && chartOf("cycles");

function follow() {
  socket = new WebSocket(`ws://${location.host}/frames`);
  socket.binaryType = "arraybuffer";
  let asked = 0;
  const ask = () => {
    if (socket.readyState !== WebSocket.OPEN) return;
    if (document.hidden || page.paused || !drawable()) {
      setTimeout(ask, 100);
      return;
    }
    asked = performance.now();
    socket.send(String(page.periods));
  };
  socket.onopen = ask;
  socket.onmessage = ({ data }) => {
    if (!page.paused) draw(read(data));
    setTimeout(ask, Math.max(asked + INTERVAL - performance.now(), 0));
  };
  socket.onclose = () => page.final || setTimeout(follow, 1000);
}

function redraw() {
  if (!page.charts.every(chartOf)) {
    setTimeout(redraw, 50);
    return;
  }
  // A change of the theme restores the first option of a chart; later ones are lost.
  page.charts.forEach((name) => {
    chartOf(name).setTheme(dark.matches ? "dark" : "default");
    chartOf(name).setOption(window.getElement(page[name]).options, true);
  });
  Object.keys(shown).forEach((name) => delete shown[name]);
  cyclesDrawn = { at: -Infinity };
  loopDrawn = -Infinity;
  if (page.paused) show(true);
  if (page.paused && page.measured) drawCycles(page.measured);
}

function save(url, name) {
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
}

const blobOf = async (url) => {
  const answer = await fetch(url);
  return answer.ok ? URL.createObjectURL(await answer.blob()) : null;
};

const shownRows = () => `/shown.csv?periods=${page.periods}&end=${page.motion?.end ?? 0}`;

// Fetches the samples of a paused view, since the server forgets old ones and ends.
const keepRows = () => (page.rows ??= blobOf(shownRows()));

page.fit = () => {
  Object.keys(limits).forEach((name) => delete limits[name]);
  if (page.paused) show(true);
};
page.show = (periods) => {
  page.periods = periods;
  page.fit();
};
page.keep = (name) => {
  if (page.motion) kept[name] = page.motion;
  if (page.paused) show(true);
};
page.pause = (paused) => {
  page.paused = paused;
  if (paused) keepRows();
  else {
    page.rows?.then(URL.revokeObjectURL);
    page.rows = null;
  }
  show(paused);
};
page.describe = (run, bag, settings) => {
  document.title = `${run}, ${settings}`;
  page.name = `${bag}, ${settings}`;
};
const now = () => `${new Date().toISOString().slice(0, 19)}Z`;
const fileName = (ending, what = "") => `${page.name} ${what} ${now()}`.replace(/[^\w.+-]+/g, "_") + ending;
page.csv = async () => save((await page.rows) ?? shownRows(), fileName(".csv"));

// Saves one chart as a picture.
page.picture = (chart) => {
  const look = { pixelRatio: 2, backgroundColor: dark.matches ? "#1b1e23" : "#ffffff", excludeComponents: ["toolbox"] };
  save(chart.getDataURL(look), fileName(".png", chart.getDom().getAttribute("aria-label")));
};

// Puts the charts of the motion, as they are shown, into one picture with a title.
page.png = () => {
  const canvases = ["trace", "portrait", "cycles"].flatMap((name) => [
    ...chartOf(name).getDom().querySelectorAll("canvas"),
  ]);
  const boxes = canvases.map((canvas) => canvas.getBoundingClientRect());
  const [left, top] = [Math.min(...boxes.map((b) => b.left)), Math.min(...boxes.map((b) => b.top))];
  const ratio = window.devicePixelRatio;
  const picture = document.createElement("canvas");
  picture.width = ratio * (Math.max(...boxes.map((b) => b.right)) - left);
  picture.height = ratio * (Math.max(...boxes.map((b) => b.bottom)) - top + TITLE);
  const context = picture.getContext("2d");
  context.scale(ratio, ratio);
  context.fillStyle = dark.matches ? "#1b1e23" : "#ffffff";
  context.fillRect(0, 0, picture.width, picture.height);
  context.fillStyle = dark.matches ? "#ffffff" : "#000000";
  context.font = "13px sans-serif";
  context.fillText(`${document.title}, ${now()}`, 8, TITLE / 2, picture.width / ratio - 16);
  canvases.forEach((canvas, i) =>
    context.drawImage(canvas, boxes[i].left - left, boxes[i].top - top + TITLE, boxes[i].width, boxes[i].height),
  );
  save(picture.toDataURL("image/png"), fileName(".png"));
};

// Draws the newest frame, on a hidden page, too.
const drawLast = () =>
  new Promise((resolve) => {
    if (page.paused || socket.readyState !== WebSocket.OPEN || !drawable()) {
      resolve();
      return;
    }
    socket.addEventListener("message", resolve, { once: true });
    socket.send(String(page.periods));
  });

// Fetches what the page offers, before the server ends.
page.end = async () => {
  page.final = true;
  document.body.classList.add("ended");
  await drawLast();
  page.paused = true; // the view that stays has a cursor
  const link = document.querySelector('a[href="/bag.mcap"]');
  const bag = link && (await blobOf("/bag.mcap"));
  if (bag) link.href = bag;
  await keepRows();
  show(true);
  return true;
};
page.copy = ({ currentTarget }) => navigator.clipboard.writeText(currentTarget.previousElementSibling.textContent);
page.scaleFriction = (scale) => {
  page.frictionScale = scale;
};
page.showKept = (overlay) => {
  page.overlay = overlay;
  if (page.paused) show(true);
};
page.frames = 0;
const start = () => {
  Object.assign(page, JSON.parse(document.querySelector("[data-start]").dataset.start));
  dark.addEventListener("change", redraw);
  redraw();
  follow();
};
document.addEventListener("DOMContentLoaded", start); // then NiceGUI has added its elements
