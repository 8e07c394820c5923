"""Bodies in a plane that joints, motors, springs and contacts move by impulses, row by row.

A step advances positions by the old velocities, adds springs and gravity to the velocities, then
the impulses of the step before, and corrects row after row, a given number of times. Overlaps are
corrected by velocities of their own, which act on the next positions only. Source: Chipmunk 7,
cpSpaceStep.c, cpArbiter.c, and the file of each joint.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.planar import PlanarContact, PlanarJoint, PlanarLaws

EPS = float(np.finfo(float).eps)

DIGITS = 4
"""Last digits by which each term may be rounded."""

SPRINGS = "spring", "rotary spring"

LIMITS = "slide", "rotary limit"

CacheKey = tuple[tuple[int, int], int]


@dataclass(kw_only=True, eq=False)
class PlanarMotion:
    """Velocities while impulses change them.

    Attributes:
        values: of N bodies, x, y and angle, (3 N,).
        noise: source of random rounding; None for none.
    """

    values: Array
    noise: np.random.Generator | None = None

    def push(self, change: Array) -> None:
        """Add a change."""
        self.values = self.values + change
        if self.noise is not None:
            self.values = self.values + self.rounding(np.abs(self.values))

    def rounding(self, sizes: Array) -> Array:
        """Return random rounding of terms of some sizes."""
        if self.noise is None:
            return np.zeros_like(sizes)
        drawn: Array = DIGITS * EPS * sizes * self.noise.uniform(-1, 1, len(sizes))
        return drawn


@dataclass(kw_only=True, eq=False)
class Row:
    """One or two velocities that an impulse corrects.

    Attributes:
        along: velocities of the row by those of the bodies, (R, 3 N).
        pattern: forces on the bodies per impulse, (R, 3 N).
        inverse: inverse masses and moments, (3 N,).
        target: velocities to reach, (R,).
        place: size of the positions whose differences are in `along`, m.
        size: magnitude of the terms of the target.
        low, high: bounds of an impulse.
        impulse: so far, (R,).
    """

    along: Array
    pattern: Array
    inverse: Array
    target: Array
    place: float = 0.0
    size: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    impulse: Array = field(default_factory=lambda: np.zeros(1))

    def bounded(self, impulse: Array) -> Array:
        """Return an impulse within its bounds."""
        return np.clip(impulse, self.low, self.high)

    def lacking(self, motion: PlanarMotion) -> Array:
        """Return the impulse that reaches the target, beyond the present one, (R,)."""
        lacks: Array = self.target - self.along @ motion.values
        return self.inertia @ lacks

    def correct(self, motion: PlanarMotion) -> None:
        """Change the impulse and the velocities."""
        self.apply(motion, self.bounded(self.impulse + self.lacking(motion)))

    def apply(self, motion: PlanarMotion, impulse: Array) -> None:
        """Replace the impulse."""
        change, self.impulse = impulse - self.impulse, impulse
        if motion.noise is not None:
            magnitude, inertia = self._lengths
            unsure = float(magnitude @ np.abs(motion.values)) + self.size
            change = change + motion.rounding(unsure * inertia + np.abs(impulse))
        motion.push(change @ self.response)

    def warm_start(self, motion: PlanarMotion) -> None:
        """Add the impulse of the step before."""
        motion.push(self.impulse @ self.response)

    @cached_property
    def response(self) -> Array:
        """Velocities of the bodies per impulse, (R, 3 N)."""
        result: Array = self.pattern * self.inverse
        return result

    @cached_property
    def inertia(self) -> Array:
        """Impulses per change of the velocities of the row, (R, R)."""
        return np.asarray(np.linalg.inv(self.along @ self.response.T), dtype=np.float64)

    @cached_property
    def _lengths(self) -> tuple[Array, float]:
        """Magnitudes of the row's terms, (3 N,), and the largest inertia."""
        magnitude = np.abs(self.along).sum(0) + np.abs(self.pattern).sum(0)
        magnitude[2::3] += self.place * (magnitude[::3] + magnitude[1::3])
        return magnitude, float(np.max(np.abs(self.inertia)))


@dataclass(kw_only=True, eq=False)
class SpringRow(Row):
    """A damper that removes a share of a velocity, and that its own impulses do not damp."""

    share: float

    def correct(self, motion: PlanarMotion) -> None:
        """Change the impulse and the velocities."""
        rate = self.along @ motion.values
        loss = (self.target - rate) * self.share
        self.target = rate + loss
        self.apply(motion, self.bounded(self.impulse + self.inertia @ loss))


