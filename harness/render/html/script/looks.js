// Colours of curves: Okabe and Ito 2008, without black and yellow, which are invisible on a dark or
// a light background; dashes and markers also distinguish curves.
const BLUE = "#0072B2", VERMILION = "#D55E00", GREEN = "#009E73", PURPLE = "#CC79A7",
  ORANGE = "#E69F00", SKY = "#56B4E9";
const PALETTE = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY];
const OTHERS = [GREEN, PURPLE, ORANGE, BLUE];
const DASHES = [[], [8, 3], [2, 2], [8, 3, 2, 3], [12, 4], [4, 4, 1, 4]];
const MARKERS = ["circle", "square", "triangle", "diamond", "inverted_triangle", "hex"];

const ink = (name) => getComputedStyle(page).getPropertyValue(name).trim();
const pick = (list, place) => list[place % list.length];
const line = (color, width, dash = [], alpha = 1) => ({
  kind: "line",
  style: `fill: none; stroke: ${color}; stroke-width: ${width}; stroke-dasharray: ${dash.join(" ") || "none"}; stroke-opacity: ${alpha}; stroke-linejoin: round`,
});
const marks = (marker, color, size, filled = true) => ({
  kind: "marks", marker, size, style: `fill: ${filled ? color : "none"}; stroke: ${color}`,
});
const both = (color, marker, dash) => [line(color, 1.4, dash), marks(marker, color, 7)];

/** Glyphs of a curve by its role; `sign` restricts a glyph to positive or negative values. */
const LOOKS = {
  reference: () => [line(SKY, 5, [], 0.65)],
  engine: () => [line(VERMILION, 1.7, [6, 3])],
  event: () => [marks("circle", "var(--ink)", 9, false)],
  other: (place) => [line(pick(OTHERS, place), 1, pick(DASHES, place + 1), 0.9)],
  corrected: () => [line(GREEN, 2, [])],
  band: () => [{ kind: "band", style: "fill: var(--muted); fill-opacity: 0.28" }],
  global_error: () => [
    { ...line(BLUE, 1.4), sign: 1 }, { ...line(BLUE, 1.4, [2, 2]), sign: -1 },
  ],
  defect: () => [
    { ...marks("triangle", VERMILION, 5), sign: 1 },
    { ...marks("inverted_triangle", VERMILION, 5, false), sign: -1 },
  ],
  before: () => both(VERMILION, "square", [6, 3]),
  after: () => both(GREEN, "circle", []),
  past: (place) => both(pick(PALETTE, place), pick(MARKERS, place + Math.floor(place / 6)), pick(DASHES, place + Math.floor(place / 6))),
  share: (place) => [line(pick(PALETTE, place), 1.8, pick(DASHES, place))],
  rungs: () => both(BLUE, "circle", []),
  full_run: () => both(VERMILION, "square", [7, 3]),
  work: (place) => both(pick(OTHERS, place), pick(MARKERS, place), pick(DASHES, place + 1)),
  increments: () => both(GREEN, "triangle", [2, 2]),
  reach: (place) => both(pick(PALETTE, place), pick(MARKERS, place), pick(DASHES, place)),
  target: () => [marks("diamond", ORANGE, 12)],
  transfer: (place) => [line(pick(PALETTE, place), 5, [], 0.4)],
  response: (place) => [line(pick(PALETTE, place), 1.6, [6, 3])],
  lollipop: () => [{ kind: "stems", style: `stroke: ${BLUE}; stroke-width: 2` }, marks("circle", BLUE, 10)],
  guide: () => [line("var(--ink)", 1.2, [1, 3])],
};

/** Return the path of a marker about the current point, `size` pixels high. */
function markerPath(marker, size) {
  const r = size / 2, w = 0.87 * r;
  switch (marker) {
    case "circle": return `m${-r},0a${r},${r} 0 1 0 ${size},0a${r},${r} 0 1 0 ${-size},0`;
    case "square": return `m${-r},${-r}h${size}v${size}h${-size}z`;
    case "triangle": return `m0,${-r}l${r},${size}h${-size}z`;
    case "inverted_triangle": return `m0,${r}l${r},${-size}h${-size}z`;
    case "diamond": return `m0,${-r}l${0.7 * r},${r}l${-0.7 * r},${r}l${-0.7 * r},${-r}z`;
    default: return `m${-r},0l${r / 2},${-w}h${r}l${r / 2},${w}l${-r / 2},${w}h${-r}z`;
  }
}
