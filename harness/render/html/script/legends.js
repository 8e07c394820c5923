/** A legend for several plots, with a button per curve; other runs are folded. */
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
      for (const plot of shared.plots) plot.hide(shared.hidden);
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

/** Return a small sample of a curve. */
function swatch(curve) {
  const shapes = LOOKS[curve.role](curve.place).filter((look) => look.sign !== -1 && look.kind !== "stems").map((look) => {
    const d = { line: "M1,6H25", band: "M1,1H25V11H1Z" }[look.kind] ?? `M13,6${markerPath(look.marker, 8)}`;
    return svg("path", { d, style: look.style });
  });
  return svg("svg", { viewBox: "0 0 26 12", width: 26, height: 12, "aria-hidden": "true" }, ...shapes);
}
