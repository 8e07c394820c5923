/** The time that all plots and the motion of one case show, and the part of it that plots show. */
class Clock {
  constructor(end) { this.end = end; this.t = 0; this.listeners = new Set(); this.ranges = new Set(); this.zooming = false; }

  /** A range of the time axis, which follows all others: each plot is a document of its own. */
  range() {
    const [start, end] = [-0.01 * this.end, 1.01 * this.end];
    const range = new Bokeh.Range1d({ start, end, reset_start: start, reset_end: end });
    this.ranges.add(range);
    range.change.connect(() => {
      if (this.zooming) return;
      this.zooming = true;
      for (const other of this.ranges) other.setv({ start: range.start, end: range.end });
      this.zooming = false;
    });
    const [shown] = this.ranges;
    range.setv({ start: shown.start, end: shown.end });
    return range;
  }

  set(t) {
    this.t = Math.min(Math.max(t, 0), this.end);
    for (const listener of this.listeners) listener(this.t);
  }
}

const short = (value) => (Number.isFinite(value) ? Number(value.toPrecision(5)).toString() : "–");
const waiting = new Map();
const near = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (isIntersecting && waiting.has(target)) waiting.get(target)();
  }
}, { rootMargin: "400px" });

/** Build the figures of a pack in their box: headings, texts, tables; plots when they come near. */
async function build(box) {
  box.dataset.built = "begun";
  const id = box.dataset.pack;
  const { charts, motion } = await pack(id);
  const times = await Promise.all(charts.filter((chart) => chart.over_time)
    .map((chart) => column(id, chart.curves[0].x)));
  const end = Math.max(0, ...times.map((row) => row[row.length - 1]));
  const clock = new Clock(end);
  if (end && motion !== undefined) box.append(await player(id, motion, clock), controls(clock));
  let part = "", grid = null;
  for (const chart of charts) {
    if (chart.part !== part) {
      part = chart.part;
      grid = make("div", { class: "grid" });
      box.append(make("h3", {}, part), grid);
    }
    grid.append(await figure(id, chart, clock));
  }
  clock.set(0);
  box.dataset.built = `${charts.length} plots`;
  drawRest(box);
}

const IDLE = 1500;

/** Draw what is not near either, once the reader has had time to look: for paper, and for search. */
function drawRest(box) {
  const next = async () => {
    const element = [...waiting.keys()].find((each) => box.contains(each));
    if (!element || !box.closest(".view").classList.contains("current")) return;
    await waiting.get(element)();
    setTimeout(next, 30);
  };
  setTimeout(next, IDLE);
}

async function figure(id, chart, clock) {
  const content = await filled(id, chart);
  const canvas = make("div", { class: "plot", role: "img", "aria-label": `${chart.title}. ${chart.summary}` });
  const readout = make("p", { class: "readout" });
  const data = make("details", { class: "data" }, make("summary", {}, "Data"));
  data.addEventListener("toggle", () => { if (data.open && data.children.length === 1) data.append(...tables(content)); });
  const element = make("figure", {}, make("h4", {}, chart.title), canvas,
    ...(chart.over_time ? [readout] : []),
    make("figcaption", {}, make("span", { class: "told" }, chart.summary), " ", chart.key), data);
  const state = { view: null, range: null, place: null };
  state.draw = async () => {
    waiting.delete(element);
    near.unobserve(element);
    canvas.replaceChildren();
    canvas.dataset.scheme = dark.matches ? "dark" : "light";
    state.range = chart.over_time ? clock.range() : null;
    state.view = await plot(content, canvas, state.range);
    if (chart.over_time) state.place = follow(canvas, state.view, clock);
    const points = content.curves.reduce((sum, curve) => sum + curve.x.length, 0);
    element.dataset.drawn = `${content.curves.length} curves, ${points} points`;
  };
  if (chart.over_time) clock.listeners.add((t) => { readout.textContent = reading(content, t); });
  const wait = () => { waiting.set(element, state.draw); near.observe(element); };
  /** Undraw, until it comes near again: what is not looked at costs nothing. */
  element.rest = () => {
    if (!state.view) return;
    state.view.remove();
    state.view = null;
    clock.listeners.delete(state.place);
    clock.ranges.delete(state.range);
    canvas.replaceChildren();
    delete element.dataset.drawn;
    wait();
  };
  wait();
  return element;
}

/** A line at the clock's time over a plot, and the plot's pointer as the clock's hand. */
function follow(canvas, view, clock) {
  const cursor = make("div", { class: "cursor" });
  canvas.append(cursor);
  const place = (t) => {
    const { bbox, x_scale: scale } = view.frame;
    const x = scale.compute(t);
    if (!bbox.width) return;
    cursor.hidden = x < bbox.left || x > bbox.right;
    cursor.style.cssText = `left:${x}px;top:${bbox.top}px;height:${bbox.height}px`;
  };
  clock.listeners.add(place);
  view.model.x_range.change.connect(() => place(clock.t));
  new ResizeObserver(() => requestAnimationFrame(() => place(clock.t))).observe(canvas);
  cursor.parentElement.onpointermove = (event) => {
    const { bbox, x_scale: scale } = view.frame;
    const x = event.clientX - canvas.getBoundingClientRect().left;
    if (x >= bbox.left && x <= bbox.right && !event.buttons) clock.set(scale.invert(x));
  };
  place(clock.t);
  return place;
}

/** Index of the sample nearest to t. */
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
    const rows = curves[0].x.map((x, i) => make("tr", {},
      ...(named && curves[0].role === "lollipop" ? [make("th", { scope: "row" }, named[named.length - 1 - i])] : []),
      cell(x), ...curves.map((curve) => cell(curve.y[i]))));
    const head = make("tr", {}, ...(named && curves[0].role === "lollipop" ? ["cause"] : []).concat(heads).map((text) => make("th", { scope: "col" }, text)));
    const table = make("table", { class: "plain" }, make("caption", {}, chart.title), make("thead", {}, head), make("tbody", {}, ...rows));
    return make("div", { class: "scroll table", tabindex: "0", role: "region", "aria-label": `Data of ${chart.title}` }, table);
  });
}
