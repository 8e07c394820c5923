// How curves look. Okabe and Ito 2008, without black and yellow, one of which either ground would
// swallow; dashes and marks tell curves apart as well.
const BLUE = "#0072B2", VERMILION = "#D55E00", GREEN = "#009E73", PURPLE = "#CC79A7",
  ORANGE = "#E69F00", SKY = "#56B4E9";
const PALETTE = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY];
const OTHERS = [GREEN, PURPLE, ORANGE, BLUE];
const DASHES = [[], [8, 3], [2, 2], [8, 3, 2, 3], [12, 4], [4, 4, 1, 4]];
const MARKERS = ["circle", "square", "triangle", "diamond", "inverted_triangle", "hex"];

const dark = matchMedia("(prefers-color-scheme: dark)");
const ink = (name) => getComputedStyle(page).getPropertyValue(name).trim();
const pick = (list, place) => list[place % list.length];
const line = (color, width, dash = [], alpha = 1) => ({
  kind: "line", line_color: color, line_width: width, line_dash: dash, line_alpha: alpha,
});
const marks = (marker, color, size, filled = true) => ({
  kind: "scatter", marker, size, line_color: color, fill_color: filled ? color : null,
});
const both = (color, marker, dash) => [line(color, 1.4, dash), marks(marker, color, 7)];

/** The glyphs of a curve by its role; `sign` restricts one to positive or negative values. */
const LOOKS = {
  reference: () => [line(SKY, 5, [], 0.65)],
  engine: () => [line(VERMILION, 1.7, [6, 3])],
  other: (place) => [line(pick(OTHERS, place), 1, pick(DASHES, place + 1), 0.9)],
  corrected: () => [line(GREEN, 2, [])],
  band: () => [{ kind: "band", fill_color: ink("--muted"), fill_alpha: 0.28 }],
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
  lollipop: () => [{ kind: "stems", line_color: BLUE, line_width: 2 }, marks("circle", BLUE, 10)],
  guide: () => [line(ink("--ink"), 1.2, [1, 3])],
};
