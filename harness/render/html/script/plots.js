const HEIGHT = 250, LEAD_HEIGHT = 190, ROW = 12, TOP = 8, RIGHT = 14, BOTTOM = 40;
const FONT = "11px system-ui, sans-serif";
const pen = document.createElement("canvas").getContext("2d");

/** Width of a text in a plot, in pixels. */
function textWidth(text) {
  pen.font = FONT;
  return pen.measureText(text).width;
}

/** Truncate a text to a width in pixels. */
function cut(text, width) {
  if (textWidth(text) <= width) return text;
  let length = text.length;
  while (length && textWidth(`${text.slice(0, length)}…`) > width) length -= 1;
  return `${text.slice(0, length)}…`;
}

/** Return a curve's positions on the axes; values that the axis or the sign excludes are NaN. */
function shownValues(chart, curve, sign) {
  const size = (value) => (value === 0 ? NaN : Math.abs(value));
  const kept = (value) => (sign && value && Math.sign(value) !== sign ? NaN : value);
  return {
    x: curve.x.map((value) => (chart.log_x && !(value > 0) ? NaN : value)),
    y: curve.y.map((value) => (chart.log_y ? size(kept(value)) : kept(value))),
  };
}

/** Return the base of bands; it is below all values if the axis has no zero. */
function bandBase(chart) {
  if (!chart.log_y) return 0;
  return lowestAndHighest(chart.curves.map((curve) => curve.y.map(Math.abs)), true)[0] / 3;
}

