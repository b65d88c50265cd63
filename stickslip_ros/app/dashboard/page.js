// Draws up to thirty frames a second of the motion. The page requests each frame, so that none queue
// up; a hidden page requests none. The charts draw axes and marks only when these change. Lines are
// drawn on a canvas above them: this leaves more processor time for a simulation on this machine.

const INTERVAL = 1000 / 30;
const CYCLES_INTERVAL = 500;
const MARGIN = 1.08;
const LEAST_SPAN = 1e-4; // of an axis, in its units: smaller spans are rounding
const HELD = "dotted: held, no new force";
const DROPPED = "dots: sent, not applied";
const page = window.stickslip;
const limits = {};
const shown = {};
let cyclesDrawn = { at: -Infinity };

const chartOf = (name) => window.getElement(page[name])?.chart;

// An axis only grows, so that a decaying vibration is visible. `fit` resets it.
function range(name, lines) {
  let [low, high] = limits[name] ?? [Infinity, -Infinity];
  for (const { y } of lines) {
    for (let i = 0; i < y.length; i += 1) {
      if (y[i] < low) low = y[i] * (y[i] < 0 ? MARGIN : 1 / MARGIN);
      if (y[i] > high) high = y[i] * (y[i] > 0 ? MARGIN : 1 / MARGIN);
    }
  }
  limits[name] = [low, high];
  if (high - low >= LEAST_SPAN) return { min: low, max: high };
  return Number.isFinite(low) ? { min: low - 1, max: high + 1 } : { min: -1, max: 1 };
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

function drawLine(context, scale, { x, y }, colour, { dashed = false, stepped = false } = {}) {
  context.strokeStyle = colour;
  context.setLineDash(dashed ? [5, 4] : []);
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

// Draws the last force dotted where no new one arrived, so that late forces leave no gap.
function drawHeld(context, scale, { x, y }, colour) {
  context.strokeStyle = colour;
  context.setLineDash([1.5, 3]);
  context.beginPath();
  for (let i = 1; i + 1 < x.length; i += 1) {
    if (isHeld(y, i)) {
      const [held, next] = [scale.y0 + y[i - 1] * scale.y1, scale.x0 + x[i + 1] * scale.x1];
      context.moveTo(scale.x0 + x[i - 1] * scale.x1, held);
      context.lineTo(next, held);
      context.lineTo(next, scale.y0 + y[i + 1] * scale.y1);
    }
  }
  context.stroke();
}

function drawMotion({ lines, labels, time_label, window: width, end, equilibrium, belt_speed }) {
  const last = page.motion;
  const another = last && (String(last.labels) !== String(labels) || end < last.end);
  if (another) page.fit(); // other units, or another run
  const { position, velocity, belt, force, dropped, orbit } = lines;
  const [displacement, speed, push] = labels;
  const speeds = range("velocity", [velocity, belt]);
  const positions = range("position", [position]);
  const held = force.y.some((_, i) => i > 0 && i + 1 < force.y.length && isHeld(force.y, i));
  const pushes = [push, ...(held ? [HELD] : []), ...(dropped.y.length ? [DROPPED] : [])];
  setChanged("trace", {
    xAxis: ["", "", time_label].map((name) => ({ name, min: -width, max: 0 })),
    yAxis: [
      { name: displacement, ...positions },
      { name: speed, ...speeds },
      { name: pushes.join(", "), ...range("force", [force, dropped]) },
    ],
  });
  setChanged("portrait", {
    xAxis: { name: displacement, ...positions },
    yAxis: { name: speed, ...speeds },
    series: [
      { data: equilibrium === null ? [] : [[equilibrium, 0]] },
      { markLine: { data: [{ yAxis: belt_speed }] } },
    ],
  });
  const { BLUE, GREY, ORANGE } = page.colours;
  const trace = chartOf("trace");
  const context = canvasOn(trace);
  drawLine(context, scaleOf(trace, 0), position, BLUE);
  drawLine(context, scaleOf(trace, 1), velocity, BLUE);
  drawLine(context, scaleOf(trace, 1), belt, GREY, { dashed: true });
  drawLine(context, scaleOf(trace, 2), force, ORANGE, { stepped: true });
  drawHeld(context, scaleOf(trace, 2), force, ORANGE);
  drawDots(context, scaleOf(trace, 2), dropped, ORANGE);
  const portrait = chartOf("portrait");
  const plane = canvasOn(portrait);
  const scale = scaleOf(portrait, 0);
  drawLine(plane, scale, orbit, BLUE);
  plane.beginPath();
  const [x, y] = [orbit.x.at(-1), orbit.y.at(-1)];
  plane.arc(scale.x0 + x * scale.x1, scale.y0 + y * scale.y1, 4, 0, 2 * Math.PI);
  plane.fill();
}

function drawCycles({ count, amplitude, stick_fraction, label }) {
  const now = performance.now();
  const news = count !== cyclesDrawn.count || label !== cyclesDrawn.label;
  if (!news || now - cyclesDrawn.at < CYCLES_INTERVAL) return;
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
  drawCycles(cycles);
  page.frames += 1;
  page.motion = motion;
}

function follow() {
  const socket = new WebSocket(`ws://${location.host}/frames`);
  socket.binaryType = "arraybuffer";
  let asked = 0;
  const ask = () => {
    if (socket.readyState !== WebSocket.OPEN) return;
    if (document.hidden || !(chartOf("trace") && chartOf("portrait") && chartOf("cycles"))) {
      setTimeout(ask, 100);
      return;
    }
    asked = performance.now();
    socket.send(String(page.periods));
  };
  socket.onopen = ask;
  socket.onmessage = ({ data }) => {
    draw(read(data));
    setTimeout(ask, Math.max(asked + INTERVAL - performance.now(), 0));
  };
  socket.onclose = () => setTimeout(follow, 1000);
}

page.fit = () => Object.keys(limits).forEach((name) => delete limits[name]);
page.frames = 0;
page.start = follow;
