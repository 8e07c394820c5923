/** Contacts, joint limits and drives, drawn over the picture at the state of whole steps. */
class Marks {
  constructor(canvas, colours) {
    Object.assign(this, { canvas, colours, pen: canvas.getContext("2d") });
  }

  /** Draw the marks of a state; none without one. */
  draw(camera, acting, frames, joints, chosen) {
    const { canvas, pen } = this, ratio = devicePixelRatio || 1;
    canvas.hidden = !acting; // which saves laying it over the picture
    const [width, height] = acting ? [canvas.clientWidth, canvas.clientHeight] : [1, 1];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    if (!acting) return;
    pen.scale(ratio, ratio);
    pen.lineCap = pen.lineJoin = "round";
    this.project = camera.projection(width, height);
    const size = camera.radius / 12;
    acting.drives.forEach(({ joint, share }) => this.#drive(frames[joint], joints[joint], share ?? 0.5, share !== null, 0.55 * size));
    acting.limits.filter((limit) => isBeyond(limit) || limit.joint === chosen)
      .forEach((limit) => this.#limit(frames[limit.joint], joints[limit.joint], limit, size));
    acting.contacts.forEach(({ point, normal }) => this.#contact(point, normal, 1.6 * size));
  }

  #line(points, colour, width) {
    const { pen } = this;
    pen.strokeStyle = this.colours[colour];
    pen.lineWidth = width;
    pen.beginPath();
    points.map(this.project).forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  }

  #dot(point, colour, radius) {
    const { pen } = this, [x, y] = this.project(point);
    pen.fillStyle = this.colours[colour];
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  }

  /** Draw an arrow along the normal of a contact. */
  #contact(point, normal, length) {
    const end = point.map((value, i) => value + length * normal[i]);
    this.#line([point, end], "contact", 2);
    const [[x, y], [u, v]] = [point, end].map(this.project), angle = Math.atan2(v - y, u - x), { pen } = this;
    pen.beginPath();
    for (const turn of [0, 2.6, -2.6]) pen.lineTo(u + 6 * Math.cos(angle + turn), v + 6 * Math.sin(angle + turn));
    pen.fillStyle = this.colours.contact;
    pen.fill();
    this.#dot(point, "contact", 3);
  }

  /** Draw the range of a joint around its axis, and its position. */
  #limit(frame, { twists: [twist] }, limit, size) {
    const [axis, across] = axesOf(twist), colour = isBeyond(limit) ? "limit" : "body";
    const ends = [limit.lower ?? -Math.PI, limit.upper ?? Math.PI];
    const at = twist.slice(0, 3).some(Boolean)
      ? (value, far) => placedPoint(frame, rotated(across, axis, value).map((one) => far * one))
      : (value, far) => placedPoint(frame, axis.map((one, i) => one * value + (far - size) * across[i]));
    const steps = Array.from({ length: 33 }, (_, i) => ends[0] + (i / 32) * (ends[1] - ends[0]));
    this.#line(steps.map((value) => at(value, size)), colour, 3);
    for (const end of ends) this.#line([at(end, 0.7 * size), at(end, 1.3 * size)], colour, 2);
    this.#line([at(0, 0), at(0, 1.3 * size)], colour, 2);
    this.#dot(at(0, 1.3 * size), colour, 3.5);
  }

  /** Draw the force of a drive as an arc around its axis, or a line along it; a full one is thick. */
  #drive(frame, { twists: [twist] }, share, limited, size) {
    const [axis, across] = axesOf(twist), saturated = limited && Math.abs(share) >= 0.999;
    const part = (i) => (i / 24) * share;
    const at = twist.slice(0, 3).some(Boolean)
      ? (value) => placedPoint(frame, rotated(across, axis, 4.7 * value).map((one) => size * one))
      : (value) => placedPoint(frame, axis.map((one) => 2 * size * value * one));
    if (!share) return;
    this.#line(Array.from({ length: 25 }, (_, i) => at(part(i))), "drive", saturated ? 4 : 1.5);
    this.#dot(at(share), "drive", saturated ? 4 : 2.2);
  }
}

/** Return whether a joint is beyond a limit. */
const isBeyond = ({ lower, upper }) => (lower ?? -1) > 0 || (upper ?? 1) < 0;

/** Return the axis of a joint, and a direction across it. */
function axesOf(twist) {
  const whole = twist.slice(0, 3).some(Boolean) ? twist.slice(0, 3) : twist.slice(3);
  const size = Math.hypot(...whole) || 1, axis = whole.map((value) => value / size);
  const least = axis.map(Math.abs).indexOf(Math.min(...axis.map(Math.abs)));
  const side = crossed(axis, [0, 1, 2].map((i) => Number(i === least))), length = Math.hypot(...side) || 1;
  return [axis, side.map((value) => value / length)];
}

/** Rotate a vector across a unit axis about it. */
function rotated(vector, axis, angle) {
  const other = crossed(axis, vector);
  return vector.map((value, i) => Math.cos(angle) * value + Math.sin(angle) * other[i]);
}

/** Describe what acts at a state. */
function actingWords({ contacts, limits, drives }, joints) {
  const named = (marks) => {
    const names = marks.map(({ joint }) => joints[joint].name);
    return names.length > 6 ? `${names.slice(0, 6).join(", ")} and ${names.length - 6} more` : names.join(", ");
  };
  const many = (count, one) => `${count} ${one}${count === 1 ? "" : "s"}`;
  const beyond = limits.filter(isBeyond), full = drives.filter(({ share }) => share !== null && Math.abs(share) >= 0.999);
  return [
    contacts.length ? `${many(contacts.length, "contact")}` : "no contacts",
    beyond.length ? `beyond a limit: ${named(beyond)}` : "no joint is beyond a limit",
    ...(drives.length ? [full.length ? `drives at a limit: ${named(full)}` : `${many(drives.length, "drive")}, none at a limit`] : []),
  ].join("; ");
}
