"""A tree of bodies as a model file describes it, one record per body, with the file's numbers.

Welded bodies are separate records, and one body may have several joints in series.
`reference.mechanism.assemble` builds a `Tree` from them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import get_args

import numpy as np

from .rotations import Array, Place, SpatialInertia, from_quaternion, from_rpy
from .tree import CablePath, Fluid, FrameForce, JointForce, Kind, TreeError

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Powers = float | tuple[float, ...]
"""A coefficient, or the coefficients of the first, second, ... power."""

ZERO: Triple = (0.0, 0.0, 0.0)
MIN_BOX_MOMENT = 1e-15
"""The smallest mass, kg, and second moment, kg m^2, of a box in a fluid."""
KINDS = get_args(Kind)


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint between a body and its parent, or after the previous joint of the same body.

    Attributes:
        name: also the name of its coordinate.
        kind: "hinge", "slide", "ball" or "free". A free joint's position is the position of the
            body's frame relative to its pose without the joint.
        axis: direction in the body's frame, any length; ignored for ball and free joints.
        at: a point on the axis, in the body's frame, m.
        zero: joint position at the body's declared pose, rad or m.
        damping: force opposing the velocity, N s/m or N m s/rad; several values are the
            coefficients of w, w |w|, w |w|^2, ...
        stiffness: N/m or N m/rad; several values are the coefficients of powers of the deflection.
        rest: position at which the spring force is zero, rad or m.
        pitch: distance along the axis per angle, m/rad, of a hinge that is a screw.
        rest_place, rest_turn: rest position of a free joint, m and (w, x, y, z). A ball joint uses
            `rest_turn` only. None means no rotation.
        armature: added to the diagonal of the mass matrix, kg or kg m^2.
        limits: lowest and highest position, between which states are sampled; None if unlimited.

    Raises:
        TreeError: with the joint and the problem.
    """

    name: str
    kind: Kind
    axis: Triple = (1.0, 0.0, 0.0)
    at: Triple = ZERO
    zero: float = 0.0
    damping: Powers = 0.0
    stiffness: Powers = 0.0
    rest: float = 0.0
    armature: float = 0.0
    limits: tuple[float, float] | None = None
    rest_place: Triple = ZERO
    rest_turn: Quaternion | None = None
    pitch: float = 0.0

    def __post_init__(self) -> None:
        what = f"joint {self.name!r}"
        if self.kind not in KINDS:
            raise TreeError(f"{what} is of kind {self.kind!r}; known kinds: {', '.join(KINDS)}")
        _check(what, "axis", self.axis, 3)
        _check(what, "at", self.at, 3)
        for key in ("damping", "stiffness"):
            _check(what, key, powers(getattr(self, key)))
        _check(what, "zero, rest and armature", (self.zero, self.rest, self.armature), 3)
        if self.single and not any(self.axis):
            raise TreeError(f"the axis of {what} has no length")
        if self.limits is not None and not (
            len(self.limits) == 2 and self.limits[0] <= self.limits[1]
        ):
            raise TreeError(f"limits of {what} must be a lowest and a highest position")
        _check(what, "rest_place", self.rest_place, 3)
        _check(what, "rest_turn", self.rest_turn or (1.0, 0.0, 0.0, 0.0), 4)
        if self.rest_turn is not None and not any(self.rest_turn):
            raise TreeError(f"rest_turn of {what} has no length")

    @property
    def single(self) -> bool:
        """True if the joint has one position coordinate."""
        return self.kind in ("hinge", "slide")

    @property
    def nonlinear(self) -> bool:
        """True if its spring or damper is nonlinear."""
        return len(powers(self.damping)) > 1 or len(powers(self.stiffness)) > 1

    @cached_property
    def direction(self) -> Array:
        """The axis as a unit vector, (3,)."""
        axis = np.array(self.axis, dtype=float)
        axis = axis / np.abs(axis).max()  # its square neither overflows nor underflows
        result: Array = axis / np.linalg.norm(axis)
        return result


