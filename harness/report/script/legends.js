const SVG = "http://www.w3.org/2000/svg";

/** Hide in every plot of a group what its legend hides. */
function hide({ hidden, items }) {
  for (const drawn of items) {
    for (const [label, renderers] of drawn) {
      for (const renderer of renderers) renderer.visible = !hidden.has(label);
    }
  }
}

/** One legend for several plots: a button a curve; other runs, which may be many, are folded. */
function legend(charts, shared) {
  const curves = new Map();
  for (const curve of charts.flatMap((chart) => chart.curves)) {
    if (!curves.has(curve.label)) curves.set(curve.label, curve);
  }
  const button = (curve) => {
    const element = make("button", { type: "button", "aria-pressed": "true" }, swatch(curve), curve.label);
    element.addEventListener("click", () => {
      const shown = element.getAttribute("aria-pressed") !== "true";
      element.setAttribute("aria-pressed", String(shown));
      if (shown) shared.hidden.delete(curve.label); else shared.hidden.add(curve.label);
      hide(shared);
    });
    return element;
  };
  const all = [...curves.values()];
  const folded = all.filter((curve) => ["other", "work"].includes(curve.role));
  const box = make("div", { class: "legend", role: "group", "aria-label": "Curves: press to hide or show" });
  box.append(...all.filter((curve) => !folded.includes(curve)).map(button));
  if (folded.length) {
    box.append(make("details", {}, make("summary", {}, `${folded.length} other run${folded.length > 1 ? "s" : ""}`), ...folded.map(button)));
  }
  return box;
}

/** How a curve looks, in small. */
function swatch(curve) {
  const svg = document.createElementNS(SVG, "svg");
  for (const [name, value] of Object.entries({ viewBox: "0 0 26 12", width: 26, height: 12, "aria-hidden": "true" })) svg.setAttribute(name, value);
  const add = (tag, attributes) => {
    const shape = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) shape.setAttribute(name, value);
    svg.append(shape);
  };
  for (const look of LOOKS[curve.role](curve.place)) {
    if (look.sign === -1) continue;
    if (look.kind === "line") {
      add("path", { d: "M1 6H25", fill: "none", stroke: look.line_color, "stroke-width": look.line_width,
        "stroke-dasharray": look.line_dash.join(" "), "stroke-opacity": look.line_alpha });
    } else if (look.kind === "band") {
      add("rect", { x: 1, y: 1, width: 24, height: 10, fill: look.fill_color, "fill-opacity": look.fill_alpha });
    } else if (look.kind === "scatter") {
      const outline = { circle: "M9 6a4 4 0 1 0 8 0a4 4 0 1 0-8 0", square: "M9 2h8v8h-8z", triangle: "M13 2l4 8h-8z",
        inverted_triangle: "M13 10l4-8h-8z", diamond: "M13 1l4 5l-4 5l-4-5z", hex: "M9 6l2-4h4l2 4l-2 4h-4z" };
      add("path", { d: outline[look.marker], fill: look.fill_color ?? "none", stroke: look.line_color });
    }
  }
  return svg;
}
