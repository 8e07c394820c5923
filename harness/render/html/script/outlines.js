const ROUND = Array.from({ length: 25 }, (_, i) => [Math.cos((i * Math.PI) / 12), Math.sin((i * Math.PI) / 12)]);

/** Return three ellipses of half axes. */
const ovals = ([a, b, c]) => [ROUND.map(([u, v]) => [a * u, b * v, 0]), ROUND.map(([u, v]) => [a * u, 0, c * v]),
  ROUND.map(([u, v]) => [0, b * u, c * v])];

/** Polylines of each form, by its half sizes. */
const OUTLINES = {
  box([a, b, c]) {
    const square = (z) => [[a, b, z], [-a, b, z], [-a, -b, z], [a, -b, z], [a, b, z]];
    return [square(c), square(-c), ...square(c).slice(1).map(([x, y]) => [[x, y, c], [x, y, -c]])];
  },
  sphere: ([r]) => ovals([r, r, r]),
  ellipsoid: ovals,
  cylinder([r, h]) {
    const circle = (z) => ROUND.map(([u, v]) => [r * u, r * v, z]);
    return [circle(h), circle(-h), ...[[r, 0], [-r, 0], [0, r], [0, -r]].map(([x, y]) => [[x, y, h], [x, y, -h]])];
  },
  capsule([r, h]) {
    const cap = (u, v) => [r * u, r * v + Math.sign(v) * h];
    const side = ROUND.map(([u, v]) => cap(u, v));
    return [...OUTLINES.cylinder([r, h]), side.map(([u, v]) => [u, 0, v]), side.map(([u, v]) => [0, u, v])];
  },
  bone: ([x, y, z]) => [[[0, 0, 0], [x, y, z]]],
  mesh: (mesh) => mesh.lines ??= sharpEdges(mesh),
};

const triangles = new WeakMap();

/** Return the points and faces of a mesh, unpacked once. */
function meshOf(packed) {
  if (triangles.has(packed)) return triangles.get(packed);
  const { low, extent, points, faces } = packed;
  const [shares, corners] = [points, faces].map((text) => {
    const view = new DataView(bytesOf(text).buffer);
    return Array.from({ length: view.byteLength / 2 }, (_, i) => view.getUint16(2 * i, true));
  });
  const threes = (values) => Array.from({ length: values.length / 3 }, (_, i) => values.slice(3 * i, 3 * i + 3));
  const mesh = { low, extent, faces: threes(corners), points: threes(shares.map((share, i) => low[i % 3] + (share / 65535) * extent[i % 3])) };
  mesh.normals = mesh.faces.map((face) => {
    const [a, b, c] = face.map((i) => mesh.points[i]);
    return crossed(b.map((value, i) => value - a[i]), c.map((value, i) => value - a[i]));
  });
  triangles.set(packed, mesh);
  return mesh;
}

const crossed = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

