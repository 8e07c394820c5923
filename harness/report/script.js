"use strict";
(() => {
  const page = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // Stand-ins of plots.py, and the style sheet's colours that take their places.
  const inks = { "#010101": "--ink", "#020202": "--muted", "#030303": "--line" };
  const drawn = new Map();

  // What went wrong can be read from the page, by tests and by whoever reports it.
  const note = (name, what) => {
    page.dataset[name] = page.dataset[name] ? `${page.dataset[name]} | ${what}` : what;
  };
  addEventListener("error", (event) => note("errors", event.message));
  addEventListener("unhandledrejection", (event) => note("errors", String(event.reason)));
  document.addEventListener("securitypolicyviolation", (event) => note("blocked", event.blockedURI));

  async function draw(box) {
    box.dataset.drawn = "begun";
    const id = box.dataset.plots;
    const { pattern, values } = JSON.parse(document.getElementById(id).textContent);
    const style = getComputedStyle(page);
    const marks = new Map(values.map((value, place) => [`@@${place}`, value]));
    for (const [ink, name] of Object.entries(inks)) {
      marks.set(ink, style.getPropertyValue(name).trim());
    }
    const doc = JSON.parse(
      document.getElementById(`pattern-${pattern}`).textContent,
      (key, value) => (key === "id" ? `${id}.${value}` : marks.has(value) ? marks.get(value) : value),
    );
    const roots = Object.fromEntries(doc.roots.map((root, place) => [root.id, `${id}-${place}`]));
    const item = { docid: id, roots, root_ids: Object.keys(roots) };
    const managers = await Bokeh.embed.embed_items({ [id]: doc }, [item]);
    const views = managers.flatMap((each) => [...each]);
    const curves = views.flatMap((view) => view.model.renderers ?? []);
    const points = curves.reduce((sum, curve) => sum + curve.data_source.get_length(), 0);
    drawn.set(box, managers);
    box.dataset.drawn = `${curves.length} curves, ${points} points`;
  }

  function drawOpened(details) {
    const box = details.querySelector(":scope > [data-plots]");
    if (details.open && box && !box.dataset.drawn) draw(box);
  }

  function redraw() {
    for (const [box, managers] of drawn) {
      for (const manager of managers) for (const view of [...manager]) view.remove();
      for (const plot of box.querySelectorAll(".plot")) plot.replaceChildren();
      draw(box);
    }
  }

  function reveal() {
    let id = location.hash.slice(1);
    if (!document.getElementById(id)) {
      try { id = decodeURIComponent(id); } catch { return; }
    }
    const target = id && document.getElementById(id);
    if (!target) return;
    for (let each = target; each; each = each.parentElement) {
      if (each instanceof HTMLDetailsElement) each.open = true;
    }
    target.scrollIntoView();
  }

  addEventListener("DOMContentLoaded", () => {
    document.addEventListener("toggle", (event) => drawOpened(event.target), true);
    document.addEventListener("click", (event) => {
      const link = event.target.closest("a[href^='#']");
      if (link && link.hash === location.hash) reveal();
    });
    addEventListener("hashchange", reveal);
    dark.addEventListener("change", redraw);
    // A browser may restore open cases when it reloads a page.
    document.querySelectorAll("details.case[open]").forEach(drawOpened);
    reveal();
  });
})();
