"""A tree of rigid bodies, each with one joint to its parent.

A body with several joints in series becomes a chain of links; only the last link has mass. Welded
bodies are one link.

A force acts along a cable through points on bodies, on a frame of a body, or on a ball or free
joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Generic, Literal, TypeVar

import numpy as np

from .rotations import Array, Place

P = TypeVar("P")
Q = TypeVar("Q")
J = TypeVar("J")
K = TypeVar("K")


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkFrame:
    """A frame fixed to a link.

    Attributes:
        link: index of the link; -1 for the world.
        position: position of its origin in the link's frame or the world's, m, (3,).
        rotation: its axes there, as columns, (3, 3).
    """

    link: int
    position: Array
    rotation: Array


@dataclass(frozen=True, kw_only=True)
class CablePath(Generic[P]):
    """A cable of straight segments between frames: s is the weighted sum of branch lengths.

    Attributes:
        branches: weights, each with the frames that its segments join, at least two.
    """

    branches: tuple[tuple[float, tuple[P, ...]], ...]

    def mapped(self, marks: Callable[[P], Q]) -> CablePath[Q]:
        """Return the same path through other frames."""
        return CablePath(
            branches=tuple((share, tuple(map(marks, row))) for share, row in self.branches)
        )


@dataclass(frozen=True, kw_only=True)
class FrameForce(Generic[P]):
    """A force and a moment on a frame, or between two frames.

    Without `against`, both act along the frame's own axes, and s is zero. With `against`, they act
    on the frame along the axes of `against`, and their reactions act at the origin of `against`.
    Links that carry both frames receive no force. Then s is `gear` times the relative position and
    rotation vector of the frame. In both cases ds/dt denotes the power per unit F.

    Attributes:
        frame: the frame that receives the force.
        gear: force and moment per unit F, (6,).
        against: the frame that receives the reaction; None for none.
    """

    frame: P
    gear: tuple[float, ...]
    against: P | None = None

    def mapped(self, marks: Callable[[P], Q]) -> FrameForce[Q]:
        """Return the same force on other frames."""
        against = None if self.against is None else marks(self.against)
        return FrameForce(frame=marks(self.frame), gear=self.gear, against=against)


@dataclass(frozen=True, kw_only=True)
class JointForce(Generic[J]):
    """A moment about a ball joint, or a force and a moment on a free joint.

    For a ball joint s is `gear` times its rotation vector; for a free joint s is zero. ds/dt
    denotes the power per unit F.

    Attributes:
        joint: the joint that receives the force.
        gear: moment per unit F, (3,), or force along the joint's axes and moment, (6,).
        in_parent: whether moments are about the axes of the joint's parent, not the link's.
    """

    joint: J
    gear: tuple[float, ...]
    in_parent: bool = False

    def mapped(self, joint: Callable[[J], K]) -> JointForce[K]:
        """Return the same force on another joint."""
        return JointForce(joint=joint(self.joint), gear=self.gear, in_parent=self.in_parent)


Way = CablePath[LinkFrame] | FrameForce[LinkFrame] | JointForce[int]
"""A force path between links of a tree, by index."""


Kind = Literal["hinge", "slide", "ball", "free"]
"""Kind of a joint: rotation about an axis, translation along one, any rotation, any motion."""

WORLD = -1
"""Parent index of links attached to the world."""

POSITIONS: Mapping[Kind, int] = MappingProxyType({"hinge": 1, "slide": 1, "ball": 4, "free": 7})
"""Size of a joint's position: an angle or a distance; a unit quaternion, real part first; a point
and a quaternion."""

VELOCITIES: Mapping[Kind, int] = MappingProxyType({"hinge": 1, "slide": 1, "ball": 3, "free": 6})
"""Size of a joint's velocity. A ball joint has the angular velocity; a free joint has the angular
velocity and the velocity of the link's origin. Both are in the link's frame."""


class TreeError(ValueError):
    """An invalid tree; the message names the link."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TreeLink:
    """A body and the joint that carries it.

    The joint's frame is fixed in the parent's. The link's frame is the joint's frame, displaced by
    the joint's position from zero (the identity quaternion).

    Attributes:
        name: name of the joint and of its coordinate.
        parent: index of the parent link, or `WORLD`.
        position: position of the joint's frame in the parent's, m, (3,).
        rotation: axes of the joint's frame in the parent's, as columns, (3, 3).
        kind: kind of the joint.
        axis: unit vector, equal in both frames; ignored for ball and free joints, (3,).
        mass: kg.
        center: center of mass, in the link's frame, m, (3,).
        inertia: about the center of mass, in the link's frame, kg m^2, (3, 3).
        armature: added to the diagonal of the mass matrix, kg or kg m^2.
        damping: force opposing the velocity, N s/m or N m s/rad.
        stiffness: N/m or N m/rad.
        rest: joint position at which the spring force is zero; unused for a free joint.
        pitch: distance along the axis per angle of a hinge that is a screw, m/rad.
        lifted: mass whose weight is compensated, kg.
        lift: position of that mass, in the link's frame, m, (3,).
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
    pitch: float = 0.0
    lifted: float = 0.0
    lift: Array = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """The joint's motion subspace: angular and linear velocity in the link's frame.

        Each is (3, size of the velocity).
        """
        still = np.zeros((3, 1))
        match self.kind:
            case "hinge":
                return self.axis[:, None], self.pitch * self.axis[:, None]
            case "slide":
                return still, self.axis[:, None]
            case "ball":
                return np.eye(3), np.zeros((3, 3))
            case "free":
                return np.eye(3, 6), np.eye(3, 6, 3)


@dataclass(frozen=True, kw_only=True)
class TreeForce:
    """A force F along a length s, a combination of the positions of hinges and slides.

    F = constant - sum of k_i x^i - sum of d_i w |w|^(i - 1), i from 1, where w = ds/dt and x is the
    distance of s outside `rest`. Each joint receives F times its coefficient. `along` replaces the
    combination by another path, which has no armature.

    Attributes:
        name: name of the tendon or actuator.
        joints: coefficients by the index of the joint's link.
        along: another path; None if there are joints.
        constant: N, or N m if s is an angle.
        stiffness: k_1, k_2, ...; N/m^i or N m/rad^i.
        damping: d_1, d_2, ...
        rest: range of lengths with zero spring force.
        armature: inertia that moves with s, kg or kg m^2.
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
class Bushing:
    """A spring of a ball or free joint, with a damper of higher powers.

    The moment on its rotation is -(k_1 + k_2 r + k_3 r^2 ...) x, where x is the rotation vector
    from `turn` and r its length. On a free joint's position acts the same force, with the
    displacement from `place`. The damper acts on each velocity component as -(d_2 |w| + d_3 |w|^2
    ...) w; linear velocities are along the axes of the joint's parent.

    Attributes:
        link: index of the joint's link.
        stiffness: k_1, k_2, ...
        damping: d_2, d_3, ...; d_1 is the link's damping.
        place: rest position, m.
        turn: rest rotation, a unit quaternion, real part first.
    """

    link: int
    stiffness: tuple[float, ...] = ()
    damping: tuple[float, ...] = ()
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class TreeCoupling:
    """A hinge or slide that follows another joint: multiplier * position + offset.

    Attributes:
        follower: index of its link.
        leader: index of the leading link; None if the follower is fixed at the offset.
        multiplier: in units of follower per leader.
        offset: rad or m.
        others: indices of further links, each with its multiplier; their positions are added.
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
    """A fluid around the bodies, at rest or in a wind.

    It acts on each body as on the box of equal mass and moments of inertia (the "inertia model" of
    the format MJCF, in its documentation under "Fluid forces"). Along and about each axis of the
    box acts a drag quadratic in the velocity, and the viscous resistance of a sphere of the box's
    mean size.

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
    """A box on which the fluid acts.

    Attributes:
        link: index of its link.
        position: position of its center, in the link's frame, m, (3,).
        rotation: its axes there, as columns, (3, 3).
        size: its edges, m, (3,).
    """

    link: int
    position: Array
    rotation: Array
    size: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree:
    """Links, parents before children.

    Attributes:
        links: in the order of the coordinates.
        gravity: m/s^2, (3,).
        pulls: force elements on several joints, or with nonlinear coefficients.
        couplings: joints that follow others, each at most once.
        fluid: fluid around the bodies; None for none.
        immersed: boxes on which the fluid acts.
        bushings: springs of ball and free joints.
        frames: named frames of bodies: the link's index, or `WORLD`, and the pose in that link's
            frame.
    """

    links: tuple[TreeLink, ...]
    gravity: Array
    pulls: tuple[TreeForce, ...] = ()
    couplings: tuple[TreeCoupling, ...] = ()
    fluid: Fluid | None = None
    immersed: tuple[Immersed, ...] = ()
    bushings: tuple[Bushing, ...] = ()
    frames: Mapping[str, tuple[int, Place]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for i, link in enumerate(self.links):
            if not WORLD <= link.parent < i:
                raise TreeError(f"{link.name}: the link that carries it must come before it")
        for element in self.pulls:
            self._check_element(element)
        for coupling in self.couplings:
            for i in (coupling.follower, *(leader for leader, _ in coupling.leaders)):
                if self.links[i].kind not in ("hinge", "slide"):
                    raise TreeError(
                        f"{self.links[i].name} is coupled, but neither a hinge nor a slide"
                    )

    def _check_element(self, element: TreeForce) -> None:
        for i, _ in element.joints:
            if self.links[i].kind not in ("hinge", "slide"):
                raise TreeError(
                    f"{element.name}: {self.links[i].name} is neither a hinge nor a slide"
                )
        if element.along is not None and (element.joints or element.armature):
            raise TreeError(
                f"{element.name}: its path does not run along joints, so it can't have an armature"
            )
        if isinstance(element.along, JointForce):
            joint, size = self.links[element.along.joint], len(element.along.gear)
            if {"ball": 3, "free": 6}.get(joint.kind) != size:
                raise TreeError(
                    f"{element.name}: {joint.name} does not take a gear of {size} numbers"
                )

    @cached_property
    def positions(self) -> tuple[slice, ...]:
        """Slice of each link's numbers in q."""
        return _slices([POSITIONS[link.kind] for link in self.links])

    @cached_property
    def velocities(self) -> tuple[slice, ...]:
        """Slice of each link's numbers in v."""
        return _slices([VELOCITIES[link.kind] for link in self.links])

    @property
    def nq(self) -> int:
        """Size of q."""
        return self.positions[-1].stop if self.links else 0

    @property
    def nv(self) -> int:
        """Size of v."""
        return self.velocities[-1].stop if self.links else 0

    @property
    def dof(self) -> int:
        """Number of independent coordinates, after couplings."""
        return self.nv - len(self.couplings)

    @property
    def zero(self) -> Array:
        """The zero position, with identity quaternions, (nq,)."""
        q = np.zeros(self.nq)
        for link, here in zip(self.links, self.positions, strict=True):
            if link.kind in ("ball", "free"):
                q[here.stop - 4] = 1.0
        return q


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum([0, *sizes])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
