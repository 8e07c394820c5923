/** Evaluate a tree of results.json at positions q. */
function evaluate(tree, q) {
  if (typeof tree === "number") return tree;
  const [name, ...operands] = tree;
  if (name === "q") return q[operands[0]];
  const values = operands.map((operand) => evaluate(operand, q));
  switch (name) {
    case "+": return values.reduce((sum, value) => sum + value, 0);
    case "*": return values.reduce((product, value) => product * value, 1);
    case "^": return values[0] ** values[1];
    case "sin": return Math.sin(values[0]);
    case "cos": return Math.cos(values[0]);
    default: return Math.tan(values[0]);
  }
}

/** Return the matrix of a shape, as in drawing.py. */
function matrix(shape, q) {
  const at = (point) => point.map((part) => evaluate(part, q));
  if (shape.center) {
    const [x, y] = at(shape.center);
    const [w, h, a] = [shape.width, shape.height, shape.angle].map((part) => evaluate(part, q));
    return [w * Math.cos(a), w * Math.sin(a), -h * Math.sin(a), h * Math.cos(a), x, y];
  }
  const [x, y] = at(shape.start), [x2, y2] = at(shape.end);
  const dx = x2 - x, dy = y2 - y, length = Math.hypot(dx, dy) || 1;
  return [dx, dy, -dy / length, dx / length, x, y];
}

/** Interpolate positions at time t between two samples. */
function positions(track, t) {
  const i = Math.min(Math.max(nearest(track.t, t), 0), track.t.length - 1);
  const j = track.t[i] > t ? Math.max(i - 1, 0) : Math.min(i + 1, track.t.length - 1);
  const share = i === j ? 0 : (t - track.t[i]) / (track.t[j] - track.t[i]);
  return track.q.map((row) => row[i] + share * (row[j] - row[i]));
}

async function track(id, role, t, columns) {
  return { role, t: await column(id, t), q: await Promise.all(columns.map((each) => column(id, each))) };
}

/** The animation of a motion. */
async function player(id, motion, clock) {
  const box = make("section", { class: "motion", "aria-label": "Motion" }, make("h4", {}, "The mechanism in motion"));
  const tracks = await Promise.all([
    track(id, "reference", motion.t, motion.reference),
    ...motion.others.map((other) => track(id, "other", other.t, other.engine)),
    track(id, "engine", motion.t, motion.engine),
  ]);
  const { sketch } = await pack(motion.system);
  const still = document.querySelector(`[data-pack="${motion.system}"]`).closest(".view").querySelector("svg.sketch");
  const moving = sketch.shapes.map((shape, i) => [shape, i]).filter(([shape]) => !["measure", "angle", "line"].includes(shape.kind));
  const space = svg("g", { transform: "scale(1 -1)" });
  const drawing = svg("svg", {
    class: "sketch moving", role: "img", viewBox: frame(moving.map(([shape]) => shape), tracks[0]),
    "aria-label": "The mechanism at the time of the slider: wide, the reference; dashed, this engine; thin, the others.",
  }, space);
  const drawn = tracks.map((each) => {
    const layer = svg("g", { class: each.role });
    const shapes = moving.map(([shape, i]) => {
      const copy = still.querySelector(`[data-shape="${i}"]`).cloneNode(true);
      layer.append(copy);
      return [shape, copy];
    });
    space.append(layer);
    return [each, shapes];
  });
  clock.listeners.add((t) => {
    for (const [each, shapes] of drawn) {
      const q = positions(each, t);
      if (!q.every(Number.isFinite)) continue;
      for (const [shape, copy] of shapes) {
        copy.setAttribute("transform", `matrix(${matrix(shape, q).map((value) => value.toPrecision(7)).join(" ")})`);
      }
    }
  });
  const key = make("p", { class: "keys" },
    make("span", { class: "key reference" }, "reference"), make("span", { class: "key engine" }, "this engine"),
    ...(motion.others.length ? [make("span", { class: "key other" }, `${motion.others.length} other${motion.others.length > 1 ? "s" : ""}`)] : []));
  box.append(drawing, key);
  return box;
}

/** Return the view box of the reference's whole motion, y down. */
function frame(shapes, reference) {
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let k = 0; k < reference.t.length; k += 3) {
    const q = reference.q.map((row) => row[k]);
    for (const shape of shapes) {
      const [a, b, c, d, x, y] = matrix(shape, q);
      const corners = shape.center ? [[-0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [0.5, -0.5]] : [[0, 0], [1, 0]];
      for (const [u, v] of corners) {
        const [px, py] = [a * u + c * v + x, b * u + d * v + y];
        left = Math.min(left, px); right = Math.max(right, px);
        low = Math.min(low, py); high = Math.max(high, py);
      }
    }
  }
  const margin = 0.06 * Math.max(right - left, high - low);
  return [left - margin, -high - margin, right - left + 2 * margin, high - low + 2 * margin].join(" ");
}

function controls(clock) {
  const play = make("button", { type: "button", class: "play" }, "▶ Play");
  const speed = make("select", { "aria-label": "Speed" }, ...[0.1, 0.25, 1, 4].map((factor) => {
    const option = make("option", { value: factor }, `× ${factor}`);
    option.selected = factor === 1;
    return option;
  }));
  const time = make("input", { type: "range", min: 0, max: clock.end, step: clock.end / 1000, value: 0, "aria-label": "Time of the motion and of the plots, in seconds" });
  const shown = make("output", {}, "0 s");
  let last = null;
  const step = (now) => {
    if (last === null || !play.isConnected) return;
    const t = clock.t + ((now - last) / 1000) * Number(speed.value);
    last = now;
    clock.set(t >= clock.end ? 0 : t);
    requestAnimationFrame(step);
  };
  const stop = () => { last = null; play.textContent = "▶ Play"; };
  play.addEventListener("click", () => {
    if (last !== null) return stop();
    last = performance.now();
    play.textContent = "❚❚ Pause";
    requestAnimationFrame(step);
  });
  // Pause the animation of a case that is not in view.
  addEventListener("hashchange", stop);
  time.addEventListener("input", () => clock.set(Number(time.value)));
  const worst = make("button", { type: "button" }, "Worst time");
  worst.addEventListener("click", () => clock.set(clock.worst));
  clock.listeners.add((t) => { time.value = t; shown.textContent = `${t.toFixed(3)} s`; });
  return make("div", { class: "controls" }, play, speed, time, shown, worst);
}
