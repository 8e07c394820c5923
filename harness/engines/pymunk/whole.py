"""A Space with its joints and contacts, for two steps from given states.

A Space keeps impulses from step to step, so that each state gets a newly built one. The order of
the contacts is that in which pymunk corrects them: it calls `post_solve` in this order.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from physics_crosscheck.reference.mechanism.planar import (
    Pair,
    PlanarBody,
    PlanarContact,
    PlanarJoint,
    PlanarKind,
    PlanarLaws,
    PlanarShape,
)
from ..protocol import Array, EngineError, PlanarEngineStep, PlanarWhole
from .own_step import has_own_step

_JOINTS: Mapping[str, tuple[PlanarKind, Mapping[str, str]]] = MappingProxyType({
    "PinJoint": ("pin", {"distance": "distance"}),
    "SlideJoint": ("slide", {"min": "min", "max": "max"}),
    "PivotJoint": ("pivot", {}),
    "GrooveJoint": ("groove", {}),
    "DampedSpring": (
        "spring", {"rest": "rest_length", "stiffness": "stiffness", "damping": "damping"}
    ),
    "DampedRotarySpring": (
        "rotary spring", {"rest": "rest_angle", "stiffness": "stiffness", "damping": "damping"}
    ),
    "RotaryLimitJoint": ("rotary limit", {"min": "min", "max": "max"}),
    "GearJoint": ("gear", {"phase": "phase", "ratio": "ratio"}),
    "SimpleMotor": ("motor", {"rate": "rate"}),
})  # fmt: skip
"""Kind of each class, and its numbers by pymunk's attributes."""

_ANCHORS = "anchor_a", "groove_a", "groove_b", "anchor_b"

_ACTING = "SlideJoint", "RotaryLimitJoint", "SimpleMotor"
"""Joints that a declaration of smooth motions does not cover."""

_EDITS = ("sleep_time_threshold=inf",)

STEPS = 2
"""Steps per state: the second one shows the impulses and corrections that the first one leaves."""


class BuiltSpace(Protocol):
    """A loaded file: its Space, and how to build it again."""

    step: float

    def rebuild(self) -> tuple[Any, Mapping[str, Any]]:
        """Build and return the Space and its named bodies."""


class PymunkWhole(PlanarWhole):
    """A Space as its file builds it.

    Args:
        model: the loaded file.
    """

    edits = _EDITS

    def __init__(self, model: BuiltSpace) -> None:
        self._model = model
        self._space, named = model.rebuild()
        names = {id(body): name for name, body in named.items()}
        self._bodies = [self._space.static_body, *self._space.bodies]
        places = {id(body): i for i, body in enumerate(self._bodies)}
        self.uncovered = tuple(dict.fromkeys(_uncovered(self._space)))
        self.laws = PlanarLaws(
            bodies=tuple(
                _body(body, names.get(id(body), f"body {i}"), self._space)
                for i, body in enumerate(self._bodies)
            ),
            shapes=tuple(_shape(shape, places) for shape in self._space.shapes),
            joints=tuple(
                _joint(joint, places)
                for joint in self._space.constraints
                if type(joint).__name__ in _JOINTS
            ),
            step=model.step,
            gravity=_pair(self._space.gravity),
            damping=float(self._space.damping),
            iterations=int(self._space.iterations),
            slop=float(self._space.collision_slop),
            error_bias=float(self._space.collision_bias),
        )
        self.numbers = {"Space.collision_slop": self.laws.slop}
        self.home = self._places()
        self.speeds = self._velocities()

    @property
    def acts(self) -> bool:
        """True if shapes can touch, or joints have limits or motors."""
        kinds = [type(joint).__name__ for joint in self._space.constraints]
        return any(kind in _ACTING for kind in kinds) or any(True for _ in self.pairs)

    @property
    def pairs(self) -> Iterator[tuple[int, int]]:
        """Pairs of shapes that can touch, by index."""
        shapes = [(i, one) for i, one in enumerate(self._space.shapes) if not one.sensor]
        for (i, first), (j, other) in combinations(shapes, 2):
            if _can_touch(first, other):
                yield i, j

    def moved(self, places: Array, velocities: Array, steps: int) -> tuple[Array, Array]:
        """Return places and velocities after some steps."""
        self._rebuild(places, velocities)
        for _ in range(steps):
            self._space.step(self._model.step)
        return self._places(), self._velocities()

    def evaluate(self, places: Array, velocities: Array) -> tuple[PlanarEngineStep, ...]:
        """Return two steps from a state without impulses."""
        self._rebuild(places, velocities)
        shapes = {id(shape): i for i, shape in enumerate(self._space.shapes)}
        contacts: list[PlanarContact] = []
        failed: list[Exception] = []

        def collect(arbiter: Any, _space: Any, _data: Any) -> None:
            try:
                contacts.extend(_contacts(arbiter, shapes))
            except Exception as error:  # pymunk discards it
                failed.append(error)

        self._space.on_collision(post_solve=collect)
        steps = []
        for _ in range(STEPS):
            contacts.clear()
            self._space.step(self._model.step)
            if failed:
                raise EngineError(f"a contact cannot be read: {failed[0]}")
            steps.append(PlanarEngineStep(contacts=tuple(contacts), places=self._places(),
                                          velocities=self._velocities()))  # fmt: skip
        return tuple(steps)

    def _rebuild(self, places: Array, velocities: Array) -> None:
        from pymunk import Body

        self._space, _ = self._model.rebuild()
        self._space.sleep_time_threshold = float("inf")
        self._bodies = [self._space.static_body, *self._space.bodies]
        rows = zip(self._bodies, places.tolist(), velocities.tolist(), strict=True)
        for body, (x, y, angle), (vx, vy, spin) in rows:
            if body.body_type != Body.STATIC:
                body.angle = angle  # first: it turns about the center of mass
                body.position = x, y
                body.velocity, body.angular_velocity = (vx, vy), spin

    def _places(self) -> Array:
        return np.array([(*body.position, body.angle) for body in self._bodies])

    def _velocities(self) -> Array:
        return np.array([(*body.velocity, body.angular_velocity) for body in self._bodies])


