const DECADE_STEPS = [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 30, 50, 100, 200];
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** The visible range of an axis, in data units. Several plots may share one. */
class Range {
  constructor(start, end) {
    Object.assign(this, { start, end, whole: [start, end], listeners: new Set() });
  }

  set(start, end) {
    Object.assign(this, { start, end });
    for (const listener of this.listeners) listener();
  }

  reset() { this.set(...this.whole); }
}

/** An axis of `length` pixels: linear or logarithmic (`log`). */
class Axis {
  constructor(kind, range) { Object.assign(this, { kind, range, length: 1 }); }

  /** Return the ends on the axis's linear scale. */
  ends() {
    const { start, end } = this.range;
    return this.kind === "log" ? [Math.log10(start), Math.log10(end)] : [start, end];
  }

  /** Return the function from a value to its distance from the lower end, in pixels. */
  scale() {
    const [low, high] = this.ends();
    const factor = this.length / (high - low);
    return this.kind === "log" ? (value) => (Math.log10(value) - low) * factor : (value) => (value - low) * factor;
  }

  /** Return the value at a distance from the lower end, in pixels. */
  value(pixels) {
    const [low, high] = this.ends();
    const even = low + (pixels / this.length) * (high - low);
    return this.kind === "log" ? 10 ** even : even;
  }

  /** Show the range between two distances, unless doubles can't resolve it. */
  zoom(from, to) {
    const [start, end] = [this.value(from), this.value(to)];
    const size = Math.max(Math.abs(start), Math.abs(end));
    const valid = Number.isFinite(size) && end - start > 1e-12 * size && (this.kind !== "log" || start > 0);
    if (valid) this.range.set(start, end);
  }

  /** Return the closest ticks whose labels stay apart; `span` gives the size of a label in pixels. */
  ticks(span) {
    const scale = this.scale();
    let best = [];
    for (const ticks of candidates(this.kind, this.range.start, this.range.end)) {
      if (ticks.length <= best.length || !areApart(ticks, scale, span)) continue;
      if (ticks.length > 1) return ticks;
      best = ticks;
    }
    return best;
  }
}

/** Return whether labels neither overlap nor repeat. */
function areApart(ticks, scale, span) {
  if (new Set(ticks.map((tick) => tick.label)).size < ticks.length) return false;
  let last = -Infinity;
  for (const { value, label } of ticks) {
    const [from, to] = span(scale(value), label);
    if (from < last) return false;
    last = to;
  }
  return true;
}

/** Yield ticks `{value, label}` between two values, the densest first. */
function candidates(kind, low, high) {
  return kind === "log" ? logTicks(low, high) : linearTicks(low, high);
}

const exponent = (value) => Math.floor(Math.log10(Math.abs(value)) + 1e-9);
const signed = (label) => label.replace("-", "−");

/** Return the smallest 1, 2 or 5 times a power of ten that is at least a value. */
function niceStep(least) {
  const power = 10 ** exponent(least);
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * (1 - 1e-9));
}

/** Return the whole numbers from `low` to `high`, tolerating rounding at both ends. */
function integers(low, high) {
  const first = Math.ceil(low - 1e-9), count = Math.floor(high + 1e-9) - first + 1;
  return Array.from({ length: Math.max(count, 0) }, (_, i) => first + i);
}

function* linearTicks(low, high) {
  for (let step = niceStep((high - low) / 15); step < 2 * (high - low); step = niceStep(1.5 * step)) {
    yield evenTicks(low, high, step);
  }
}

function evenTicks(low, high, step) {
  const last = exponent(step); // place of the last digit
  const plain = Math.max(Math.abs(low), Math.abs(high)) < 1e5 && last >= -4;
  return integers(low / step, high / step).map((i) => {
    const value = i * step;
    return { value, label: signed(plain ? value.toFixed(Math.max(0, -last)) : power(value, exponent(value) - last)) };
  });
}

/** Format a number as a power of ten times another with some decimals. */
function power(value, decimals) {
  if (value === 0) return "0";
  const [factor, raised] = value.toExponential(Math.max(decimals, 0)).split("e");
  const ten = `10${String(Number(raised)).replace("-", "⁻").replace(/\d/g, (digit) => SUPERSCRIPTS[digit])}`;
  return factor === "1" ? ten : `${factor}×${ten}`;
}

/** Yield 1, 2 and 5 times the powers of ten for less than about two decades; else powers only. */
function* logTicks(low, high) {
  const [first, last] = [Math.log10(low), Math.log10(high)];
  const decades = integers(Math.floor(first), last);
  const within = decades.flatMap((k) => [1, 2, 5].map((factor) => Number(`${factor}e${k}`)))
    .filter((value) => value >= low && value <= high);
  if (within.length < 3) yield* linearTicks(low, high);
  if (last - first < 2.3) yield logLabels(within);
  for (const every of DECADE_STEPS) yield logLabels(integers(first / every, last / every).map((i) => Number(`1e${i * every}`)));
}

function logLabels(values) {
  const plain = values.every((value) => value >= 1e-3 && value < 1e5);
  return values.map((value) => ({ value, label: plain ? String(value) : power(value, 0) }));
}
