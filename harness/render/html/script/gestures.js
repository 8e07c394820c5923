const NEAR = 7, LEAST_BOX = 6, NOTCH = 1.2;

/** Let the pointer zoom, pan and query a plot; return the function that removes this. */
function gestures(plot, tools) {
  const { element } = plot;
  const ended = new AbortController();
  const on = (name, listener) => element.addEventListener(name, listener, { signal: ended.signal, passive: false });
  let drag = null;
  on("pointerdown", (event) => {
    const from = inFrame(plot, event);
    if (event.button || !isInside(plot, from)) return;
    element.setPointerCapture(event.pointerId);
    drag = event.shiftKey || tools.isPanning() ? { last: from } : { from, box: selection(plot) };
    hideTips(element);
  });
  on("pointermove", (event) => {
    const at = inFrame(plot, event);
    if (!drag) showTips(plot, at);
    else if (drag.box) stretch(drag.box, corners(plot, drag.from, at));
    else {
      move(plot, at[0] - drag.last[0], at[1] - drag.last[1]);
      drag.last = at;
    }
  });
  const finish = (event) => {
    const { from, box } = drag ?? {};
    drag = null;
    box?.remove();
    if (box && event.type === "pointerup") zoomTo(plot, corners(plot, from, inFrame(plot, event)));
  };
  on("pointerup", finish);
  on("pointercancel", finish);
  on("pointerleave", () => hideTips(element));
  on("dblclick", () => plot.reset());
  on("wheel", (event) => {
    // Without a modifier key, the wheel scrolls the page.
    if (!event.ctrlKey && !event.metaKey && !tools.isPanning()) return;
    event.preventDefault();
    hideTips(element);
    zoomAround(plot, inFrame(plot, event), event.deltaY > 0 ? NOTCH : 1 / NOTCH);
  });
  return () => ended.abort();
}

/** Return the pointer's position in pixels from the upper left corner of the frame. */
function inFrame({ svg: drawing, frame }, event) {
  const { left, top } = drawing.getBoundingClientRect();
  return [event.clientX - left - frame.left, event.clientY - top - frame.top];
}

const isInside = ({ frame }, [x, y]) => x >= 0 && x <= frame.width && y >= 0 && y <= frame.height;

function selection(plot) {
  const box = svg("rect", { style: "fill: var(--link); fill-opacity: 0.12; stroke: var(--link); stroke-dasharray: 4 2" });
  plot.inside.append(box);
  return box;
}

/** Return the box between two points; a very narrow or flat one spans the whole frame. */
function corners({ frame }, [x, y], [x2, y2]) {
  const ends = (a, b, most) => {
    const [low, high] = [Math.max(Math.min(a, b), 0), Math.min(Math.max(a, b), most)];
    return high - low < LEAST_BOX ? [0, most] : [low, high];
  };
  const isBox = Math.max(Math.abs(x2 - x), Math.abs(y2 - y)) >= LEAST_BOX;
  return isBox ? [ends(x, x2, frame.width), ends(y, y2, frame.height)] : null;
}

function stretch(box, found) {
  const [[left, right], [top, bottom]] = found ?? [[0, 0], [0, 0]];
  dressed(box, { x: left, y: top, width: right - left, height: bottom - top });
}

function zoomTo(plot, box) {
  if (!box) return;
  const [[left, right], [top, bottom]] = box;
  const { width, height } = plot.frame;
  if (right - left < width) plot.x.zoom(left, right);
  if (bottom - top < height) plot.y.zoom(height - bottom, height - top);
}

function move(plot, right, down) {
  plot.x.zoom(-right, plot.frame.width - right);
  plot.y.zoom(down, plot.frame.height + down);
}

/** Zoom both axes out by `factor` about a fixed point of the frame. */
function zoomAround(plot, [x, y], factor) {
  const { width, height } = plot.frame;
  const up = height - y;
  plot.x.zoom(x - factor * x, x + factor * (width - x));
  plot.y.zoom(up - factor * up, up + factor * y);
}

/** Return the visible point nearest to a position in the frame; for a line, its nearer end. */
function nearestPoint(layer, [x, y]) {
  const { points: { x: xs, y: ys }, look } = layer;
  const joined = look.kind === "line";
  let best = { distance: NEAR, i: -1 };
  for (let i = 0; i < xs.length; i += 1) {
    const [dx, dy] = joined && i + 1 < xs.length ? [xs[i + 1] - xs[i], ys[i + 1] - ys[i]] : [0, 0];
    const along = ((x - xs[i]) * dx + (y - ys[i]) * dy) / (dx * dx + dy * dy);
    const share = along > 0 ? Math.min(along, 1) : 0; // NaN next to a gap
    const apart = share ? Math.hypot(xs[i] + share * dx - x, ys[i] + share * dy - y) : Math.hypot(xs[i] - x, ys[i] - y);
    if (apart < best.distance) best = { distance: apart, i: share > 0.5 ? i + 1 : i };
  }
  return best.i < 0 ? null : { ...best, layer };
}

