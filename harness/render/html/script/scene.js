const LOOP = 2600;

/** Milliseconds; a loop whose frames take longer than this pauses by itself. */
const SLOW_FRAME = 250;

/** Bodies at a state: the equations' motion from it, and the engine's with an amplified difference. */
class Viewer {
  constructor(element, scene, states, drawing) {
    Object.assign(this, { element, data: scene, states, drawing, chosen: -1, listeners: new Set(), playing: false });
    this.mechanism = new Mechanism(scene, states);
    this.lit = new Set((states ?? scene.overlaid)?.lit ?? []);
    this.alone = ""; // of two robots, the one that is shown
    this.hovered = new Set();
    this.ovals = inertias(scene, states).map((oval) => ({ ...oval, points: surroundings([...oval.stated, ...oval.engine]) }));
    this.forces = true;
    this.camera = new Camera();
    this.around = scene.bodies.map((_, body) => surroundings(formsOf(scene, body)));
    // A placeholder larger than the robot would hide it.
    const whole = this.mechanism.poses(0).flatMap((pose, body) => this.around[body].map((point) => placedPoint(pose, point)));
    const unlike = this.ovals.filter(({ differs }) => differs);
    this.differs = unlike.length > 0;
    this.inertia = this.differs && unlike.every(({ points }) => extent(points) < 1.5 * extent(whole)) ? "differing" : "";
    this.floor = this.#floor();
    this.open(this.mechanism.home < 0 ? states?.worst ?? 0 : this.mechanism.home);
  }