@dataclass(frozen=True, kw_only=True)
class RigidBody:
    """A body and the joints between it and its parent.

    Attributes:
        name: name of the body.
        parent: name of the parent body; None for the world.
        position: position of its frame in the parent's, with all joints at `zero`, m.
        rpy: rotation of its frame there, about the parent's x, then y, then z axis, rad.
        quaternion: the same rotation as (w, x, y, z); None if `rpy` gives it.
        joints: joints in series; empty for a welded body.
        mass: kg.
        center: center of mass in the body's frame, m.
        inertia: (ixx, iyy, izz, ixy, ixz, iyz) about the center of mass, kg m^2.
        inertia_rpy, inertia_quaternion: rotation of the axes of `inertia` in the body's frame.
        lift: fraction of its weight that is compensated.
        dragged: whether a fluid acts on it, as on the box of equal mass and moments of inertia.

    Raises:
        TreeError: with the body and the problem.
    """

    name: str
    parent: str | None
    position: Triple = ZERO
    rpy: Triple = ZERO
    quaternion: Quaternion | None = None
    joints: tuple[Joint, ...] = ()
    mass: float = 0.0
    center: Triple = ZERO
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6
    inertia_rpy: Triple = ZERO
    inertia_quaternion: Quaternion | None = None
    lift: float = 0.0
    dragged: bool = True

    def __post_init__(self) -> None:
        what = f"body {self.name!r}"
        for key, count in (("position", 3), ("center", 3), ("inertia", 6)):
            _check(what, key, getattr(self, key), count)
        _check(what, "mass and lift", (self.mass, self.lift), 2)
        for key in ("", "inertia_"):
            rpy, other = getattr(self, f"{key}rpy"), getattr(self, f"{key}quaternion")
            _check(what, f"{key}rpy", rpy, 3)
            if other is None:
                continue
            _check(what, f"{key}quaternion", other, 4)
            if any(rpy) or not any(other):
                raise TreeError(
                    f"{what} has {key}rpy and {key}quaternion: keep one of them"
                    if any(rpy)
                    else f"{key}quaternion of {what} has no length"
                )

    @cached_property
    def place(self) -> Place:
        """Pose of its frame in its parent's."""
        return _place(self.position, self.rpy, self.quaternion)

    @cached_property
    def spatial_inertia(self) -> SpatialInertia:
        """Its spatial inertia in its own frame."""
        central = SpatialInertia(float(self.mass), np.zeros(3), self._tensor)
        return central.in_frame(_place(self.center, self.inertia_rpy, self.inertia_quaternion))

    @property
    def box(self) -> tuple[Place, Array] | None:
        """The box of equal mass and moments of inertia: its pose in the body, and edges, m, (3,).

        Its axes are those of `inertia`, or the principal axes if there are products of inertia. A
        zero second moment, as of a plate, is replaced by `MIN_BOX_MOMENT`. None without mass.
        """
        if self.mass < MIN_BOX_MOMENT:
            return None
        place = _place(self.center, self.inertia_rpy, self.inertia_quaternion)
        moments = np.array(self.inertia[:3], dtype=float)
        if any(self.inertia[3:]):
            moments, axes = np.linalg.eigh(self._tensor)
            place = Place(place.rotation @ axes, place.origin)
        apart = np.array([moments[i - 2] + moments[i - 1] - moments[i] for i in range(3)])
        return place, np.sqrt(np.maximum(MIN_BOX_MOMENT, apart) / self.mass * 6)

    @property
    def _tensor(self) -> Array:
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Site:
    """A frame on a body.

    Attributes:
        body: name of the body; None for the world.
        position: position of its origin in the body's frame, m.
        quaternion: its rotation there, (w, x, y, z); None for no rotation.

    Raises:
        TreeError: with the problem.
    """

    body: str | None
    position: Triple = ZERO
    quaternion: Quaternion | None = None

    def __post_init__(self) -> None:
        what = f"a site on {self.body!r}"
        _check(what, "position", self.position, 3)
        if self.quaternion is not None:
            _check(what, "quaternion", self.quaternion, 4)
            if not any(self.quaternion):
                raise TreeError(f"the quaternion of {what} has no length")

    @property
    def place(self) -> Place:
        """Pose in the body's frame."""
        return _place(self.position, ZERO, self.quaternion)