@dataclass(kw_only=True, eq=False)
class PointRow(Row):
    """An impulse of two components, limited together; in a groove, across it.

    Attributes:
        across: normal of the groove, (2,); None for a pivot.
        end: side of the groove whose end is met: 1, -1, or 0.
    """

    across: Array | None = None
    end: float = 0.0

    def bounded(self, impulse: Array) -> Array:
        """Return an impulse within its bounds."""
        if self.across is not None and not self.end * _cross(impulse, self.across) > 0:
            impulse = (impulse @ self.across) * self.across
        return _shortened(impulse, self.high)


@dataclass(kw_only=True, eq=False)
class ContactRows:
    """The rows of a contact: normal, friction, and the correction of an overlap."""

    normal: Row
    across: Row
    overlap: Row
    friction: float

    def correct(self, motion: PlanarMotion, shifts: PlanarMotion) -> None:
        """Change the impulses; both act on the velocities before them."""
        self.overlap.correct(shifts)
        normal = self.normal.bounded(self.normal.impulse + self.normal.lacking(motion))
        across = self.across.impulse + self.across.lacking(motion)
        largest = self.friction * float(normal[0])
        self.normal.apply(motion, normal)
        self.across.apply(motion, np.clip(across, -largest, largest))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarState:
    """A state between two steps.

    Attributes:
        places: centers of mass and angles, (N, 3).
        velocities, shifts: of them, and those that correct overlaps, (N, 3).
        joints: impulses of the joints.
        contacts: impulses along the normal and across, by shapes and key.
        acted: how often forces of each kind acted in the last step.
    """

    places: Array
    velocities: Array
    shifts: Array
    joints: tuple[Array, ...] = ()
    contacts: dict[CacheKey, tuple[Array, Array]] = field(default_factory=dict)
    acted: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarModel:
    """Bodies in a plane, and their steps."""

    laws: PlanarLaws

    @cached_property
    def inverse(self) -> Array:
        """The inverse masses and moments, (N, 3)."""
        rows = [(1 / body.mass, 1 / body.mass, 1 / body.moment) for body in self.laws.bodies]
        return np.array(rows)

    @cached_property
    def _masses(self) -> Array:
        return self.inverse.ravel()

    @property
    def _centers(self) -> Array:
        return np.array([body.center for body in self.laws.bodies])

    def at_rest(self, places: Array, velocities: Array) -> PlanarState:
        """Return a state without impulses; arguments are (N, 3), of the bodies' origins."""
        shifted = places.copy()
        shifted[:, :2] += _rotated(places[:, 2], self._centers)
        return PlanarState(
            places=shifted,
            velocities=velocities,
            shifts=np.zeros_like(velocities),
        )

    def origins(self, state: PlanarState) -> Array:
        """Return the origins and angles of the bodies, (N, 3)."""
        result = state.places.copy()
        result[:, :2] -= _rotated(state.places[:, 2], self._centers)
        return result

    def advance(
        self,
        state: PlanarState,
        contacts: Sequence[PlanarContact],
        noise: np.random.Generator | None = None,
    ) -> PlanarState:
        """Return the state after a step.

        Args:
            state: before it.
            contacts: at the new positions.
            noise: source of random rounding of every term; None for none.
        """
        h = self.laws.step
        places = state.places + h * (state.velocities + state.shifts)
        motion = PlanarMotion(values=state.velocities.ravel(), noise=noise)
        shifts = PlanarMotion(values=np.zeros_like(motion.values), noise=noise)
        touching = [self._contact(contact, state, places) for contact in contacts]
        joints = [
            self._joint(joint, places, state.joints[i] if state.joints else None)
            for i, joint in enumerate(self.laws.joints)
        ]
        for row in joints:
            if isinstance(row, SpringRow):
                row.warm_start(motion)
        self._weigh(motion)
        for rows in touching:
            rows.normal.warm_start(motion)
            rows.across.warm_start(motion)
        for row in joints:
            if row is not None and not isinstance(row, SpringRow):
                row.warm_start(motion)
        for _ in range(self.laws.iterations):
            for rows in touching:
                rows.correct(motion, shifts)
            for row in joints:
                if row is not None:
                    row.correct(motion)
        shape = places.shape
        return PlanarState(
            places=places,
            velocities=motion.values.reshape(shape),
            shifts=shifts.values.reshape(shape),
            joints=tuple(np.zeros(1) if row is None else row.impulse for row in joints),
            contacts={
                _cache_key(contact): (rows.normal.impulse, rows.across.impulse)
                for contact, rows in zip(contacts, touching, strict=True)
            },
            acted=tuple(self._acted(touching, joints)),
        )

    def _acted(
        self, touching: Sequence[ContactRows], joints: Sequence[Row | None]
    ) -> Iterator[tuple[str, int]]:
        yield "contacts", sum(bool(rows.normal.impulse.any()) for rows in touching)
        pairs = list(zip(self.laws.joints, joints, strict=True))
        acting = [joint for joint, row in pairs if row is not None and row.impulse.any()]
        for name, kinds in (("limits", LIMITS), ("motors", ("motor",)), ("springs", SPRINGS)):
            yield name, sum(joint.kind in kinds for joint in acting)
        others = {*LIMITS, "motor", *SPRINGS}
        yield "joints", sum(joint.kind not in others for joint in acting)

    def _weigh(self, motion: PlanarMotion) -> None:
        """Let damping and gravity act."""
        h, kept = self.laws.step, self.laws.damping**self.laws.step
        fall = np.tile([*self.laws.gravity, 0.0], len(self.laws.bodies)) * h
        weighed = np.repeat([body.weighed for body in self.laws.bodies], 3)
        motion.values = np.where(weighed, kept * motion.values + fall, motion.values)
        motion.push(motion.rounding(np.abs(fall)))

    def _share(self, remains: float) -> float:
        """Return the rate at which an error is removed, 1/s, from what is left after a second."""
        return float(1 - remains**self.laws.step) / self.laws.step

    def _between(self, bodies: tuple[int, int], arms: Array, axis: Array) -> Array:
        """Return the velocity along an axis of a point on the second body relative to the first."""
        row = np.zeros((len(self.laws.bodies), 3))
        for body, arm, sign in zip(bodies, arms, (-1, 1), strict=True):
            row[body] += sign * np.array([*axis, _cross(arm, axis)])
        return row.ravel()

    def _contact(self, contact: PlanarContact, state: PlanarState, places: Array) -> ContactRows:
        laws, shapes = self.laws, [self.laws.shapes[i] for i in contact.shapes]
        bodies = shapes[0].body, shapes[1].body
        normal, tangent = contact.normal, np.array([-contact.normal[1], contact.normal[0]])
        along, across = (self._between(bodies, contact.arms, axis) for axis in (normal, tangent))
        apart = places[bodies[1], :2] - places[bodies[0], :2]
        distance = float((contact.arms[1] - contact.arms[0] + apart) @ normal)
        place = float(np.abs(places[list(bodies), :2]).sum())
        elasticity = shapes[0].elasticity * shapes[1].elasticity
        approach = float(along @ state.velocities.ravel())
        surface = np.array(shapes[1].velocity) - np.array(shapes[0].velocity)
        rate = self._share(laws.error_bias)
        start = state.contacts.get(_cache_key(contact), (np.zeros(1), np.zeros(1)))
        size = float(np.abs(along) @ np.abs(state.velocities.ravel()))

        def row(axis: Array, target: float, low: float, impulse: Array, size: float) -> Row:
            tall = axis[None]
            return Row(along=tall, pattern=tall, inverse=self._masses, target=np.array([target]),
                       low=low, place=place, size=size, impulse=impulse)  # fmt: skip

        return ContactRows(
            normal=row(along, -elasticity * approach, 0.0, start[0], elasticity * size),
            across=row(across, -float(surface @ tangent), -np.inf, start[1], 0.0),
            overlap=row(
                along, -rate * min(0.0, distance + laws.slop), 0.0, np.zeros(1),
                rate * (place + laws.slop),
            ),
            friction=shapes[0].friction * shapes[1].friction,
        )  # fmt: skip

    def _joint(self, joint: PlanarJoint, places: Array, before: Array | None) -> Row | None:
        """Return the row of a joint with its impulse of the step before; None if it is slack."""
        if joint.kind in ("pivot", "groove"):
            row: Row | None = self._point_row(joint, places)
        elif joint.kind in ("pin", "slide", "spring"):
            row = self._distance_row(joint, places)
        else:
            row = self._angle_row(joint, places)
        if row is not None and not isinstance(row, SpringRow):
            row.impulse = np.zeros(len(row.target)) if before is None else before
            if len(row.impulse) != len(row.target):
                row.impulse = np.zeros(len(row.target))
        return row

    def _arms(self, joint: PlanarJoint, places: Array) -> Array:
        """Return the anchors from the centers of mass, along the world's axes, (2, 2)."""
        anchors = np.array([joint.anchors[0], joint.anchors[-1]])
        bodies = list(joint.bodies)
        return _rotated(places[bodies, 2], anchors - self._centers[bodies])

    def _bias(self, joint: PlanarJoint, error: float) -> float:
        """Return the velocity that corrects an error."""
        rate = -self._share(joint.error_bias) * error
        return float(np.clip(rate, -joint.max_bias, joint.max_bias))

    def _row(
        self, joint: PlanarJoint, along: Array, pattern: Array, target: float, size: float,
        place: float = 0.0, low: float = -1.0, high: float = 1.0,
    ) -> Row:  # fmt: skip
        """Return the row of a joint, with bounds as shares of its largest force."""
        largest = joint.max_force * self.laws.step
        return Row(
            along=along[None], pattern=pattern[None], inverse=self._masses,
            target=np.array([target]), place=place,
            size=self._share(joint.error_bias) * size, low=low * largest if low else 0.0,
            high=high * largest if high else 0.0,
        )  # fmt: skip

    def _distance_row(self, joint: PlanarJoint, places: Array) -> Row | None:
        arms, bodies, numbers = self._arms(joint, places), list(joint.bodies), joint.numbers
        apart = places[bodies[1], :2] + arms[1] - places[bodies[0], :2] - arms[0]
        distance, place = float(np.hypot(*apart)), float(np.abs(places[bodies, :2]).sum())
        axis = apart / distance if distance else apart
        sign, error = 1.0, 0.0
        if joint.kind == "pin":
            error = distance - numbers["distance"]
        elif joint.kind == "slide":
            if numbers["min"] <= distance <= numbers["max"]:
                return None
            sign = 1.0 if distance > numbers["max"] else -1.0
            error = max(distance - numbers["max"], numbers["min"] - distance)
        along = self._between(joint.bodies, arms, sign * axis)
        size = place + distance
        if joint.kind == "spring":
            force = (numbers["rest"] - distance) * numbers["stiffness"]
            return self._spring(joint, along, force, numbers["stiffness"] * size, place)
        return self._row(joint, along, along, self._bias(joint, error), size, place,
                         high=0.0 if joint.kind == "slide" else 1.0)  # fmt: skip

    def _spring(
        self, joint: PlanarJoint, along: Array, force: float, size: float, place: float = 0.0
    ) -> SpringRow:
        h, largest = self.laws.step, joint.max_force
        inverse = float(along * self._masses @ along)
        lost = 1 - np.exp(-joint.numbers["damping"] * h * inverse)
        return SpringRow(
            along=along[None], pattern=along[None], inverse=self._masses, target=np.zeros(1),
            place=place, size=h * size * inverse, low=-largest * h, high=largest * h,
            share=float(lost), impulse=np.array([np.clip(force, -largest, largest) * h]),
        )  # fmt: skip

    def spring_mobility(self, joint: PlanarJoint, state: PlanarState) -> float:
        """Return the acceleration of a spring's length or angle per unit of its force."""
        row = self._joint(joint, state.places, None)
        return 0.0 if row is None else float(row.along[0] @ row.response[0])

    def _angle_row(self, joint: PlanarJoint, places: Array) -> Row | None:
        first, other = joint.bodies
        numbers, turned = joint.numbers, float(places[other, 2] - places[first, 2])
        size = float(np.abs(places[[first, other], 2]).sum())
        along = np.zeros((len(places), 3))
        along[first, 2] -= 1
        along[other, 2] += 1
        row, pattern, error, low, high = along.ravel(), along, 0.0, -1.0, 1.0
        match joint.kind:
            case "rotary spring":
                force = (-turned - numbers["rest"]) * numbers["stiffness"]
                return self._spring(joint, row, force, numbers["stiffness"] * size)
            case "motor":
                return self._row(joint, row, row, -numbers["rate"], 0.0)
            case "gear":
                row = (along * np.where(along > 0, numbers["ratio"], 1.0)).ravel()
                pattern = along * np.where(along < 0, 1 / numbers["ratio"], 1.0)
                error = places[other, 2] * numbers["ratio"] - places[first, 2] - numbers["phase"]
            case "rotary limit":
                error = turned - float(np.clip(turned, numbers["min"], numbers["max"]))
                low, high = (-1.0, 0.0) if error > 0 else (0.0, 1.0)
        if joint.kind != "gear" and not self._bias(joint, error):
            return None
        return self._row(joint, row, pattern.ravel(), self._bias(joint, float(error)), size,
                         low=low, high=high)  # fmt: skip

    def _point_row(self, joint: PlanarJoint, places: Array) -> Row:
        bodies, arms = list(joint.bodies), self._arms(joint, places)
        across, end = None, 0.0
        if joint.kind == "groove":
            across, end, arms[0] = self._groove(joint, places, arms[1])
        along = np.array([self._between(joint.bodies, arms, axis) for axis in np.eye(2)])
        apart = places[bodies[1], :2] + arms[1] - places[bodies[0], :2] - arms[0]
        place = float(np.abs(places[bodies, :2]).sum() + np.abs(arms).sum())
        rate = self._share(joint.error_bias)
        return PointRow(
            along=along, pattern=along, inverse=self._masses,
            target=_shortened(-rate * apart, joint.max_bias), place=place, size=rate * place,
            high=joint.max_force * self.laws.step, across=across, end=end,
        )  # fmt: skip

    def _groove(self, joint: PlanarJoint, places: Array, arm: Array) -> tuple[Array, float, Array]:
        """Return the normal of a groove, the end that is met, and the arm of the nearest point."""
        first, other = joint.bodies
        start, stop, _ = (np.array(point) for point in joint.anchors)
        angles, center = np.full(2, places[first, 2]), self._centers[first]
        ends = _rotated(angles, np.array([start, stop]) - center)
        direction = (stop - start) / np.hypot(*(stop - start))
        normal = _rotated(angles[:1], np.array([[-direction[1], direction[0]]]))[0]
        point = places[other, :2] + arm - places[first, :2]
        here, near, far = (_cross(one, normal) for one in (point, *ends))
        if here <= near:
            return normal, 1.0, ends[0]
        if here >= far:
            return normal, -1.0, ends[1]
        along = np.array([normal[1], -normal[0]])
        return normal, 0.0, here * along + (ends[0] @ normal) * normal


