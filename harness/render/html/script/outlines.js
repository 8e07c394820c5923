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
};

/** Return what is drawn of a body: its shapes; without any, its inertia and its bones. */
function formsOf(scene, index) {
  const body = scene.bodies[index];
  const forms = body.shapes.filter(({ kind }) => OUTLINES[kind]);
  if (forms.length) return forms;
  const bones = scene.joints.map(({ parent }, i) => [parent, scene.placements[i].slice(0, 3)])
    .filter(([parent, end]) => parent === body.joint && parent >= 0 && Math.hypot(...end) > 0)
    .map(([, end]) => ({ kind: "bone", size: end, place: ORIGIN }));
  return [...bones, ...inertiaOf(body)];
}

/** Return the ellipsoid of a body's inertia, if there is one. */
const inertiaOf = ({ ellipsoid }) => (ellipsoid.length ? [{ kind: "ellipsoid", size: ellipsoid.slice(7), place: ellipsoid.slice(0, 7) }] : []);

/** Return the polylines of forms, in their body's frame. */
const outlines = (forms) => forms.flatMap(({ kind, size, place }) => OUTLINES[kind](size)
  .map((line) => line.map((point) => placedPoint(place, point))));

/** A camera on a sphere around a point; z is up. */
class Camera {
  constructor(center, radius) {
    Object.assign(this, { center, radius, yaw: -0.9, pitch: 0.35, distance: 3.4 * radius });
  }

  get position() {
    const { yaw, pitch, distance, center } = this;
    const away = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    return away.map((value, i) => center[i] + distance * value);
  }

  orbit(right, up) {
    this.yaw -= right;
    this.pitch = Math.min(Math.max(this.pitch + up, -1.55), 1.55);
  }

  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.3 * this.radius), 30 * this.radius);
  }

  /** Return a function from points to pixels and depth, for a picture of a size. */
  projection(width, height) {
    const { yaw, pitch } = this, [x, y, z] = this.position;
    const scale = Math.min(width, height) / 2 / Math.tan(FIELD / 2);
    const right = [-Math.sin(yaw), Math.cos(yaw), 0];
    const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const up = [-Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch)];
    const along = (axis, point) => axis[0] * point[0] + axis[1] * point[1] + axis[2] * point[2];
    return (point) => {
      const seen = [point[0] - x, point[1] - y, point[2] - z];
      const depth = Math.max(-along(back, seen), 1e-6);
      return [width / 2 + (scale * along(right, seen)) / depth, height / 2 - (scale * along(up, seen)) / depth, depth];
    };
  }
}

/** Angle of view over the smaller side, rad. */
const FIELD = 0.6;

/** A drawn projection, for browsers without WebGL. */
class Projection {
  constructor(canvas, scene, colours) {
    Object.assign(this, { canvas, colours, pen: canvas.getContext("2d") });
    this.lines = scene.bodies.map((_, i) => outlines(formsOf(scene, i)));
    this.inertia = scene.bodies.map((body) => outlines(inertiaOf(body)));
  }

  /** Draw the layers: `{ poses, colour(body), width, dash }`. */
  draw(camera, layers, inertia) {
    const { canvas, pen } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    pen.scale(ratio, ratio);
    const project = camera.projection(width, height);
    for (const { poses, ghost, tone } of layers) {
      pen.setLineDash(ghost ? [5, 3] : []);
      poses.forEach((pose, body) => {
        pen.strokeStyle = this.colours[tone(body)];
        pen.lineWidth = tone(body) === "lit" ? 2.4 : 1.2;
        this.#stroke(this.lines[body], pose, project);
        if (inertia && !ghost) this.#stroke(this.inertia[body], pose, project);
      });
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
