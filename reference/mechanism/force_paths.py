"""Lengths, and directions of forces, that are no combination of hinges and slides.

Of what is pulled along: points on bodies, a frame on a body, a joint that turns or moves any way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from physics_crosscheck.reference.mechanism.numeric import Array

P = TypeVar("P")
Q = TypeVar("Q")
J = TypeVar("J")
K = TypeVar("K")


@dataclass(frozen=True, kw_only=True, eq=False)
class Mark:
    """A frame that a link carries.

    Attributes:
        link: its index; -1 where nothing moves it.
        position: of its origin, in the link's frame or the world's, m, (3,).
        rotation: of its axes there, as columns, (3, 3).
    """

    link: int
    position: Array
    rotation: Array


@dataclass(frozen=True, kw_only=True)
class CablePath(Generic[P]):
    """Straight lines from frame to frame: s is the sum of their lengths, each times a share.

    Attributes:
        branches: shares, each with the frames that its lines join, two at least.
    """

    branches: tuple[tuple[float, tuple[P, ...]], ...]

    def at(self, marks: Callable[[P], Q]) -> CablePath[Q]:
        """The same through other frames."""
        return CablePath(
            branches=tuple((share, tuple(map(marks, row))) for share, row in self.branches)
        )


@dataclass(frozen=True, kw_only=True)
class FrameForce(Generic[P]):
    """A force and a moment on a frame, or between two.

    Without `against`, both are along the frame's own axes, and s is zero. Otherwise they act at the
    frame, along the axes of `against`, and their opposites at that one's origin; what carries both
    feels nothing. s is then `gear` times where the frame is there, and times its rotation vector.
    In either case ds/dt stands for the power of them by F.

    Attributes:
        frame: on which it acts.
        gear: force and moment by F, (6,).
        against: that from which it pushes; None for none.
    """

    frame: P
    gear: tuple[float, ...]
    against: P | None = None

    def at(self, marks: Callable[[P], Q]) -> FrameForce[Q]:
        """The same on other frames."""
        against = None if self.against is None else marks(self.against)
        return FrameForce(frame=marks(self.frame), gear=self.gear, against=against)


@dataclass(frozen=True, kw_only=True)
class JointForce(Generic[J]):
    """A moment about a ball joint, or a force and a moment on a free one.

    Of a ball joint s is `gear` times its rotation vector, of a free one zero; ds/dt stands for the
    power by F.

    Attributes:
        joint: on which it acts.
        gear: a moment by F, (3,), or a force along the joint's axes and a moment, (6,).
        in_parent: whether moments are along the axes of what carries the joint, not the link's.
    """

    joint: J
    gear: tuple[float, ...]
    in_parent: bool = False

    def at(self, joint: Callable[[J], K]) -> JointForce[K]:
        """The same on another joint."""
        return JointForce(joint=joint(self.joint), gear=self.gear, in_parent=self.in_parent)


Way = CablePath[Mark] | FrameForce[Mark] | JointForce[int]
"""Of a tree's links, by their indices."""