def _cache_key(contact: PlanarContact) -> CacheKey:
    """Return the key of a contact; a detector may exchange its shapes from step to step."""
    first, other = sorted(contact.shapes)
    return (first, other), contact.key


def _cross(first: Array, other: Array) -> float:
    return float(first[0] * other[1] - first[1] * other[0])


def _rotated(angles: Array, points: Array) -> Array:
    c, s = np.cos(angles), np.sin(angles)
    x, y = points.T
    return np.stack([c * x - s * y, s * x + c * y], axis=1)


def _shortened(vector: Array, largest: float) -> Array:
    """Return a vector of at most a length."""
    length = float(np.hypot(*vector))
    return vector * (largest / length) if length > largest else vector


def beyond(laws: PlanarLaws, places: Array, share: float, *, upper: bool) -> tuple[Array, Array]:
    """Return places with each limit exceeded by a share of its range, and outward velocities.

    Args:
        laws: the limits.
        places: origins and angles of the bodies, (N, 3).
        share: of the range.
        upper: whether the upper limits are exceeded, or the lower ones.
    """
    result, outward = places.copy(), np.zeros_like(places)
    for joint in laws.joints:
        if joint.kind not in LIMITS:
            continue
        moves = laws.bodies[joint.bodies[1]].weighed
        first, other = joint.bodies if moves else joint.bodies[::-1]
        low, high = joint.numbers["min"], joint.numbers["max"]
        width = min(high - low, 1.0)
        wanted, sign = (high + share * width, 1) if upper else (low - share * width, -1)
        if joint.kind == "rotary limit":
            result[other, 2] = result[first, 2] + (wanted if moves else -wanted)
            outward[other, 2] = sign if moves else -sign
            continue
        anchors = [np.array(one) for one in (joint.anchors if moves else joint.anchors[::-1])]
        points = [
            result[body, :2] + _rotated(result[[body], 2], anchor[None])[0]
            for body, anchor in zip((first, other), anchors, strict=True)
        ]
        apart = points[1] - points[0]
        length = float(np.hypot(*apart))
        if length and wanted > 0:
            result[other, :2] += (wanted / length - 1) * apart
            outward[other, :2] = sign * apart / length
    return result, outward
