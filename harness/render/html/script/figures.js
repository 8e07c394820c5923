/** The current time of all plots and the animation of one case, and the visible time range. */
class Clock {
  constructor(start, end, worst) {
    const margin = 0.01 * (end - start) || 0.5;
    Object.assign(this, { start, end, worst, t: start, listeners: new Set(), range: new Range(start - margin, end + margin) });
  }

  /** Return the clock of charts over a motion's time. */
  static async of(id, charts, worst) {
    const times = await Promise.all(charts.filter((chart) => chart.over_time)
      .flatMap((chart) => chart.curves.map((curve) => column(id, curve.x))));
    const [start, end] = lowestAndHighest(times, false);
    return start > end ? new Clock(0, 0, 0) : new Clock(0, end, worst);
  }

  set(t) {
    this.t = Math.min(Math.max(t, this.start), this.end);
    for (const listener of this.listeners) listener(this.t);
  }
}

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
  const { charts, motion, worst } = await pack(id);
  const parts = new Map();
  for (const chart of charts) {
    if (!parts.has(chart.part)) parts.set(chart.part, []);
    parts.get(chart.part).push(chart);
  }
  const leading = charts.filter((chart) => chart.lead);
  const clock = await Clock.of(id, leading.length ? leading : charts, worst ?? 0);
  if (leading.length) await tabbed(box, parts, leading, motion, clock);
  else {
    for (const [part, inside] of parts) box.append(make("h3", {}, part), await group(id, inside, clock));
  }
  clock.set(clock.worst);
  box.dataset.built = `${charts.length} plots`;
  drawRest(box);
}

/** Fill the box of a case: a tab for each kind of plot, and one for its numbers. */
async function tabbed(box, parts, leading, motion, clock) {
  const id = box.dataset.pack;
  for (const [part, charts] of parts) {
    const panel = make("section", { "data-tab": part }, make("h3", {}, part));
    box.append(panel);
    let rest = charts;
    if (charts[0] === leading[0]) {
      // The first tab answers at a glance: simulated against expected, then error against uncertainty.
      const lead = make("div", { class: "lead" }, await group(id, leading, clock, "together"));
      if (clock.end && motion !== undefined) panel.append(controls(clock));
      panel.append(lead);
      if (motion) lead.append(await player(id, motion, clock));
      else if (!box.closest(".view")?.querySelector(".scene")) panel.append(make("p", { class: "muted" }, "The system declares no sketch, so there is no picture of it; the time above is that of the plots' cursor."));
      rest = charts.slice(1);
    }
    if (rest.length) panel.append(await group(id, rest, clock, leading.includes(rest[0]) ? "grid led" : "grid"));
  }
  const numbers = box.parentElement.querySelector("[data-tab=Numbers]");
  tabs(box, [...box.children, ...(numbers ? [numbers] : [])], () => clock.set(clock.t));
}

/** Plots with a common legend: it hides curves in all of them. */
async function group(id, charts, clock, kind = "grid") {
  const shared = { hidden: new Set(), plots: new Set() };
  const figures = await Promise.all(charts.map((chart) => figure(id, chart, clock, shared)));
  return make("div", { class: "group" }, make("div", { class: kind }, ...figures), legend(charts, shared));
}

const IDLE = 1500;

/** Draw distant plots and those of other tabs too after a delay, for printing. */
function drawRest(box) {
  const next = () => {
    if (drawWaiting(box, 1)) setTimeout(next, 30);
  };
  setTimeout(next, IDLE);
}

/** Draw plots of a box that the reader sees, at most some; return their number. */
function drawWaiting(box, most = Infinity) {
  if (!box.closest(".view").classList.contains("current")) return 0;
  const elements = [...waiting.keys()].filter((each) => box.contains(each)).slice(0, most);
  for (const element of elements) waiting.get(element)();
  return elements.length;
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
    if (element.closest("[role=tabpanel]:not(.chosen)")) return; // its tab shows the time when it opens
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
  const values = chart.curves.filter((curve) => curve.role !== "other")
    .map((curve) => `${curve.label} ${short(curve.y[nearest(curve.x, t)])}`);
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
    const rows = curves[0].x.map((x, i) => make("tr", {},
      ...(named && curves[0].role === "lollipop" ? [make("th", { scope: "row" }, named[named.length - 1 - i])] : []),
      cell(x), ...curves.map((curve) => cell(curve.y[i]))));
    const head = make("tr", {}, ...(named && curves[0].role === "lollipop" ? ["cause"] : []).concat(heads).map((text) => make("th", { scope: "col" }, text)));
    const table = make("table", { class: "plain" }, make("caption", {}, chart.title), make("thead", {}, head), make("tbody", {}, ...rows));
    return make("div", { class: "scroll table", tabindex: "0", role: "region", "aria-label": `Data of ${chart.title}` }, table);
  });
}
