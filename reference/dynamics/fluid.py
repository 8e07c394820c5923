"""Fluid forces on the bodies of a tree: drag and viscous resistance of their boxes.

A box has the edges a, b, c, in a fluid of density rho and viscosity beta. Its center moves with u
relative to the fluid, and it rotates with w, both along its own axes. The force and the moment
about the center are, for the first axis and cyclically for the others,

    f = -rho b c |u| u / 2 - 3 pi beta d u,  g = -rho a (b^4 + c^4) |w| w / 64 - pi beta d^3 w,

where d is the mean edge. The first terms are a quadratic drag; its moment integrates the force over
the rotating faces. The second terms are the resistance of a sphere of diameter d (Stokes). The
second derivative of the forces jumps where a velocity changes sign; the first is continuous.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.dynamics.propagation import Acting, Moving, Placement
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Field,
    Scalars,
    cross,
    rotate,
    rotate_back,
)
from physics_crosscheck.reference.mechanism.tree import Fluid, Immersed, Tree


@dataclass(frozen=True)
class DragBox:
    """Pose and coefficients of a box; coefficients of forces and of moments, (3,) each.

    Attributes:
        position, rotation: in the frame of its link.
        drag, turning_drag: factors of a force and a moment at |u| u and |w| w.
        resistance, turning_resistance: the same at u and w.
    """

    position: Scalars
    rotation: Scalars
    drag: Scalars
    resistance: Scalars
    turning_drag: Scalars
    turning_resistance: Scalars

    def place(self, vectors: Scalars) -> tuple[Scalars, Scalars]:
        """Return its position and rotation, shaped to broadcast with a batch of vectors."""
        tall = (1,) * (vectors.ndim - 1)
        return self.position.reshape(3, *tall), self.rotation.reshape(3, 3, *tall)


class Immersion:
    """Fluid forces on a tree over one number type; the batch is last.

    Args:
        tree: the links and immersed boxes.
        recursion: the tree's kinematics over the same numbers.
        field: the number type, which must be ordered.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._recursion, self._field = tree, recursion, field
        self._wind = None
        self._boxes: list[DragBox] = []
        if tree.fluid is not None:
            self._boxes = [drag_box(immersed, tree.fluid, field) for immersed in tree.immersed]
            self._wind = field.array(tree.fluid.wind) if any(tree.fluid.wind) else None

    def __bool__(self) -> bool:
        """Return whether any box is immersed."""
        return bool(self._boxes)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the forces on the joints, (nv, ...)."""
        none = self._field.array(np.zeros((3, *v.shape[1:])))
        on: list[Acting] = [(none, none) for _ in self._tree.links]
        placements = self._recursion.placements(q)
        for immersed, box, moving in self._moving(placements, v):
            force, moment = _dragged(box, moving)
            on[immersed.link] = on[immersed.link][0] + force, on[immersed.link][1] + moment
        return self._recursion.propagate(placements, on)

    @property
    def nonsmooth(self) -> bool:
        """True if there is a quadratic drag."""
        fluid = self._tree.fluid
        return bool(self) and fluid is not None and fluid.density > 0

    def switching_functions(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the velocities whose sign changes make a drag non-smooth, (m, ...)."""
        placements = self._recursion.placements(q)
        moving = self._moving(placements, v) if self.nonsmooth else ()
        return np.concatenate([0 * v[:0], *(part for _, _, motion in moving for part in motion)])

    def _moving(
        self, placements: list[Placement], v: Scalars
    ) -> Iterator[tuple[Immersed, DragBox, Moving]]:
        """Yield each box with the velocity of its center relative to the fluid, in its own axes."""
        links = self._recursion.velocities(placements, v)
        blowing = self._blowing(placements, v)
        for immersed, box in zip(self._tree.immersed, self._boxes, strict=True):
            angular, linear = links[immersed.link]
            if blowing:
                linear = linear - blowing[immersed.link]
            center, turn = box.place(linear)
            linear = linear + cross(angular, center)
            yield immersed, box, Moving(rotate_back(turn, angular), rotate_back(turn, linear))

    def _blowing(self, placements: list[Placement], v: Scalars) -> list[Scalars]:
        """Return the wind in each link's frame, (3, ...); empty without wind."""
        if self._wind is None:
            return []
        wind = self._wind.reshape(3, *(1,) * (v.ndim - 1)) + 0 * v[:1]
        return [rotate_back(pose.rotation, wind) for pose in self._recursion.poses_of(placements)]


def _dragged(box: DragBox, moving: Moving) -> Acting:
    """Return the force on the link at the link's origin, in the link's frame."""
    angular, linear = moving
    tall = (3, *(1,) * (linear.ndim - 1))
    drag, resistance, turning_drag, turning_resistance = (
        coefficients.reshape(tall)
        for coefficients in (box.drag, box.resistance, box.turning_drag, box.turning_resistance)
    )
    center, turn = box.place(linear)
    force = rotate(turn, -(drag * abs(linear) + resistance) * linear)
    moment = rotate(turn, -(turning_drag * abs(angular) + turning_resistance) * angular)
    return force, moment + cross(center, force)


def drag_box(immersed: Immersed, fluid: Fluid, field: Field = DOUBLES) -> DragBox:
    """Return the pose of a box in a fluid, and its coefficients."""
    size: Array = immersed.size
    others = size[[1, 2, 0]], size[[2, 0, 1]]
    mean = size.sum() / 3
    density, viscosity = max(fluid.density, 0.0), max(fluid.viscosity, 0.0)
    return DragBox(
        position=field.array(immersed.position),
        rotation=field.array(immersed.rotation),
        drag=field.array(density / 2 * others[0] * others[1]),
        resistance=field.array(np.full(3, 3 * np.pi * viscosity * mean)),
        turning_drag=field.array(density / 64 * size * (others[0] ** 4 + others[1] ** 4)),
        turning_resistance=field.array(np.full(3, np.pi * viscosity * mean**3)),
    )