/** Return the cosine of the angle between two vectors; 1 for one without length. */
const cosine = (a, b) => {
  const size = Math.hypot(...a) * Math.hypot(...b);
  return size ? (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / size : 1;
};

/** Return the edges of a mesh at which its surface bends or ends. */
function sharpEdges({ points, faces, normals }) {
  const beside = new Map();
  faces.forEach((face, i) => face.forEach((corner, k) => {
    const other = face[(k + 1) % 3], key = Math.min(corner, other) * 65536 + Math.max(corner, other);
    beside.set(key, [...(beside.get(key) ?? []), i]);
  }));
  return [...beside].filter(([, [one, other]]) => other === undefined || cosine(normals[one], normals[other]) < 0.75)
    .map(([key]) => [points[Math.floor(key / 65536)], points[key % 65536]]);
}

/** Return what is drawn of a body: its shapes; without any, its inertia and its bones. */
function formsOf(scene, index) {
  const body = scene.bodies[index];
  const forms = body.shapes.filter(({ kind, mesh }) => (kind === "mesh" ? mesh != null : OUTLINES[kind]))
    .map((form) => (form.kind === "mesh" ? { ...form, size: meshOf(scene.meshes[form.mesh]) } : form));
  if (forms.length) return forms;
  const first = scene.bodies.findIndex(({ joint }) => joint === body.joint) === index;
  const bones = !first ? [] : scene.joints.map(({ parent }, i) => [parent, (scene.home?.length ? scene.home : scene.placements)[i].slice(0, 3)])
    .filter(([parent, end]) => parent === body.joint && parent >= 0 && Math.hypot(...end) > 0)
    .map(([, end]) => ({ kind: "bone", size: end, place: ORIGIN }));
  return [...bones, ...inertiaOf(body)];
}

/** Return the scene with a dot for each lit body that has no form. */
function withDots(scene, states) {
  const bodies = scene.bodies.map((body, i) => (states?.lit.includes(i) && !formsOf(scene, i).length
    ? { ...body, shapes: [{ kind: "sphere", size: [0.02 * (scene.length || 1)], place: ORIGIN }] } : body));
  return { ...scene, bodies };
}

/** Return an ellipsoid of inertia as a form, if there is one. */
const oval = (ellipsoid) => (ellipsoid.length ? [{ kind: "ellipsoid", size: ellipsoid.slice(7), place: ellipsoid.slice(0, 7) }] : []);

/** Return the ellipsoid of a body's inertia, if there is one. */
const inertiaOf = ({ ellipsoid }) => oval(ellipsoid);

/** Return the inertias to compare: those of the equations, and of an engine that reports them. */
function inertias(scene, states) {
  if (states?.inertias.length) return states.inertias.map(({ body, stated, ellipsoid, differs }) => ({ body, differs, stated: oval(stated), engine: oval(ellipsoid) }));
  return scene.bodies.map((body, i) => ({ body: i, differs: false, stated: inertiaOf(body), engine: [] }));
}

/** Return points around forms, in their body's frame: of a mesh, the corners of its box. */
const surroundings = (forms) => forms.flatMap(({ kind, size, place }) => (kind === "mesh" ? [0, 1, 2, 3, 4, 5, 6, 7]
  .map((corner) => size.low.map((low, i) => low + ((corner >> i) & 1) * size.extent[i])) : OUTLINES[kind](size).flat())
  .map((point) => placedPoint(place, point)));

/** Return the polylines of forms, in their body's frame. */
const outlines = (forms) => forms.flatMap(({ kind, size, place }) => OUTLINES[kind](size)
  .map((line) => line.map((point) => placedPoint(place, point))));

/** A camera on a sphere around a point; z is up. */
class Camera {
  constructor() {
    Object.assign(this, { center: [0, 0, 0], radius: 1, yaw: -0.9, pitch: 0.35, nearest: 3, zoomed: 1 });
  }

  get distance() {
    return this.nearest * this.zoomed;
  }

  /** Move so that all points are in a picture of a size, in the direction of view. */
  fit(points, width, height) {
    const [low, high] = [Math.min, Math.max].map((end) => [0, 1, 2].map((i) => points.reduce((value, point) => end(value, point[i]), points[0][i])));
    const middle = low.map((value, i) => (value + high[i]) / 2);
    this.radius = Math.max(Math.hypot(...high.map((value, i) => value - middle[i])), 1e-3);
    const { right, up, back } = this.axes;
    const seen = points.map((point) => [right, up, back].map((axis) => dot(axis, point.map((value, i) => value - middle[i]))));
    const half = Math.tan(FIELD / 2) / Math.min(width, height);
    let nearest = 0.5 * this.radius;
    // |side - shift| <= slope (distance - depth) for each point.
    const shifts = [width, height].map((size, i) => {
      const slope = (half * size) / ROOM;
      const [most, least] = [1, -1].map((sign) => Math.max(...seen.map((point) => sign * point[i] + slope * point[2])));
      nearest = Math.max(nearest, (most + least) / (2 * slope));
      return (most - least) / 2;
    });
    this.nearest = nearest;
    this.center = middle.map((value, i) => value + shifts[0] * right[i] + shifts[1] * up[i]);
  }

  get axes() {
    const { yaw, pitch } = this;
    return {
      right: [-Math.sin(yaw), Math.cos(yaw), 0],
      back: [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)],
      up: [-Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch)],
    };
  }

  get position() {
    const { distance, center, axes } = this;
    return axes.back.map((value, i) => center[i] + distance * value);
  }

  orbit(right, up) {
    this.yaw -= right;
    this.pitch = Math.min(Math.max(this.pitch + up, -1.55), 1.55);
  }

  zoom(factor) {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.08), 10);
  }

  /** Return a function from points to pixels and depth, for a picture of a size. */
  projection(width, height) {
    const { right, back, up } = this.axes, [x, y, z] = this.position;
    const scale = Math.min(width, height) / 2 / Math.tan(FIELD / 2);
    return (point) => {
      const seen = [point[0] - x, point[1] - y, point[2] - z];
      const depth = Math.max(-dot(back, seen), 1e-6);
      return [width / 2 + (scale * dot(right, seen)) / depth, height / 2 - (scale * dot(up, seen)) / depth, depth];
    };
  }
}

/** Angle of view over the smaller side, rad. */
const FIELD = 0.6;

/** Size of a picture over that of the bodies in it. */
const ROOM = 1.12;

const dot = ([a, b, c], [x, y, z]) => a * x + b * y + c * z;

/** A drawn projection, for browsers without WebGL. */
class Projection {
  constructor(scene, states, colours, { canvas }) {
    Object.assign(this, { canvas, colours, pen: canvas.getContext("2d") });
    this.lines = scene.bodies.map((_, i) => outlines(formsOf(scene, i)));
  }

  /** Show or hide a floor and axes, as lines with tones. */
  floor(lines, visible) {
    this.ground = visible ? lines : [];
  }

  /** Draw the layers: `{ poses, colour(body), width, dash }`. */
  draw(camera, layers, ovals) {
    const { canvas, pen } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    pen.scale(ratio, ratio);
    const project = camera.projection(width, height);
    pen.lineWidth = 1;
    for (const { tone, line } of this.ground) {
      pen.strokeStyle = this.colours[tone];
      pen.beginPath();
      line.map(project).forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.stroke();
    }
    for (const { poses, ghost, tone } of layers) {
      pen.setLineDash(ghost ? [5, 3] : []);
      poses.forEach((pose, body) => {
        if (!tone(body)) return;
        pen.strokeStyle = this.colours[tone(body)];
        pen.lineWidth = tone(body) === "lit" ? 2.4 : 1.2;
        this.#stroke(this.lines[body], pose, project);
      });
    }
    for (const { body, stated, engine } of ovals) {
      for (const [forms, colour, dash] of [[engine, "engine", []], [stated, "inertia", [3, 3]]]) {
        pen.setLineDash(dash);
        pen.strokeStyle = this.colours[colour];
        this.#stroke(outlines(forms), layers[0].poses[body], project);
      }
    }
  }

  end() {}

  #stroke(lines, pose, project) {
    this.pen.beginPath();
    for (const line of lines) {
      line.forEach((point, i) => {
        const [x, y] = project(placedPoint(pose, point));
        if (i) this.pen.lineTo(x, y); else this.pen.moveTo(x, y);
      });
    }
    this.pen.stroke();
  }
}
