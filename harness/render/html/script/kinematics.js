// A pose is a position and a unit quaternion: [x, y, z, w, i, j, k].
const ORIGIN = [0, 0, 0, 1, 0, 0, 0];

/** Rotate a vector by the quaternion of a pose. */
function turned([, , , w, i, j, k], [x, y, z]) {
  const [a, b, c] = [2 * (j * z - k * y), 2 * (k * x - i * z), 2 * (i * y - j * x)];
  return [x + w * a + j * c - k * b, y + w * b + k * a - i * c, z + w * c + i * b - j * a];
}

/** Return a point of a pose's frame in the outer frame. */
function placedPoint(pose, point) {
  const [x, y, z] = turned(pose, point);
  return [x + pose[0], y + pose[1], z + pose[2]];
}

/** Return the pose of an inner frame in the outer one. */
function composed(outer, inner) {
  const [a, b, c, d] = outer.slice(3), [e, f, g, h] = inner.slice(3);
  return [...placedPoint(outer, inner.slice(0, 3)),
    a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
    a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
}

/** Return the pose after moving along a twist for a unit of time: angular, then linear velocity. */
function screwed([a, b, c, x, y, z]) {
  const angle = Math.hypot(a, b, c);
  const half = angle ? Math.sin(angle / 2) / angle : 0.5;
  const one = angle > 1e-4 ? (1 - Math.cos(angle)) / angle ** 2 : 0.5;
  const two = angle > 1e-4 ? (angle - Math.sin(angle)) / angle ** 3 : 1 / 6;
  const cross = ([p, q, r]) => [b * r - c * q, c * p - a * r, a * q - b * p];
  const first = cross([x, y, z]), second = cross(first);
  return [x, y, z].map((value, i) => value + one * first[i] + two * second[i])
    .concat([Math.cos(angle / 2), half * a, half * b, half * c]);
}

/** Return scene and states with the state of whole steps as the last one. */
function withActing(scene, states) {
  const { acting } = states ?? {};
  if (!acting) return [scene, states];
  const count = scene.placements[0].length / 7, nothing = acting.velocities.map(() => Array(count).fill(0));
  const extended = (rows, more) => rows.map((row, i) => [...row, more[i]]);
  const apart = states.accelerations.length ? states.accelerations : acting.apart.length ? nothing : [];
  return [
    { ...scene, placements: scene.placements.map((row, i) => [...row, ...acting.placements[i]]),
      velocities: extended(scene.velocities, acting.velocities), accelerations: extended(scene.accelerations, acting.accelerations) },
    { ...states, accelerations: extended(apart, acting.apart.length ? acting.apart : acting.velocities.map(() => 0)) },
  ];
}

/** Return scene and states with the pose as drawn as the last state, at rest. */
function withHome(scene, states) {
  if (!scene.home?.length) return [scene, states];
  const resting = (rows) => rows.map((row) => [...row, 0]);
  return [
    { ...scene, placements: scene.placements.map((row, i) => [...row, ...scene.home[i]]), velocities: resting(scene.velocities), accelerations: resting(scene.accelerations) },
    states && { ...states, accelerations: resting(states.accelerations) },
  ];
}

/** A tree of bodies at its states. From a state it moves with constant joint accelerations. */
class Mechanism {
  constructor(...given) {
    const [scene, states] = withHome(...withActing(...given));
    Object.assign(this, { scene, states });
    this.acting = states?.acting ?? null;
    let count = 0;
    this.slots = scene.joints.map(({ twists }) => {
      count += twists.length;
      return count - twists.length;
    });
    this.count = scene.placements[0].length / 7;
    this.home = scene.home?.length ? this.count - 1 : -1;
    this.wholeStep = this.acting ? this.count - (this.home < 0 ? 1 : 2) : -1;
    this.differs = Boolean(states?.accelerations.length);
  }

  /** Return whether nothing differs at a state. */
  agreesAt(state) {
    return this.states.accelerations.every((row) => !row[state]);
  }

  /** Return the displacement of each velocity coordinate after a time; `factor` amplifies the
   * engine's difference in acceleration, and is 0 for the equations. */
  displacements(state, time, factor) {
    const { velocities, accelerations } = this.scene;
    return velocities.map((row, i) => {
      const more = factor ? factor * this.states.accelerations[i][state] : 0;
      return row[state] * time + 0.5 * (accelerations[i][state] + more) * time ** 2;
    });
  }

  /** Return the pose of every joint in the world. */
  frames(state, time = 0, factor = 0) {
    const moved = this.displacements(state, time, factor);
    const joints = [];
    this.scene.joints.forEach(({ parent, twists }, i) => {
      const twist = [0, 0, 0, 0, 0, 0];
      twists.forEach((row, k) => row.forEach((value, n) => { twist[n] += value * moved[this.slots[i] + k]; }));
      const placed = this.scene.placements[i].slice(7 * state, 7 * state + 7);
      joints.push(composed(parent < 0 ? ORIGIN : joints[parent], composed(placed, screwed(twist))));
    });
    return joints;
  }

  /** Return the pose of every body in the world. */
  poses(state, time = 0, factor = 0) {
    const joints = this.frames(state, time, factor);
    return this.scene.bodies.map(({ joint, place }) => composed(joint < 0 ? ORIGIN : joints[joint], place));
  }

  /** Return the time in which the fastest joint moves by a third of a radian or of the length. */
  horizon(state) {
    const { velocities, accelerations, joints, length } = this.scene;
    let time = 10;
    joints.forEach(({ twists }, i) => twists.forEach((row, k) => {
      const allowed = row.slice(0, 3).some(Boolean) ? 0.35 : 0.35 * (length || 1);
      const speed = Math.abs(velocities[this.slots[i] + k][state]);
      const rate = Math.abs(accelerations[this.slots[i] + k][state]);
      // The positive root of speed t + rate t^2 / 2 = allowed.
      time = Math.min(time, (2 * allowed) / (speed + Math.sqrt(speed ** 2 + 2 * rate * allowed) || 1e-9));
    }));
    return time;
  }

  /** Return the power of ten that makes the largest difference visible; 0 to 6. */
  visiblePower(state) {
    if (!this.differs) return 0;
    const time = this.horizon(state);
    const largest = Math.max(...this.states.accelerations.map((row) => Math.abs(row[state] ?? 0)));
    const moved = 0.5 * largest * time ** 2;
    return moved ? Math.min(Math.max(Math.round(Math.log10(0.8 / moved)), 0), 6) : 6;
  }
}
