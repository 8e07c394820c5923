"""Numbers of bodies in a plane whose joints, springs and contacts act by impulses.

`reference.laws.planar` states how they act. Bodies and shapes are indices; vectors are (x, y), m.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Pair = tuple[float, float]

PlanarKind = Literal[
    "pin", "slide", "pivot", "groove", "spring", "rotary spring", "rotary limit", "gear", "motor",
]  # fmt: skip
"""Kind of a joint between two bodies."""


@dataclass(frozen=True, kw_only=True)
class PlanarBody:
    """A body.

    Attributes:
        name: unique.
        mass, moment: kg, kg m^2 about the center of mass; infinite for a body that no force moves.
        center: of mass, in the body's frame.
        weighed: whether gravity and damping act on it.
    """

    name: str
    mass: float
    moment: float
    center: Pair = (0.0, 0.0)
    weighed: bool = True


@dataclass(frozen=True, kw_only=True)
class PlanarShape:
    """A surface on a body.

    Attributes:
        body: its index.
        friction, elasticity: factors of those of a contact.
        velocity: of the surface relative to its body, m/s.
    """

    body: int
    friction: float
    elasticity: float
    velocity: Pair = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class PlanarJoint:
    """A joint, a motor, or a spring between two bodies.

    Attributes:
        kind: of the joint.
        bodies: indices of the first and of the second one.
        anchors: points in the frames of the bodies; a groove has two on the first one.
        numbers: by name: distance, min, max, phase, ratio, rate, stiffness, damping, rest.
        max_force: N or N m.
        error_bias: share of an error that is left after a second.
        max_bias: largest velocity that corrects an error, m/s or rad/s.
    """

    kind: PlanarKind
    bodies: tuple[int, int]
    anchors: tuple[Pair, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    max_force: float
    error_bias: float
    max_bias: float


@dataclass(frozen=True, kw_only=True)
class PlanarLaws:
    """All numbers of a file.

    Attributes:
        bodies, shapes, joints: in the order of the engine.
        step: s.
        gravity: m/s^2.
        damping: share of a velocity that is left after a second.
        iterations: of the impulses.
        slop: overlap that is not corrected, m.
        error_bias: share of an overlap that is left after a second.
    """

    bodies: tuple[PlanarBody, ...]
    shapes: tuple[PlanarShape, ...] = ()
    joints: tuple[PlanarJoint, ...] = ()
    step: float
    gravity: Pair = (0.0, 0.0)
    damping: float = 1.0
    iterations: int
    slop: float
    error_bias: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarContact:
    """A point where two shapes touch, as a collision detector reports it.

    Attributes:
        shapes: indices.
        normal: from the first shape to the other one, (2,).
        arms: of the two points from the centers of mass of their bodies, m, (2, 2).
        key: the same for the same contact in two steps.
    """

    shapes: tuple[int, int]
    normal: NDArray[np.float64]
    arms: NDArray[np.float64]
    key: int = 0