  /** Return the lines of a grid under the bodies as drawn, and of the axes; none without that pose. */
  #floor() {
    const { mechanism, around } = this;
    if (mechanism.home < 0) return [];
    const points = mechanism.poses(mechanism.home).flatMap((pose, body) => around[body].map((point) => placedPoint(pose, point)));
    const [low, high] = [Math.min, Math.max].map((end) => [0, 1, 2].map((i) => points.reduce((value, point) => end(value, point[i]), points[0]?.[i] ?? 0)));
    const wide = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-3);
    const step = 10 ** Math.round(Math.log10(wide / 6)), most = Math.max(2, Math.ceil((0.6 * wide) / step));
    const [x, y] = [0, 1].map((i) => step * Math.round((low[i] + high[i]) / 2 / step)), [z] = low.slice(2);
    const lines = [];
    for (let i = -most; i <= most; i += 1) {
      for (const line of [[[x + i * step, y - most * step, z], [x + i * step, y + most * step, z]], [[x - most * step, y + i * step, z], [x + most * step, y + i * step, z]]]) lines.push({ tone: "grid", line });
    }
    return [...lines, ...["x", "y", "z"].map((tone, i) => ({ tone, line: [[0, 0, 0], [0, 1, 2].map((k) => (i === k ? 0.25 * wide : 0))] }))];
  }

  /** The state of whole steps, if it is shown. */
  get acting() {
    return this.state === this.mechanism.wholeStep ? this.mechanism.acting : null;
  }

  /** Show the start of a state, with a visible difference. */
  open(state) {
    this.state = Math.min(Math.max(state, 0), this.mechanism.count - 1);
    this.horizon = this.mechanism.horizon(this.state);
    this.power = this.mechanism.visiblePower(this.state);
    this.time = this.mechanism.differs && !this.mechanism.agreesAt(this.state) ? this.horizon : 0;
    this.fitted = "";
    this.changed();
  }

  set(changes) {
    Object.assign(this, changes);
    this.changed();
  }

  /** The inertias that are drawn: none, those that differ, or all. */
  get shown() {
    return this.inertia ? this.ovals.filter(({ differs }) => differs || this.inertia === "all") : [];
  }

  /** Redraw once before the next frame. */
  changed() {
    for (const listener of this.listeners) listener();
    this.request ??= requestAnimationFrame(() => { this.request = null; this.draw(); });
  }

  /** Return the poses of all bodies: by the equations, and in the engine. */
  poses() {
    const { mechanism, state, time } = this;
    const engine = mechanism.differs && !mechanism.agreesAt(state) ? [mechanism.poses(state, time, 10 ** this.power)] : [];
    return [mechanism.poses(state, time), ...engine];
  }

  /** Fit the camera to the bodies at both ends of the shown time, once per state and size. */
  #fit() {
    const { clientWidth: width, clientHeight: height } = this.drawing.canvas, { mechanism, state, horizon, power } = this;
    const fitted = `${state} ${width} ${height} ${this.inertia}`;
    if (!width || !height || this.fitted === fitted) return;
    this.fitted = fitted;
    const layers = [mechanism.poses(state), ...(this.poses().length > 1 ? [mechanism.poses(state, horizon), mechanism.poses(state, horizon, 10 ** power)] : [])];
    const points = layers.flatMap((poses) => poses.flatMap((pose, body) => this.around[body].map((point) => placedPoint(pose, point))));
    for (const { body, points: oval } of this.shown) points.push(...oval.map((point) => placedPoint(layers[0][body], point)));
    this.camera.fit(points.length ? points : [[0, 0, 0]], width, height);
  }

  draw() {
    this.#fit();
    const glow = this.playing ? Math.sin((performance.now() * Math.PI) / 600) : 0;
    const mark = (body) => (this.hovered.has(body) || body === this.chosen ? "chosen" : this.lit.has(body) ? "lit" : null);
    const [expected, engine] = this.poses(), { overlaid } = this.data;
    const layers = !overlaid ? [{ poses: expected, ghost: false, glow, tone: (body) => mark(body) ?? "body" }]
      : ["body", "second"].map((tone, i) => ({ poses: expected, ghost: i > 0 && !this.alone, glow,
        tone: (body) => ((body >= overlaid.second) === (i > 0) && (!this.alone || this.alone === tone) ? mark(body) ?? tone : null) }));
    if (engine) layers.push({ poses: engine, ghost: true, glow, tone: (body) => mark(body) ?? "engine" });
    const floats = this.data.joints.some(({ parent, twists }) => parent < 0 && twists.length === 6);
    this.drawing.floor(this.floor, !floats || this.state >= (this.mechanism.acting ? this.mechanism.wholeStep : this.mechanism.home));
    this.drawing.draw(this.camera, layers, this.shown, this.playing);
    const acting = this.forces ? this.acting : null;
    this.marks?.draw(this.camera, acting, acting ? this.mechanism.frames(this.state, this.time) : [], this.data.joints, this.data.bodies[this.chosen]?.joint);
    this.#label(expected);
    this.element.dataset.frames = Number(this.element.dataset.frames ?? 0) + 1;
  }

  /** Put the names of the wrong bodies at their places. */
  #label(poses) {
    const { canvas } = this.drawing;
    const project = this.camera.projection(canvas.clientWidth, canvas.clientHeight);
    const placed = [...this.element.querySelectorAll(".label")].map((label) => ({ label, at: project(this.#middle(Number(label.dataset.body), poses)) }));
    let least = 20;
    for (const { label, at: [x, y] } of placed.sort((a, b) => a.at[1] - b.at[1])) {
      const row = Math.max(Math.min(y, canvas.clientHeight - 8), least); // names without room are hidden
      least = row + label.offsetHeight + 2;
      Object.assign(label.style, { transform: `translate(${Math.min(Math.max(x, 4), canvas.clientWidth - label.offsetWidth - 14)}px, ${row}px)`, visibility: row > canvas.clientHeight - 8 ? "hidden" : "" });
    }
  }

  #middle(body, poses) {
    const { shapes, ellipsoid } = this.data.bodies[body];
    return placedPoint(poses[body], ellipsoid.length ? ellipsoid.slice(0, 3) : shapes[0]?.place.slice(0, 3) ?? [0, 0, 0]);
  }

  /** Return the body at a pixel, or without solids the nearest one; -1 if there is none. */
  pick(x, y) {
    const { canvas } = this.drawing;
    if (this.drawing.pick) return this.drawing.pick(x, y);
    const project = this.camera.projection(canvas.clientWidth, canvas.clientHeight);
    let [best, least] = [-1, 30];
    this.poses()[0].forEach((pose, body) => {
      const seen = this.around[body].map((point) => project(placedPoint(pose, point)));
      if (!seen.length) return;
      const [left, right, top, bottom] = [Math.min(...seen.map(([u]) => u)), Math.max(...seen.map(([u]) => u)), Math.min(...seen.map(([, v]) => v)), Math.max(...seen.map(([, v]) => v))];
      const outside = Math.hypot(Math.max(left - x, 0, x - right), Math.max(top - y, 0, y - bottom));
      const far = outside + 0.02 * Math.hypot((left + right) / 2 - x, (top + bottom) / 2 - y);
      if (far < least) [best, least] = [body, far];
    });
    return best;
  }

  /** Loop over the time around the state, unless drawing is too slow. */
  play() {
    this.playing = true;
    const began = performance.now() - (LOOP * this.time) / this.horizon;
    let [last, slow] = [performance.now(), 0];
    const step = (now) => {
      slow = now - last > SLOW_FRAME ? slow + 1 : 0;
      last = now;
      if (slow > 4) { this.set({ playing: false, time: this.horizon }); return; }
      if (!this.playing || !this.element.isConnected || !this.element.checkVisibility()) { this.playing = false; return; }
      const share = ((now - began) / LOOP) % 2;
      this.set({ time: this.horizon * (share < 1 ? share : 2 - share) });
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    this.changed();
  }
}

/** Return a scene with the bodies of another robot after its own. */
function bothRobots(scene, { other, ...more }) {
  const later = (index, rows) => (index >= 0 ? index + rows.length : index);
  const bodies = other.bodies.map((body) => ({ ...body, joint: later(body.joint, scene.joints),
    shapes: body.shapes.map((shape) => ({ ...shape, mesh: shape.mesh == null ? null : later(shape.mesh, scene.meshes) })) }));
  const joints = other.joints.map((joint) => ({ ...joint, parent: later(joint.parent, scene.joints) }));
  const whole = { bodies, joints, placements: other.placements, velocities: other.velocities, accelerations: other.accelerations, home: other.home, meshes: other.meshes };
  const joined = Object.entries(whole).map(([key, rows]) => [key, [...scene[key], ...rows]]);
  return { ...scene, ...Object.fromEntries(joined), overlaid: { second: scene.bodies.length, ...more } };
}

/** Build the picture of a model's bodies, its controls, its heat map and its source. */
async function buildScene(box) {
  if (box.dataset.built) return;
  box.dataset.built = "begun";
  const states = box.dataset.states ? await pack(box.dataset.states) : null;
  const { scene: bodies, overlaid } = await pack(box.dataset.scene);
  const scene = withDots(overlaid ? bothRobots(bodies, overlaid) : bodies, states ?? overlaid);
  const style = getComputedStyle(box);
  const colours = Object.fromEntries(["body", "engine", "second", "lit", "chosen", "inertia", "solid", "contact", "limit", "drive", "grid", "x", "y", "z"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  const plain = make("canvas", { tabindex: 0, role: "img", "aria-label": box.dataset.about });
  const solid = (await three()) && graphics(plain), canvas = solid?.canvas ?? plain;
  const drawing = new (solid ? Solids : Projection)(scene, states, colours, solid ?? { canvas });
  const over = make("canvas", { class: "marks", "aria-hidden": "true" });
  const picture = make("div", { class: "picture" }, canvas, over);
  const viewer = new Viewer(picture, scene, states, drawing);
  if (viewer.mechanism.acting) viewer.marks = new Marks(over, colours);
  for (const body of viewer.lit) picture.append(make("span", { class: "label", "data-body": body }, scene.bodies[body].name));
  box.viewer = viewer;
  box.dataset.drawing = solid ? "solids" : "projection";
  pointing(viewer, canvas);
  const columns = make("div", { class: "seen" }, make("div", {}, picture, sceneControls(viewer)));
  const lines = states?.text ? source(viewer) : null;
  if (lines) columns.append(lines);
  box.append(columns);
  if (states) box.append(heatMap(viewer));
  new ResizeObserver(() => { if (canvas.isConnected) viewer.changed(); }).observe(canvas);
  viewer.changed();
  box.dataset.built = "scene";
}

/** Remove the picture of a page that the reader left. */
function endScene(box) {
  if (!box.viewer) return;
  box.viewer.playing = false;
  cancelAnimationFrame(box.viewer.request);
  box.viewer.drawing.end();
  box.replaceChildren();
  delete box.viewer;
  delete box.dataset.built;
}

/** Rotate with the pointer or the arrow keys, zoom with + and -, choose with a click. */
function pointing(viewer, canvas) {
  let last = null, moved = 0;
  canvas.addEventListener("pointerdown", (event) => { last = event; moved = 0; canvas.setPointerCapture(event.pointerId); });
  const under = ({ clientX, clientY }) => {
    const { left, top } = canvas.getBoundingClientRect();
    return viewer.pick(clientX - left, clientY - top);
  };
  const hover = (body) => {
    if (viewer.hovered.has(body) || (body < 0 && !viewer.hovered.size)) return;
    viewer.set({ hovered: new Set(body < 0 ? [] : [body]) });
    canvas.title = viewer.data.bodies[body]?.name ?? "";
  };
  canvas.addEventListener("pointerleave", () => hover(-1));
  canvas.addEventListener("pointermove", (event) => {
    if (!last) { hover(under(event)); return; }
    moved += Math.abs(event.clientX - last.clientX) + Math.abs(event.clientY - last.clientY);
    viewer.camera.orbit((event.clientX - last.clientX) / 120, (event.clientY - last.clientY) / 120);
    last = event;
    viewer.changed();
  });
  canvas.addEventListener("pointerup", (event) => {
    last = null;
    if (moved > 4) return;
    viewer.set({ chosen: under(event) });
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return;
    event.preventDefault();
    viewer.camera.zoom(Math.exp(event.deltaY / 400));
    viewer.changed();
  }, { passive: false });
  const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  canvas.addEventListener("keydown", (event) => {
    if (keys[event.key]) viewer.camera.orbit(...keys[event.key]);
    else if ("+=-".includes(event.key)) viewer.camera.zoom(event.key === "-" ? 1.15 : 1 / 1.15);
    else return;
    event.preventDefault();
    viewer.changed();
  });
}

function slider(label, attributes, change) {
  const input = make("input", { type: "range", "aria-label": label, ...attributes });
  const output = make("output");
  input.addEventListener("input", () => change(Number(input.value)));
  return { input, output, row: make("label", { class: "slide" }, make("span", {}, label), input, output) };
}

function sceneControls(viewer) {
  const { mechanism, data } = viewer;
  const play = make("button", { type: "button", class: "play" });
  play.addEventListener("click", () => { if (viewer.playing) viewer.set({ playing: false }); else viewer.play(); });
  const time = slider("Time", { min: 0, max: 1000, step: 1 }, (value) => viewer.set({ playing: false, time: (value / 1000) * viewer.horizon }));
  const state = slider("State", { min: mechanism.home < 0 ? 1 : 0, max: mechanism.count - (mechanism.home < 0 ? 0 : 1), step: 1 }, (value) => viewer.open(value ? value - 1 : mechanism.home));
  const worst = make("button", { type: "button" }, "Worst state");
  worst.addEventListener("click", () => {
    viewer.open(viewer.states.worst);
    if (mechanism.differs && !matchMedia("(prefers-reduced-motion: reduce)").matches) viewer.play();
  });
  const power = slider("Amplify the error", { min: 0, max: 6, step: 0.5 }, (value) => viewer.set({ power: value }));
  const links = data.bodies.map(({ name }, i) => make("option", { value: i }, name));
  const link = make("select", { "aria-label": "Link" }, make("option", { value: -1 }, "–"),
    ...links.filter((_, i) => viewer.lit.has(i)), ...links.filter((_, i) => !viewer.lit.has(i)));
  link.addEventListener("change", () => viewer.set({ chosen: Number(link.value) }));
  const inertia = make("select", {}, ...[["", "none"], ...(viewer.differs ? [["differing", "that differs"]] : []), ["all", "all"]].map(([value, text]) => make("option", { value }, text)));
  inertia.addEventListener("change", () => viewer.set({ inertia: inertia.value }));
  const toggle = (name) => {
    const input = make("input", { type: "checkbox" });
    input.checked = viewer[name];
    input.addEventListener("change", () => viewer.set({ [name]: input.checked }));
    return input;
  };
  const { acting } = mechanism, words = make("p", { class: "acting" });
  viewer.listeners.add(() => {
    play.textContent = viewer.playing ? "❚❚ Pause" : "▶ Play";
    time.input.value = (1000 * viewer.time) / viewer.horizon;
    time.output.textContent = `${short(1000 * viewer.time)} ms`;
    const drawn = viewer.state === mechanism.home, many = viewer.data.velocities[0].length;
    state.input.value = drawn ? 0 : viewer.state + 1;
    state.output.textContent = drawn ? "as drawn" : viewer.acting ? "whole step" : `${viewer.state + 1} of ${many}`;
    words.textContent = viewer.acting ? `At this state: ${actingWords(acting, data.joints)}.` : "";
    power.input.value = viewer.power;
    power.output.textContent = `× ${Number((10 ** viewer.power).toPrecision(2)).toLocaleString("en")}`;
    link.value = viewer.chosen;
    inertia.value = viewer.inertia;
  });
  const { overlaid } = data, alone = make("select", {}, make("option", { value: "" }, "both"), ...["body", "second"].map((value, i) => make("option", { value }, "AB"[i])));
  alone.addEventListener("change", () => viewer.set({ alone: alone.value }));
  const moving = overlaid ? [] : [make("div", { class: "row" }, play, time.row), make("div", { class: "row" }, ...(viewer.states ? [worst] : []), state.row)];
  const rows = [...moving, ...(mechanism.differs ? [power.row] : []),
    make("div", { class: "row" }, ...(overlaid ? [make("label", {}, "Robot ", alone)] : []), make("label", {}, "Link ", link), make("label", {}, "Inertia ", inertia),
      ...(acting ? [make("label", {}, toggle("forces"), " Contacts, limits, drives")] : []))];
  const solid = viewer.states?.inertias.length;
  const keys = ["body", ...(overlaid ? ["second"] : []), ...(mechanism.differs ? ["engine"] : []), ...(acting ? ["contact", "limit", "drive"] : []), "inertia", ...(solid ? ["solid"] : [])];
  const [ours, theirs] = overlaid ? overlaid.names.map((name, i) => `${"AB"[i]}: ${name}`) : ["equations"];
  const names = { body: ours, second: theirs, engine: "engine", inertia: "inertia by the equations", solid: "inertia in the engine", contact: "contact", limit: "beyond a limit", drive: "drive; thick: at its limit" };
  const shown = new Map(keys.map((key) => [key, make("span", { class: `key ${key}` }, names[key])]));
  viewer.listeners.add(() => {
    for (const key of ["inertia", "solid"]) shown.get(key)?.toggleAttribute("hidden", !viewer.inertia);
    for (const key of ["contact", "limit", "drive"]) shown.get(key)?.toggleAttribute("hidden", !viewer.acting || !viewer.forces);
  });
  return make("div", { class: "steering" }, ...rows, make("p", { class: "keys" }, ...shown.values(),
    ...(viewer.lit.size ? [make("span", { class: "key lit" }, overlaid ? "differs" : "named by the cause")] : [])), words, ...unlikeInertias(viewer));
}

/** Return the largest extent of points along an axis. */
const extent = (points) => Math.max(...[0, 1, 2].map((i) => points.reduce((most, point) => Math.max(most, point[i]), -Infinity) - points.reduce((least, point) => Math.min(least, point[i]), Infinity)));

/** Say which inertias of the engine differ. */
function unlikeInertias({ states, data, inertia }) {
  const wrong = (states?.inertias ?? []).filter(({ differs }) => differs);
  if (!wrong.length) return [];
  const names = wrong.slice(0, 5).map(({ body, mass, stated_mass: stated }) => (Math.abs(mass - stated) > 1e-3 * stated
    ? `${data.bodies[body].name} (mass ${short(mass)} kg instead of ${short(stated)})` : data.bodies[body].name));
  const more = wrong.length > 5 ? ` and ${wrong.length - 5} more` : "";
  return [make("p", { class: "unequal" }, `The engine has another inertia of ${names.join(", ")}${more}.${inertia ? "" : " It is larger than the robot; “Inertia” shows it."}`)];
}

/** The source of the model: its lines light links up, and a chosen link shows its lines. */
function source(viewer) {
  const { text, lines, file, marked } = viewer.states;
  const owner = new Map();
  lines.forEach((spans, body) => spans.forEach(([first, last]) => {
    for (let line = first; line <= last; line += 1) owner.set(line, body);
  }));
  const rows = text.split(/\r\n|\r|\n/).map((row, i) => make("li", { "data-line": i + 1, ...(marked.includes(i + 1) ? { class: "marked" } : {}) }, make("code", {}, row || " ")));
  const list = make("ol", {}, ...rows);
  const open = make("a", { class: "editor" });
  const over = (event) => {
    const body = owner.get(Number(event.target.closest("li")?.dataset.line));
    viewer.hovered = new Set(body === undefined ? [] : [body]);
    viewer.changed();
  };
  list.addEventListener("pointerover", over);
  list.addEventListener("pointerleave", () => { viewer.hovered = new Set(); viewer.changed(); });
  list.addEventListener("click", (event) => {
    const body = owner.get(Number(event.target.closest("li")?.dataset.line));
    if (body !== undefined) viewer.set({ chosen: body });
  });
  let before = null;
  const show = (line) => {
    open.href = `vscode://file/${file.replace(/^\//, "")}:${line}`;
    open.textContent = `Open line ${line} in the editor`;
    list.scrollTop = rows[line - 1].offsetTop - list.clientHeight / 3;
  };
  let under = "";
  viewer.listeners.add(() => {
    const hovered = [...viewer.hovered].join();
    if (hovered === under) return;
    under = hovered;
    rows.forEach((row, i) => row.classList.toggle("hovered", hovered !== "" && viewer.hovered.has(owner.get(i + 1))));
  });
  viewer.listeners.add(() => {
    if (viewer.chosen === before) return;
    before = viewer.chosen;
    const spans = lines[before] ?? [];
    rows.forEach((row, i) => row.classList.toggle("owned", spans.some(([first, last]) => first <= i + 1 && i + 1 <= last)));
    if (spans.length) show(spans[0][0]);
  });
  requestAnimationFrame(() => show(marked[0] ?? lines[viewer.states.lit[0]]?.[0]?.[0] ?? 1));
  return make("div", { class: "source linked", role: "region", "aria-label": "The file; a line lights up its link" }, list, make("p", {}, open));
}

/** Errors of all coordinates and states; a click shows the state and the link. */
function heatMap(viewer) {
  const { coordinates, error, uncertainty, bodies } = viewer.states;
  const count = error[0].length;
  const level = (row, state) => Math.log10(error[row][state] / uncertainty[row][state]);
  const drawing = svg("svg", { viewBox: `0 0 ${count} ${coordinates.length}`, preserveAspectRatio: "none" });
  coordinates.forEach((_, row) => {
    for (let state = 0; state < count; state += 1) {
      const size = level(row, state), share = Number.isFinite(size) ? Math.min(Math.max(size / 9, 0), 1) : 0;
      const style = size > 0 ? `fill: color-mix(in srgb, var(--differs) ${Math.round(25 + 75 * share)}%, var(--paper))` : "fill: color-mix(in srgb, var(--agrees) 22%, var(--paper))";
      drawing.append(svg("rect", { x: state + 0.04, y: row + 0.06, width: 0.92, height: 0.88, style, "data-row": row, "data-state": state }));
    }
  });
  const mark = svg("rect", { class: "mark", width: 1, height: 1 });
  drawing.append(mark);
  const readout = make("p", { class: "readout", role: "status" });
  let row = Math.max(0, coordinates.findIndex((_, i) => level(i, viewer.state) === Math.max(...coordinates.map((__, k) => level(k, viewer.state)))));
  const go = (to, state) => {
    row = Math.min(Math.max(to, 0), coordinates.length - 1);
    viewer.chosen = bodies[row];
    viewer.open(Math.min(Math.max(state, 0), count - 1));
  };
  const frame = make("div", { class: "heat", tabindex: 0, role: "group", "aria-label": `Errors of ${coordinates.length} coordinates at ${count} states; arrow keys choose a state and a coordinate` }, drawing);
  frame.style.setProperty("--rows", coordinates.length);
  drawing.addEventListener("click", (event) => {
    const { row: to, state } = event.target.dataset;
    if (to !== undefined) go(Number(to), Number(state));
  });
  frame.addEventListener("keydown", (event) => {
    const [down, right] = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key] ?? [0, 0];
    if (!down && !right) return;
    event.preventDefault();
    go(row + down, viewer.state + right);
  });
  viewer.listeners.add(() => {
    frame.classList.toggle("apart", viewer.state >= count);
    mark.setAttribute("x", viewer.state);
    mark.setAttribute("y", row);
    const [e, u] = [error[row][viewer.state], uncertainty[row][viewer.state]];
    readout.textContent = viewer.state === viewer.mechanism.home ? "The picture shows the pose as drawn." : viewer.state >= count ? "The picture shows a whole step." : `${coordinates[row]} at state ${viewer.state + 1}: E ${e?.toExponential(1) ?? "–"}, U ${u?.toExponential(1) ?? "–"}`;
  });
  const keys = [["below", "E below U: agrees"], ["above", "E above U: differs; stronger up to 10⁹ times U"]].map(([name, text]) => make("span", { class: `key ${name}` }, text));
  return make("section", { class: "errors" }, make("h4", {}, "Error over uncertainty, by coordinate and state"), make("p", { class: "keys" }, ...keys), make("div", { class: "rows" }, make("ul", { "aria-hidden": "true" }, ...coordinates.map((name) => make("li", { title: name }, name))), frame), readout);
}