@dataclass(frozen=True, kw_only=True)
class ForceElement:
    """A force F along a length s: a combination of hinge and slide positions, or another path.

    F = b0 + b1 s + b2 w + (g0 + g1 s + g2 w) u - sum of k_i x^i - sum of d_i w |w|^(i - 1), where w
    = ds/dt and x is the distance of s outside `rest`. Each joint receives F times its coefficient.

    Attributes:
        name: name of the tendon or actuator.
        joints: joint names, each with its coefficient.
        along: another path instead of `joints`; it has no armature.
        bias: (b0, b1, b2).
        gain: (g0, g1, g2).
        control: constant control input u.
        input: index of the input that u comes from, in a file of several; -1 without one.
        range: of that input, or None.
        stiffness: k_1, k_2, ...; N/m^i or N m/rad^i.
        damping: d_1, d_2, ...
        rest: range of lengths with zero spring force.
        armature: inertia that moves with s, kg or kg m^2.

    Raises:
        TreeError: with the problem.
    """

    name: str
    joints: tuple[tuple[str, float], ...] = ()
    along: CablePath[Site] | FrameForce[Site] | JointForce[str] | None = None
    bias: Triple = ZERO
    gain: Triple = ZERO
    control: float = 0.0
    input: int = -1
    range: tuple[float, float] | None = None
    stiffness: Powers = 0.0
    damping: Powers = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    armature: float = 0.0

    def __post_init__(self) -> None:
        what = f"pull {self.name!r}"
        for key in ("bias", "gain"):
            _check(what, key, getattr(self, key), 3)
        for key in ("stiffness", "damping"):
            _check(what, key, powers(getattr(self, key)))
        _check(what, "control and armature", (self.control, self.armature), 2)
        _check(what, "rest", self.rest, 2)
        _check(what, "joints", [share for _, share in self.joints])
        if isinstance(self.along, CablePath):
            _check(what, "branches", [share for share, _ in self.along.branches])
        elif self.along is not None:
            _check(what, "gear", self.along.gear, 6 if len(self.along.gear) != 3 else 3)


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """A hinge or slide that follows another joint: position = multiplier * leader + offset.

    It may follow several joints; their weighted positions are added.

    Attributes:
        follower, leader: names of the joints; without a leader the follower is fixed at the offset.
        multiplier: in units of follower per leader.
        offset: rad or m.
        others: further joints that it follows, each with its multiplier.

    Raises:
        TreeError: with the problem.
    """

    follower: str
    leader: str | None
    multiplier: float = 1.0
    offset: float = 0.0
    others: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        what = f"the coupling of {self.follower!r}"
        _check(what, "multiplier and offset", (self.multiplier, self.offset), 2)
        _check(what, "others", [share for _, share in self.others])


@dataclass(frozen=True, kw_only=True)
class BodyModel:
    """The input of a tree: bodies, joints and forces with the numbers of the file.

    Attributes:
        bodies: parents first.
        gravity: m/s^2.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        fluid: around the bodies, or None.
    """

    bodies: tuple[RigidBody, ...]
    gravity: Triple
    pulls: tuple[ForceElement, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    fluid: Fluid | None = None

    def without(self, joints: Collection[str]) -> BodyModel:
        """Return the input with these joints fixed, without what acts on them."""
        names = set(joints)
        return replace(
            self,
            bodies=tuple(
                replace(body, joints=tuple(one for one in body.joints if one.name not in names))
                for body in self.bodies
            ),
            pulls=tuple(p for p in self.pulls if names.isdisjoint(name for name, _ in p.joints)),
            couplings=tuple(
                one
                for one in self.couplings
                if names.isdisjoint((one.follower, one.leader, *dict(one.others)))
            ),
        )


def powers(value: Powers) -> tuple[float, ...]:
    """Return the coefficients of the first, second, ... power, without trailing zeros."""
    coefficients = value if isinstance(value, tuple) else (value,)
    while coefficients and not coefficients[-1]:
        coefficients = coefficients[:-1]
    return coefficients


def _place(position: Triple, rpy: Triple, quaternion: Quaternion | None) -> Place:
    if quaternion is None:
        return Place(from_rpy(*rpy), np.array(position, dtype=float))
    return Place(
        from_quaternion(np.array(quaternion, dtype=float)), np.array(position, dtype=float)
    )


def _check(what: str, key: str, values: Sequence[float], count: int | None = None) -> None:
    """Check that a field holds `count` finite numbers.

    Raises:
        TreeError: with the field and its value.
    """
    try:
        fine = all(map(math.isfinite, values))
    except TypeError:
        fine = False
    if not fine or (count is not None and len(values) != count):
        wanted = "finite numbers" if count is None else f"{count} finite numbers"
        raise TreeError(f"{key} of {what} is {values!r}; expected {wanted}")