/** Show the values under the pointer: the reference's on the left, other curves' on the right. */
function showTips(plot, at) {
  hideTips(plot.element);
  if (!isInside(plot, at)) return;
  const layers = plot.layers.filter(({ look, curve, hidden }) => !hidden && ["line", "marks"].includes(look.kind) && curve.role !== "other");
  const nearest = (isReference) => layers.filter(({ curve }) => (curve.role === "reference") === isReference)
    .map((layer) => nearestPoint(layer, at)).filter(Boolean)
    .reduce((best, each) => (best && best.distance <= each.distance ? best : each), null);
  let taken = null;
  for (const [side, point] of [["left", nearest(true)], ["right", nearest(false)]]) {
    if (point) taken = place(plot, point, side, taken);
  }
}

function hideTips(element) {
  for (const tip of element.querySelectorAll(".tip")) tip.remove();
}

/** Put the tip of a point on its left or right; below the tip `taken` if that is in its place. */
function place(plot, { layer, i }, side, taken) {
  const tip = make("div", { class: "tip" }, ...tipLines(plot.chart, layer.curve, i));
  plot.element.append(tip);
  const { left, width, top, height } = plot.frame;
  const [x, y] = [left + layer.points.x[i], top + layer.points.y[i]];
  const room = { left: x - 10 - tip.offsetWidth, right: x + 10 };
  const fits = { left: room.left >= 0, right: room.right + tip.offsetWidth <= left + width + RIGHT };
  const other = side === "left" ? "right" : "left";
  const to = fits[side] || !fits[other] ? side : other;
  const lowest = top + height - tip.offsetHeight;
  const below = taken?.to === to ? taken.bottom + 3 : Math.min(y - tip.offsetHeight / 2, lowest);
  tip.style.left = `${Math.max(room[to], 0)}px`;
  tip.style.top = `${Math.max(below, 0)}px`;
  return { to, bottom: Math.max(below, 0) + tip.offsetHeight };
}

function tipLines(chart, curve, i) {
  const [x, y] = [curve.x[i], curve.y[i]];
  const name = chart.over_time ? "t" : "x";
  const row = (what, value) => make("div", {}, make("span", {}, `${what}: `), value);
  const across = row(name, short(x));
  // In rows with names, y is the index of a row.
  if (chart.names.length) return [make("b", {}, chart.names[Math.floor(y)] ?? curve.label), across];
  return [make("b", {}, curve.label), across, row("value", short(y))];
}

/** Return the buttons of a plot; `current` returns the plot while it is drawn. */
function toolbar(title, current) {
  const box = make("div", { class: "tools", role: "group", "aria-label": `Tools of the plot ${title}` });
  const button = (text, label, action) => {
    const element = make("button", { type: "button", "aria-label": label, title: label }, text);
    element.addEventListener("click", () => { if (current()) action(current()); });
    box.append(element);
    return element;
  };
  const middle = ({ frame }) => [frame.width / 2, frame.height / 2];
  button("+", "Zoom in", (plot) => zoomAround(plot, middle(plot), 1 / NOTCH ** 2));
  button("−", "Zoom out", (plot) => zoomAround(plot, middle(plot), NOTCH ** 2));
  const pan = button("Pan", "Pan: dragging moves the plot and the wheel zooms; with Shift, dragging always moves it", () => {
    const pressed = pan.getAttribute("aria-pressed") !== "true";
    pan.setAttribute("aria-pressed", String(pressed));
    current().element.classList.toggle("panning", pressed);
  });
  pan.setAttribute("aria-pressed", "false");
  button("Reset", "Reset the zoom", (plot) => plot.reset());
  button("SVG", "Save as SVG", (plot) => save(new Blob([standalone(plot, title)], { type: "image/svg+xml" }), title, "svg"));
  button("PNG", "Save as PNG", async (plot) => save(await picture(plot, title), title, "png"));
  return { box, isPanning: () => pan.getAttribute("aria-pressed") === "true" };
}

/** Return a plot as SVG text with the page's colours. */
function standalone(plot, title) {
  const copy = plot.svg.cloneNode(true);
  copy.querySelector(".cursor").remove();
  copy.prepend(svg("title", {}, title), svg("rect", { width: "100%", height: "100%", style: "fill: var(--paper)" }));
  return new XMLSerializer().serializeToString(copy).replace(/var\((--\w+)\)/g, (_, name) => ink(name));
}

/** Return a plot as a PNG file at twice its screen size. */
async function picture(plot, title) {
  const image = new Image();
  image.src = `data:image/svg+xml,${encodeURIComponent(standalone(plot, title))}`;
  await image.decode();
  const canvas = make("canvas", { width: 2 * image.width, height: 2 * image.height });
  canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve) => { canvas.toBlob(resolve); });
}

function save(file, title, ending) {
  const name = title.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").slice(0, 80);
  const address = URL.createObjectURL(file);
  make("a", { href: address, download: `${name || "plot"}.${ending}` }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10e3);
}
