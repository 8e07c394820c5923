/** The current time of all plots and the animation of one case, and the visible time range. */
class Clock {
  constructor(end) {
    Object.assign(this, { end, t: 0, listeners: new Set(), range: new Range(-0.01 * end, 1.01 * end) });
  }

  set(t) {
    this.t = Math.min(Math.max(t, 0), this.end);
    for (const listener of this.listeners) listener(this.t);
  }
}

const short = (value) => (Number.isFinite(value) ? Number(value.toPrecision(5)).toString() : "–");
const dateText = (value) => new Date(value).toISOString().slice(0, 16).replace("T", " ");
const waiting = new Map();
const near = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (isIntersecting && waiting.has(target)) waiting.get(target)();
  }
}, { rootMargin: "400px" });

/** Build the figures of a pack in their box: headings, texts, tables; plots when near the view. */
async function build(box) {
  box.dataset.built = "begun";
  const id = box.dataset.pack;
  const { charts, motion } = await pack(id);
  const times = await Promise.all(charts.filter((chart) => chart.over_time)
    .map((chart) => column(id, chart.curves[0].x)));
  const end = Math.max(0, ...times.map((row) => row[row.length - 1]));
  const clock = new Clock(end);
  const leading = charts.filter((chart) => chart.lead);
  if (end && motion !== undefined) box.append(controls(clock));
  if (leading.length) {
    const lead = make("div", { class: "lead" });
    box.append(lead);
    if (motion) lead.append(await player(id, motion, clock));
    // Without a sketch of the mechanism, show the motion of the coordinate first.
    for (const chart of leading) {
      if (!motion || chart.over_error) lead.append(await group(id, [chart], clock, "together"));
    }
    if (!motion) box.append(make("p", { class: "muted" }, "The system declares no sketch, so there is no picture of it; the time above is that of the plots' cursor."));
  }
  const parts = new Map();
  for (const chart of charts) {
    if (leading.includes(chart) && (!motion || chart.over_error)) continue;
    if (!parts.has(chart.part)) parts.set(chart.part, []);
    parts.get(chart.part).push(chart);
  }
  for (const [part, inside] of parts) {
    if (leading.length) box.append(topic(id, part, inside, clock));
    else box.append(make("h3", {}, part), await group(id, inside, clock));
  }
  clock.set(0);
  box.dataset.built = `${charts.length} plots`;
  drawRest(box);
}

const unfolded = new Set();

/** Plots of one kind, folded until the reader opens them; then open in every case. */
function topic(id, part, charts, clock) {
  const element = make("details", { class: "topic" }, make("summary", {}, part, make("span", { class: "muted" }, ` ${charts.length}`)));
  element.addEventListener("toggle", async () => {
    if (element.open) unfolded.add(part); else unfolded.delete(part);
    if (!element.open || element.dataset.begun) return;
    element.dataset.begun = "yes";
    element.append(await group(id, charts, clock));
    clock.set(clock.t);
    element.dataset.built = "yes";
    drawRest(element);
  });
  element.open = unfolded.has(part);
  return element;
}

/** Plots with a common legend: it hides curves in all of them. */
async function group(id, charts, clock, kind = "grid") {
  const shared = { hidden: new Set(), plots: new Set() };
  const figures = await Promise.all(charts.map((chart) => figure(id, chart, clock, shared)));
  return make("div", { class: "group" }, make("div", { class: kind }, ...figures), legend(charts, shared));
}

const IDLE = 1500;

/** Draw distant plots too after a delay, for printing and for text search. */
function drawRest(box) {
  const next = () => {
    const element = [...waiting.keys()].find((each) => box.contains(each));
    if (!element || !box.closest(".view").classList.contains("current")) return;
    waiting.get(element)();
    setTimeout(next, 30);
  };
  setTimeout(next, IDLE);
}

