const HEIGHT = 250;

/** Draw a chart, its numbers in it, into an element; gives Bokeh's view of it, and what it drew. */
async function plot(chart, element, xRange) {
  const { Plotting, DataRange1d, Range1d, HoverTool } = Bokeh.bk ?? Bokeh;
  const kind = (log) => (log ? "log" : "linear");
  const y = chart.names.length ? [0, chart.names.length] : chart.y_limits;
  const figure = Plotting.figure({
    height: HEIGHT + 12 * chart.names.length, sizing_mode: "stretch_width", tools: [],
    x_axis_type: chart.dates ? "datetime" : kind(chart.log_x), y_axis_type: kind(chart.log_y),
    x_range: xRange ?? new DataRange1d(), y_range: y ? new Range1d({ start: y[0], end: y[1] }) : new DataRange1d(),
    x_axis_label: chart.x_label, y_axis_label: chart.y_label,
    background_fill_alpha: 0, border_fill_alpha: 0, outline_line_color: ink("--line"),
    min_border_right: 12,
  });
  const floor = lowest(chart);
  const items = new Map();
  const drawn = { reference: [], own: [] };
  for (const curve of chart.curves) {
    for (const look of LOOKS[curve.role](curve.place)) {
      const renderer = glyph(figure, chart, curve, look, floor);
      if (!items.has(curve.label)) items.set(curve.label, []);
      items.get(curve.label).push(renderer);
      if (["band", "stems"].includes(look.kind) || curve.role === "other") continue;
      drawn[curve.role === "reference" ? "reference" : "own"].push(renderer);
    }
  }
  dress(figure, chart);
  const x = chart.dates ? "date" : chart.over_time ? "t" : "x";
  // Tips of curves that lie on each other would cover each other: the reference's goes to the left.
  for (const [attachment, renderers] of [["left", drawn.reference], ["horizontal", drawn.own]]) {
    if (!renderers.length) continue;
    figure.add_tools(new HoverTool({
      renderers, attachment, tooltips: [["", "$name"], [x, chart.dates ? "@x{%F %H:%M}" : "@x{%.5g}"], ["value", "@told{%.4g}"]],
      formatters: { "@x": chart.dates ? "datetime" : "printf", "@told": "printf" }, toggleable: false,
    }));
  }
  return { view: await Plotting.show(figure, element), items };
}

/** What a band reaches down to, where the axis has no zero. */
function lowest(chart) {
  if (!chart.log_y) return 0;
  const all = chart.curves.flatMap((curve) => curve.y).map(Math.abs).filter((value) => value > 0);
  return all.reduce((least, value) => Math.min(least, value), Infinity) / 3;
}

function glyph(figure, chart, curve, look, floor) {
  const { kind, sign, ...style } = look;
  const size = (value, log) => (log ? (value === 0 ? NaN : Math.abs(value)) : value);
  const kept = (value) => (sign && value && Math.sign(value) !== sign ? NaN : value);
  const data = {
    x: curve.x.map((value) => (chart.log_x && !(value > 0) ? NaN : value)),
    y: curve.y.map((value) => size(kept(value), chart.log_y)),
    told: curve.y,
  };
  const source = new Bokeh.ColumnDataSource({ data });
  const field = (name) => ({ field: name });
  const options = { source, ...style, name: curve.label };
  switch (kind) {
    case "line":
      return figure.line(field("x"), field("y"), options);
    case "band":
      return figure.varea(field("x"), { value: floor }, field("y"), options);
    case "stems":
      return figure.segment({ value: 1 }, field("y"), field("x"), field("y"), options);
    default:
      return figure.scatter(field("x"), field("y"), options);
  }
}

function dress(figure, chart) {
  const { FixedTicker, PanTool, BoxZoomTool, WheelZoomTool, ResetTool, SaveTool } = Bokeh;
  for (const axis of figure.axes) {
    axis.setv({
      axis_label_text_color: ink("--ink"), axis_label_text_font_style: "normal", axis_label_text_font: "system-ui",
      axis_label_text_font_size: "12px", major_label_text_color: ink("--muted"), major_label_text_font: "system-ui",
      axis_line_color: ink("--muted"), major_tick_line_color: ink("--muted"), minor_tick_line_color: null,
      axis_label_standoff: 5,
    });
  }
  for (const grid of figure.grids) grid.grid_line_color = ink("--line");
  const [x, y] = figure.axes;
  if (chart.log_x) {
    // Bokeh's own ticks are spaced evenly, at the right end, over less than two decades.
    const reach = chart.curves.flatMap((curve) => curve.x).filter((value) => value > 0);
    const [least, most] = [Math.min(...reach), Math.max(...reach)];
    const steps = most / least > 200 ? [1] : [1, 2, 5];
    const every = most / least > 1e8 ? 3 : 1;
    const ticks = [];
    for (let k = -18; k < 10; k += every) for (const m of steps) ticks.push(Number(`${m}e${k}`));
    x.ticker = new FixedTicker({ ticks });
    const label = (value) => (value < 1e-3 || value >= 1e5 ? value.toExponential() : String(value));
    x.major_label_overrides = new Map(ticks.map((value) => [value, label(value)]));
  }
  if (chart.names.length) {
    y.ticker = new FixedTicker({ ticks: chart.names.map((_, i) => i + 0.5) });
    const shown = (name) => (name.length > 34 ? `${name.slice(0, 33)}…` : name);
    y.major_label_overrides = new Map(chart.names.map((name, i) => [i + 0.5, shown(name)]));
  }
  const zoom = new BoxZoomTool();
  figure.add_tools(new PanTool(), zoom, new WheelZoomTool(), new ResetTool(), new SaveTool());
  figure.toolbar.setv({ logo: null, autohide: true, active_drag: zoom });
}
