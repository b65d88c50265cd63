// Draws thirty frames a second of the motion, or as many as it can. The page asks for each of them:
// one that is hidden asks for none, and none queue up.

const INTERVAL = 1000 / 30;
const MARGIN = 1.08;
const limits = {};
let drawnCycles = -1;

const charts = {};
for (const name of ["trace", "portrait", "cycles"]) {
  const id = window.stickslip[name];
  Object.defineProperty(charts, name, { get: () => window.getElement(id)?.chart });
}

// An axis only grows: what dies away must be seen to. `fit` starts it anew.
function range(name, values) {
  let [low, high] = limits[name] ?? [Infinity, -Infinity];
  for (const value of values) {
    if (value === null) continue; // a gap
    if (value < low) low = value * (value < 0 ? MARGIN : 1 / MARGIN);
    if (value > high) high = value * (value > 0 ? MARGIN : 1 / MARGIN);
  }
  if (!(low < high)) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  limits[name] = [low, high];
  return low < high ? { min: low, max: high } : { min: -1, max: 1 };
}

const second = (points) => points.map((point) => point[1]);

function drawSamples(samples, labels) {
  const { position, velocity, belt, force, orbit } = samples;
  const speeds = range("velocity", second(velocity).concat(second(belt)));
  const positions = range("position", second(position));
  const [displacement, speed, push] = labels;
  const dotted = { symbol: "none", silent: true, animation: false };
  charts.trace.setOption({
    xAxis: [0, 1, 2].map(() => ({ min: -samples.window, max: 0 })),
    yAxis: [
      { name: displacement, ...positions },
      { name: speed, ...speeds },
      { name: push, ...range("force", second(force)) },
    ],
    series: [{ data: position }, { data: velocity }, { data: belt }, { data: force }],
  });
  charts.portrait.setOption({
    xAxis: { name: displacement, ...positions },
    yAxis: { name: speed, ...speeds },
    series: [
      {
        data: orbit,
        markLine: { ...dotted, data: [{ yAxis: samples.belt_speed }] },
      },
      { data: samples.equilibrium === null ? [] : [[samples.equilibrium, 0]] },
      { data: orbit.slice(-1) },
    ],
  });
}

function drawCycles({ count, amplitude, stick_fraction, label }) {
  if (count === drawnCycles) return;
  drawnCycles = count;
  const numbered = (values) => values.map((value, index) => [count - values.length + index + 1, value]);
  charts.cycles.setOption({
    yAxis: [{ name: label }, {}],
    series: [{ data: numbered(amplitude) }, { data: numbered(stick_fraction) }],
  });
}

async function fetchFrame() {
  const response = await fetch(`frame?periods=${window.stickslip.periods}`);
  return response.ok ? response.json() : null;
}

function draw({ samples, labels, cycles }) {
  if (samples) drawSamples(samples, labels);
  drawCycles(cycles);
  window.stickslip.frames += 1;
  window.stickslip.newest = samples?.end ?? null;
}

// While one frame is drawn, the next one is on its way.
async function loop(coming) {
  const started = performance.now();
  const visible = !document.hidden && charts.trace && charts.portrait && charts.cycles;
  let next = null;
  try {
    const frame = await coming;
    next = visible ? fetchFrame() : null;
    next?.catch(() => {}); // the server has gone; NiceGUI says so on the page
    if (frame && visible) draw(frame);
  } catch (error) {
    console.debug(error);
  }
  const pause = Math.max(INTERVAL - (performance.now() - started), 0);
  setTimeout(() => loop(next), pause);
}

window.stickslip.fit = () => Object.keys(limits).forEach((name) => delete limits[name]);
window.stickslip.frames = 0;
window.stickslip.start = () => loop(null);