async function figure(id, chart, clock, shared) {
  const content = await filled(id, chart);
  const canvas = make("div", { class: "plot", role: "img", "aria-label": `${chart.title}. ${chart.summary}` });
  const state = { plot: null, end: null };
  const tools = toolbar(chart.title, () => state.plot);
  const readout = make("p", { class: "readout" });
  const data = make("details", { class: "data" }, make("summary", {}, "Data"));
  data.addEventListener("toggle", () => { if (data.open && data.children.length === 1) data.append(...tables(content)); });
  const about = make("details", { class: "about" }, make("summary", {}, "What it shows"),
    make("p", { class: "told" }, chart.summary), make("p", {}, chart.key));
  const element = make("figure", {}, make("div", { class: "head" }, make("h4", {}, chart.title), tools.box), canvas,
    ...(chart.over_time ? [readout] : []), make("figcaption", {}, about, data));
  const draw = () => {
    // The reader may have left the view by now.
    if (!element.closest(".view").classList.contains("current")) return;
    waiting.delete(element);
    near.unobserve(element);
    const plot = new Plot(content, canvas, chart.over_time ? clock.range : null);
    state.plot = plot;
    state.end = gestures(plot, tools);
    shared.plots.add(plot);
    plot.hide(shared.hidden);
    if (chart.over_time) follow(plot, clock);
    const points = content.curves.reduce((sum, curve) => sum + curve.x.length, 0);
    element.dataset.drawn = `${content.curves.length} curves, ${points} points`;
  };
  if (chart.over_time) clock.listeners.add((t) => {
    readout.textContent = reading(content, t);
    state.plot?.showTime(t);
  });
  const wait = () => { waiting.set(element, draw); near.observe(element); };
  /** Remove the drawing until the plot is near the view again, to save memory. */
  element.rest = () => {
    if (!state.plot) return;
    state.end();
    state.plot.remove();
    shared.plots.delete(state.plot);
    state.plot = null;
    delete element.dataset.drawn;
    wait();
  };
  wait();
  return element;
}

/** Show the clock's time in a plot, and let the pointer set it. */
function follow(plot, clock) {
  plot.element.onpointermove = (event) => {
    const at = inFrame(plot, event);
    if (isInside(plot, at) && !event.buttons) clock.set(plot.x.value(at[0]));
  };
  plot.showTime(clock.t);
}

/** Return the index of the sample nearest to t. */
function nearest(row, t) {
  let low = 0, high = row.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (row[middle] > t) high = middle; else low = middle;
  }
  return t - row[low] <= row[high] - t ? low : high;
}

function reading(chart, t) {
  const values = chart.curves.map((curve) => `${curve.label} ${short(curve.y[nearest(curve.x, t)])}`);
  return `t = ${t.toFixed(3)} s: ${values.join("; ")}`;
}

/** The numbers of a chart: a table for curves over the same x. */
function tables(chart) {
  const groups = new Map();
  for (const curve of chart.curves) {
    const key = JSON.stringify(curve.x);
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(curve);
  }
  return [...groups.values()].map((curves) => {
    const heads = [chart.x_label, ...curves.map((curve) => curve.label)];
    const named = chart.names.length ? chart.names : null;
    const cell = (value) => make("td", { class: "number" }, String(Number.isFinite(value) ? value : "–"));
    const place = (x) => (chart.dates ? make("td", { class: "number" }, dateText(x)) : cell(x));
    const rows = curves[0].x.map((x, i) => make("tr", {},
      ...(named && curves[0].role === "lollipop" ? [make("th", { scope: "row" }, named[named.length - 1 - i])] : []),
      place(x), ...curves.map((curve) => cell(curve.y[i]))));
    const head = make("tr", {}, ...(named && curves[0].role === "lollipop" ? ["cause"] : []).concat(heads).map((text) => make("th", { scope: "col" }, text)));
    const table = make("table", { class: "plain" }, make("caption", {}, chart.title), make("thead", {}, head), make("tbody", {}, ...rows));
    return make("div", { class: "scroll table", tabindex: "0", role: "region", "aria-label": `Data of ${chart.title}` }, table);
  });
}
