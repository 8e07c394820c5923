"""Force paths other than combinations of hinge and slide positions.

A force acts along a cable through points on bodies, on a frame of a body, or on a ball or free
joint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from .rotations import Array

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
