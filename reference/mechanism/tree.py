"""A tree of rigid bodies, each on one joint to the body before it.

A body that several joints carry, one after the other, is a chain of links of which the last alone
has mass; what is welded together is one body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

import numpy as np

from physics_crosscheck.reference.mechanism.force_paths import JointForce, Way
from physics_crosscheck.reference.mechanism.numeric import Array

Kind = Literal["hinge", "slide", "ball", "free"]
"""Of a joint: it turns about an axis, slides along one, turns any way, or moves any way."""

WORLD = -1
"""Parent of what hangs from nothing that moves."""

POSITIONS: Mapping[Kind, int] = MappingProxyType({"hinge": 1, "slide": 1, "ball": 4, "free": 7})
"""Numbers of a joint's position: an angle or a distance; a unit quaternion, its real part first;
a point and a quaternion."""

VELOCITIES: Mapping[Kind, int] = MappingProxyType({"hinge": 1, "slide": 1, "ball": 3, "free": 6})
"""Numbers of a joint's velocity: those of a ball are the angular velocity, those of a free joint
the angular velocity and the velocity of the link's origin, all in the link's own frame."""


class TreeError(ValueError):
    """A tree that is none; the message names the link."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """A body and the joint that carries it.

    The joint's frame stands still in the parent's; the link's frame is the joint's, moved by the
    joint's position from where that is zero (the quaternion one).

    Attributes:
        name: of the joint, by which its coordinate is called.
        parent: index of the link that carries it, or `WORLD`.
        position: of the joint's frame in the parent's, m, (3,).
        rotation: of the joint's frame in the parent's: columns are its axes there, (3, 3).
        kind: of the joint.
        axis: unit vector, in both frames; of no meaning for a ball and a free joint, (3,).
        mass: kg.
        center: of mass, in the link's frame, m, (3,).
        inertia: about the center of mass, in the link's frame, kg m^2, (3, 3).
        armature: added to the diagonal of the mass matrix: kg or kg m^2.
        damping: force by velocity, against it: N s/m or N m s/rad.
        stiffness: N/m or N m/rad.
        rest: position at which the spring pulls nothing, as the joint's; none for a free joint.
        lifted: mass on which gravity does not pull, kg.
        lift: where it is, in the link's frame, m, (3,).
    """

    name: str
    parent: int
    position: Array
    rotation: Array
    kind: Kind
    axis: Array
    mass: float
    center: Array
    inertia: Array
    armature: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    rest: tuple[float, ...] = (0.0,)
    lifted: float = 0.0
    lift: Array = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """What the joint's velocity does: angular and linear velocity, in the link's frame.

        Each is (3, numbers of the velocity).
        """
        still = np.zeros((3, 1))
        match self.kind:
            case "hinge":
                return self.axis[:, None], still
            case "slide":
                return still, self.axis[:, None]
            case "ball":
                return np.eye(3), np.zeros((3, 3))
            case "free":
                return np.eye(3, 6), np.eye(3, 6, 3)


@dataclass(frozen=True, kw_only=True)
class Pull:
    """A force F along a length s that is a combination of the positions of hinges and slides.

    F = constant - sum of k_i x^i - sum of d_i w |w|^(i - 1), i from 1, where w = ds/dt and x is by
    how much s is outside `rest`; on each joint acts F times its coefficient. Or s is of another
    way, of which no armature is told.

    Attributes:
        name: of the tendon or actuator.
        joints: coefficients by the index of the joint's link.
        along: the other way; None where there are joints.
        constant: N, or N m where s is an angle.
        stiffness: k_1, k_2, ...; N/m^i or N m/rad^i.
        damping: d_1, d_2, ...
        rest: between which lengths springs pull nothing.
        armature: mass that moves as s does, kg or kg m^2.
    """

    name: str
    joints: tuple[tuple[int, float], ...] = ()
    along: Way | None = None
    constant: float = 0.0
    stiffness: tuple[float, ...] = ()
    damping: tuple[float, ...] = ()
    rest: tuple[float, float] = (0.0, 0.0)
    armature: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Bush:
    """A spring, and a damper of higher powers, of a ball or free joint.

    On its rotation acts the moment -(k_1 + k_2 r + k_3 r^2 ...) x, where x is the rotation vector
    from `turn` and r its size; on a free joint's place, the same force by how far that is from
    `place`. A damper acts on each component of the velocity, that of places along the axes of what
    carries the joint: -(d_2 |w| + d_3 |w|^2 ...) w.

    Attributes:
        link: index of the joint's.
        stiffness: k_1, k_2, ...
        damping: d_2, d_3, ...; the first is the link's.
        place: m.
        turn: a unit quaternion, its real part first.
    """

    link: int
    stiffness: tuple[float, ...] = ()
    damping: tuple[float, ...] = ()
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """A hinge or slide whose position follows another's: multiplier * position + offset.

    Attributes:
        follower: index of its link.
        leader: index of the other's, or None where it stands at the offset.
        multiplier: in units of both.
        offset: rad or m.
        others: further links' indices, each with its multiplier: their positions are added.
    """

    follower: int
    leader: int | None
    multiplier: float = 1.0
    offset: float = 0.0
    others: tuple[tuple[int, float], ...] = ()

    @property
    def leaders(self) -> tuple[tuple[int, float], ...]:
        """All links that it follows, each with its multiplier."""
        first = () if self.leader is None else ((self.leader, self.multiplier),)
        return (*first, *self.others)


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """A fluid in which the bodies move, at rest or in a wind.

    It acts on each body as on the box that has the body's mass and moments (the "inertia model" of
    the format MJCF, in its documentation under "Fluid forces"): along and about each axis of the
    box by a drag that is quadratic in the velocity, and by the viscous resistance of a sphere of
    the box's mean size.

    Attributes:
        density: kg/m^3.
        viscosity: Pa s.
        wind: velocity of the fluid, m/s.
    """

    density: float = 0.0
    viscosity: float = 0.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Immersed:
    """A box on which the medium acts.

    Attributes:
        link: index of the link in which it stands.
        position: of its center, in the link's frame, m, (3,).
        rotation: of its axes there, as columns, (3, 3).
        size: its edges, m, (3,).
    """

    link: int
    position: Array
    rotation: Array
    size: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree:
    """Links, each after the one that carries it.

    Attributes:
        links: in the order of the coordinates.
        gravity: m/s^2, (3,).
        pulls: forces that act on several joints, or are no straight line.
        couplings: joints that follow others, each at most once.
        medium: in which the bodies move; None for none.
        immersed: on what of the bodies it acts.
        bushes: springs of ball and free joints.
    """

    links: tuple[Link, ...]
    gravity: Array
    pulls: tuple[Pull, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    medium: Fluid | None = None
    immersed: tuple[Immersed, ...] = ()
    bushes: tuple[Bush, ...] = ()

    def __post_init__(self) -> None:
        for i, link in enumerate(self.links):
            if not WORLD <= link.parent < i:
                raise TreeError(f"{link.name}: the link that carries it must come before it")
        for pull in self.pulls:
            self._check_pull(pull)
        for one in self.couplings:
            for i in (one.follower, *(leader for leader, _ in one.leaders)):
                if self.links[i].kind not in ("hinge", "slide"):
                    raise TreeError(
                        f"{self.links[i].name} is coupled, but neither a hinge nor a slide"
                    )

    def _check_pull(self, pull: Pull) -> None:
        for i, _ in pull.joints:
            if self.links[i].kind not in ("hinge", "slide"):
                raise TreeError(f"{pull.name}: {self.links[i].name} is neither a hinge nor a slide")
        if pull.along is not None and (pull.joints or pull.armature):
            raise TreeError(
                f"{pull.name}: its path does not run along joints, so it can't have an armature"
            )
        if isinstance(pull.along, JointForce):
            joint, many = self.links[pull.along.joint], len(pull.along.gear)
            if {"ball": 3, "free": 6}.get(joint.kind) != many:
                raise TreeError(f"{pull.name}: {joint.name} does not take a gear of {many} numbers")

    @cached_property
    def positions(self) -> tuple[slice, ...]:
        """Where each link's numbers stand among those of q."""
        return _slices([POSITIONS[link.kind] for link in self.links])

    @cached_property
    def velocities(self) -> tuple[slice, ...]:
        """Where each link's numbers stand among those of v."""
        return _slices([VELOCITIES[link.kind] for link in self.links])

    @property
    def nq(self) -> int:
        """Numbers of q."""
        return self.positions[-1].stop if self.links else 0

    @property
    def nv(self) -> int:
        """Numbers of v: degrees of freedom."""
        return self.velocities[-1].stop if self.links else 0

    @property
    def freedoms(self) -> int:
        """Coordinates that follow no other."""
        return self.nv - len(self.couplings)

    @property
    def zero(self) -> Array:
        """Positions of which each is zero, quaternions one, (nq,)."""
        q = np.zeros(self.nq)
        for link, here in zip(self.links, self.positions, strict=True):
            if link.kind in ("ball", "free"):
                q[here.stop - 4] = 1.0
        return q


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum([0, *sizes])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