def _pair(vector: Any) -> Pair:
    return float(vector[0]), float(vector[1])


def _body(body: Any, name: str, space: Any) -> PlanarBody:
    from pymunk import Body

    moves = body.body_type == Body.DYNAMIC
    infinite = float("inf")
    return PlanarBody(
        name="ground" if body is space.static_body else name,
        mass=float(body.mass) if moves else infinite,
        moment=float(body.moment) if moves else infinite,
        center=_pair(body.center_of_gravity),
        weighed=moves,
    )


def _shape(shape: Any, places: Mapping[int, int]) -> PlanarShape:
    return PlanarShape(
        body=places[id(shape.body)],
        friction=float(shape.friction),
        elasticity=float(shape.elasticity),
        velocity=_pair(shape.surface_velocity),
    )


def _joint(joint: Any, places: Mapping[int, int]) -> PlanarJoint:
    kind, names = _JOINTS[type(joint).__name__]
    anchors = tuple(_pair(getattr(joint, name)) for name in _ANCHORS if hasattr(joint, name))
    return PlanarJoint(
        kind=kind,
        bodies=(places[id(joint.a)], places[id(joint.b)]),
        anchors=anchors,
        numbers={key: float(getattr(joint, name)) for key, name in names.items()},
        max_force=float(joint.max_force),
        error_bias=float(joint.error_bias),
        max_bias=float(joint.max_bias),
    )


def _uncovered(space: Any) -> Iterator[str]:
    """Yield what acts on the bodies and has no law here."""
    if has_own_step(space):
        yield "its own step, callbacks or threads"
    for joint in space.constraints:
        if (name := type(joint).__name__) not in _JOINTS:
            yield f"joints of class {name}"
    if space.sleep_time_threshold < float("inf"):
        yield "sleeping bodies"


def _can_touch(first: Any, other: Any) -> bool:
    from pymunk import Body

    mine, theirs = first.filter, other.filter
    still = {first.body.body_type, other.body.body_type} == {Body.STATIC}
    grouped = mine.group != 0 and mine.group == theirs.group
    masked = not (mine.categories & theirs.mask and theirs.categories & mine.mask)
    return not (still or grouped or masked or first.body is other.body)


def _contacts(arbiter: Any, shapes: Mapping[int, int]) -> Iterator[PlanarContact]:
    """Yield the points of a pair of shapes, in the order in which they are corrected."""
    raw, pair = arbiter._arbiter, arbiter.shapes
    first, other = pair[::-1] if raw.swapped else pair
    for i in range(raw.count):
        point = raw.contacts[i]
        arms = [[point.r1.x, point.r1.y], [point.r2.x, point.r2.y]]
        yield PlanarContact(
            shapes=(shapes[id(first)], shapes[id(other)]),
            normal=np.array([raw.n.x, raw.n.y]),
            arms=np.array(arms),
            key=int(point.hash),
        )