/** Return the lowest and the highest finite value of columns, positive only on a logarithmic axis. */
function lowestAndHighest(columns, log) {
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns) {
    for (const value of column) {
      if (!Number.isFinite(value) || (log && value <= 0)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}

/** Return the range that shows all values, with a margin of a twentieth on either side. */
function wholeRange(kind, columns) {
  const log = kind === "log";
  let [low, high] = lowestAndHighest(columns, log);
  if (low > high) [low, high] = log ? [1, 1] : [0, 0];
  if (log) {
    const factor = low < high ? (high / low) ** 0.05 : Math.sqrt(10);
    return new Range(low / factor, high * factor);
  }
  const single = kind === "date" ? DAY / 2 : 0.5 * Math.abs(low) || 1;
  const margin = low < high ? 0.05 * (high - low) : single;
  return new Range(low - margin, high + margin);
}

/** Return the indices of points to draw, and -1 for a gap: in each column of pixels the first,
 * the lowest, the highest and the last. */
function thinned(x, y, width) {
  const kept = [];
  // All points left of the frame share a column, and so do those right of it.
  const column = (i) => (Number.isNaN(y[i]) ? NaN : Math.min(Math.max(Math.floor(x[i]), -1), Math.ceil(width)));
  let from = 0;
  while (from < x.length) {
    const here = column(from);
    if (Number.isNaN(here)) {
      kept.push(-1);
      from += 1;
      continue;
    }
    let [to, low, high] = [from, from, from];
    while (column(to + 1) === here) {
      to += 1;
      if (y[to] < y[low]) low = to;
      if (y[to] > y[high]) high = to;
    }
    kept.push(...new Set([from, Math.min(low, high), Math.max(low, high), to]));
    from = to + 1;
  }
  return kept;
}

const pixel = (value) => Math.round(Math.min(Math.max(value, -1e6), 1e6) * 100) / 100;

/** Return the drawn points of a curve, split at gaps. */
function runsOf({ x, y }, width) {
  const runs = [[]];
  for (const i of thinned(x, y, width)) {
    if (i < 0) runs.push([]); else runs.at(-1).push([pixel(x[i]), pixel(y[i])]);
  }
  return runs.filter((run) => run.length);
}

/** Paths of each kind of glyph, from points and its base in pixels. */
const PATHS = {
  line: (points, { width }) => runsOf(points, width)
    .map((run) => (run.length > 1 ? `M${run.join("L")}` : `M${run[0]}m-0.7,0h1.4`)).join(""),
  band: (points, { width, base }) => runsOf(points, width)
    .map((run) => `M${run[0][0]},${pixel(base.y)}L${run.join("L")}L${run.at(-1)[0]},${pixel(base.y)}Z`).join(""),
  stems: ({ x, y }, { base }) => x.map((value, i) => (Number.isFinite(value + y[i]) ? `M${pixel(base.x)},${pixel(y[i])}H${pixel(value)}` : "")).join(""),
  marks: ({ x, y }, { width, height, look }) => {
    const outline = markerPath(look.marker, look.size);
    const places = new Set();
    for (let i = 0; i < x.length; i += 1) {
      const inside = x[i] > -look.size && x[i] < width + look.size && y[i] > -look.size && y[i] < height + look.size;
      if (inside) places.add(`M${Math.round(2 * x[i]) / 2},${Math.round(2 * y[i]) / 2}`);
    }
    return [...places].map((place) => place + outline).join("");
  },
};

/** A chart with its numbers, drawn as SVG at the width of its element. */
class Plot {
  /** `time` is the range of an x axis shared with other plots; else null. */
  constructor(chart, element, time) {
    Object.assign(this, { chart, element, time: null, frame: null, request: null });
    this.layers = chart.curves.flatMap((curve) => LOOKS[curve.role](curve.place)
      .map((look) => ({ curve, look, ...shownValues(chart, curve, look.sign), hidden: false, path: svg("path", { style: look.style }) })));
    const has = (kind) => this.layers.some(({ look }) => look.kind === kind);
    this.base = { x: 1, y: bandBase(chart) };
    const kind = chart.log_x ? "log" : "linear";
    const columns = (name, present) => [...this.layers.map((layer) => layer[name]), ...(present ? [[this.base[name]]] : [])];
    this.x = new Axis(kind, time ?? wholeRange(kind, columns("x", has("stems"))));
    this.y = new Axis(chart.log_y ? "log" : "linear", this.#upward(columns("y", has("band"))));
    this.axes = svg("g");
    this.inside = svg("svg", {}, ...this.layers.map(({ path }) => path));
    this.cursor = svg("line", { class: "cursor", style: "stroke: var(--ink); stroke-opacity: 0.55", y1: 0, display: "none" });
    this.inside.append(this.cursor);
    this.svg = svg("svg", { "font-family": "system-ui, sans-serif", "font-size": 11 }, this.axes, this.inside);
    element.append(this.svg);
    element.plot = this;
    this.later = this.later.bind(this);
    this.observer = new ResizeObserver(() => { if (this.#width() !== this.width) this.later(); });
    this.observer.observe(element);
    for (const axis of [this.x, this.y]) axis.range.listeners.add(this.later);
    this.draw();
  }

  #upward(columns) {
    const { names, y_limits: limits, log_y: log } = this.chart;
    if (names.length) return new Range(0, names.length);
    return limits ? new Range(...limits) : wholeRange(log ? "log" : "linear", columns);
  }

  #width() { return Math.round(this.element.getBoundingClientRect().width); }

  /** Redraw once before the next frame, for all changes until then. */
  later() {
    this.request ??= requestAnimationFrame(() => {
      this.request = null;
      this.draw();
    });
  }

  draw() {
    const width = this.#width();
    if (!width) return;
    this.width = width;
    const height = (this.element.closest(".lead") ? LEAD_HEIGHT : HEIGHT) + ROW * this.chart.names.length;
    this.y.length = height - TOP - BOTTOM;
    const rows = this.#rows(width);
    const left = (this.chart.y_label ? 30 : 12) + Math.max(0, ...rows.map(({ label }) => textWidth(label)));
    this.x.length = Math.max(width - left - RIGHT, 20);
    this.frame = { left, top: TOP, width: this.x.length, height: this.y.length };
    dressed(this.svg, { viewBox: `0 0 ${width} ${height}`, width, height });
    dressed(this.inside, { x: left, y: TOP, width: this.x.length, height: this.y.length });
    this.axes.replaceChildren(...this.#axes(rows, width, height));
    this.#drawLayers();
    this.showTime(this.time);
  }

  /** Return the ticks of the y axis: numbers, or names of rows. */
  #rows(width) {
    const { names } = this.chart;
    if (!names.length) return this.y.ticks((at) => [at - 12, at + 12]);
    return names.map((name, i) => ({ value: i + 0.5, label: cut(name, 0.4 * width), name }));
  }

  #axes(rows, width, height) {
    const { left, width: across, height: up } = this.frame;
    const bottom = TOP + up;
    const [x, y] = [this.x.scale(), this.y.scale()];
    // Labels at the ends move inwards.
    const centre = (at, label) => {
      const half = textWidth(label) / 2 + 1;
      return Math.max(Math.min(at + left, width - half), half) - left;
    };
    const columns = this.x.ticks((at, label) => {
      const half = Math.max(textWidth(label) + 10, 46) / 2;
      return [centre(at, label) - half, centre(at, label) + half];
    });
    const line = (d, color) => svg("path", { d, style: `fill: none; stroke: var(--${color})` });
    const text = (attributes, label, color, name) => svg("text", { style: `fill: var(--${color})`, ...attributes }, label, ...(name ? [svg("title", {}, name)] : []));
    const grid = [...columns.map(({ value }) => `M${pixel(left + x(value))},${TOP}V${bottom}`),
      ...rows.map(({ value }) => `M${left},${pixel(bottom - y(value))}H${left + across}`)];
    const ticks = [...columns.map(({ value }) => `M${pixel(left + x(value))},${bottom}v4`),
      ...rows.map(({ value }) => `M${left},${pixel(bottom - y(value))}h-4`)];
    const middle = TOP + up / 2;
    return [
      line(`M${left},${TOP}H${left + across}V${bottom}${grid.join("")}`, "line"),
      line(`M${left},${TOP}V${bottom}H${left + across}${ticks.join("")}`, "muted"),
      ...columns.map(({ value, label }) => text({ x: pixel(left + centre(x(value), label)), y: bottom + 16, "text-anchor": "middle" }, label, "muted")),
      ...rows.map(({ value, label, name }) => text({ x: left - 7, y: pixel(bottom - y(value) + 4), "text-anchor": "end" }, label, "muted", name)),
      text({ x: left + across / 2, y: height - 6, "text-anchor": "middle", "font-size": 12 }, cut(this.chart.x_label, 0.9 * width), "ink"),
      text({ transform: `translate(12 ${middle}) rotate(-90)`, "text-anchor": "middle", "font-size": 12 }, cut(this.chart.y_label, 0.9 * up), "ink"),
    ];
  }

  #drawLayers() {
    const { width, height } = this.frame;
    const [right, up] = [this.x.scale(), this.y.scale()];
    const base = { x: right(this.base.x), y: height - up(this.base.y) };
    for (const layer of this.layers) {
      layer.points = { x: layer.x.map(right), y: layer.y.map((value) => height - up(value)) };
      layer.path.setAttribute("d", PATHS[layer.look.kind](layer.points, { width, height, base, look: layer.look }));
    }
  }

  /** Show a line at a time, if it is in the visible range. */
  showTime(time) {
    this.time = time;
    if (time === null || !this.frame) return;
    const at = pixel(this.x.scale()(time));
    const inside = at >= 0 && at <= this.frame.width;
    dressed(this.cursor, { x1: at, x2: at, y2: this.frame.height, display: inside ? "inline" : "none" });
  }

  /** Hide the curves with some labels, and show the others. */
  hide(labels) {
    for (const layer of this.layers) {
      layer.hidden = labels.has(layer.curve.label);
      layer.path.setAttribute("display", layer.hidden ? "none" : "inline");
    }
  }

  /** Reset both axes; a shared axis is reset in all plots that share it. */
  reset() {
    this.x.range.reset();
    this.y.range.reset();
  }

  remove() {
    this.observer.disconnect();
    cancelAnimationFrame(this.request);
    for (const axis of [this.x, this.y]) axis.range.listeners.delete(this.later);
    delete this.element.plot;
    this.element.replaceChildren();
  }
}
