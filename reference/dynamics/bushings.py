"""Springs and nonlinear dampers of ball and free joints: forces, energies and kinks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Field,
    Scalars,
    from_quaternion,
    quaternion_product,
    rotate,
    rotate_back,
    rotation_vector,
)
from physics_crosscheck.reference.mechanism.tree import Bushing, Tree


class Bushings:
    """The bushings of a tree over one number type; the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field

    def __bool__(self) -> bool:
        """Return whether the tree has bushings."""
        return bool(self._tree.bushings)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return their forces on the joints, (nv, ...)."""
        out = 0 * v
        for bushing in self._tree.bushings:
            there = self._tree.velocities[bushing.link]
            turn, *stretched = self._stretched(bushing, q)
            forces = [-self._sprung(bushing, x) * x for x in stretched]
            rates = self._rates(v[there], turn)
            forces = [f - self._damped(bushing, w) * w for f, w in zip(forces, rates, strict=True)]
            if len(forces) == 2:
                forces[1] = rotate_back(turn, forces[1])
            out[there] = np.concatenate(forces)
        return out

    def stored(self, q: Scalars) -> Scalars:
        """Return their potential energy, joules, (...)."""
        energy: Scalars = 0 * q[0]
        for bushing in self._tree.bushings:
            for x in self._stretched(bushing, q)[1:]:
                size = (x * x).sum(axis=0) ** 0.5
                for i, k in enumerate(bushing.stiffness, start=1):
                    energy = energy + self._field.array([k / (i + 1)]) * size ** (i + 1)
        return energy

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power dissipated by their dampers, watts, (...)."""
        power: Scalars = 0 * v[0]
        for bushing in self._tree.bushings:
            for w in self._rates(v[self._tree.velocities[bushing.link]], self._turn(bushing, q)):
                power = power + (self._damped(bushing, w) * w * w).sum(axis=0)
        return power

    def switching_functions(self, q: Scalars, v: Scalars) -> Iterator[Scalars]:
        """Yield quantities, (m, ...), that change sign where a force is not smooth.

        These are the cosine of half the rotation angle of each spring, and the rates of even-power
        dampers.
        """
        for bushing in self._tree.bushings:
            if bushing.stiffness:
                yield self._apart(bushing, q)[:1]
            if any(bushing.damping[::2]):
                yield from self._rates(
                    v[self._tree.velocities[bushing.link]], self._turn(bushing, q)
                )

    def _turn(self, bushing: Bushing, q: Scalars) -> Scalars:
        """Return the joint's rotation, (3, 3, ...)."""
        here = self._tree.positions[bushing.link]
        return from_quaternion(q[here.stop - 4 : here.stop])

    def _apart(self, bushing: Bushing, q: Scalars) -> Scalars:
        """Return the rotation from the spring's rest, a quaternion (4, ...)."""
        here = self._tree.positions[bushing.link]
        turn = q[here.stop - 4 : here.stop]
        back = np.array(bushing.turn) * [1.0, -1.0, -1.0, -1.0]
        rest = self._field.array(back).reshape(4, *(1,) * (q.ndim - 1)) + 0 * turn
        result: Scalars = quaternion_product(rest, turn)
        return result

    def _stretched(self, bushing: Bushing, q: Scalars) -> list[Scalars]:
        """Return the joint's rotation, and its rotation vector and displacement from rest."""
        here = self._tree.positions[bushing.link]
        result = [self._turn(bushing, q), rotation_vector(self._apart(bushing, q))]
        if here.stop - here.start == 7:
            place = self._field.array(np.array(bushing.place)).reshape(3, *(1,) * (q.ndim - 1))
            result.append(q[here.start : here.start + 3] - place)
        return result

    def _rates(self, velocity: Scalars, turn: Scalars) -> list[Scalars]:
        """Return the angular velocity in the link's axes and the linear velocity in the joint's."""
        return [velocity[:3]] if len(velocity) == 3 else [velocity[:3], rotate(turn, velocity[3:])]

    def _sprung(self, bushing: Bushing, x: Scalars) -> Scalars:
        """Return the secant stiffness: the force per unit of deflection."""
        result: Scalars = 0 * x[0]
        size = (x * x).sum(axis=0) ** 0.5 if len(bushing.stiffness) > 1 else result
        for k in reversed(bushing.stiffness):
            result = result * size + self._field.array([k])
        return result

    def _damped(self, bushing: Bushing, w: Scalars) -> Scalars:
        """Return the secant damping of each rate: the force per unit of rate."""
        result: Scalars = 0 * w
        for d in reversed(bushing.damping):
            result = (result + self._field.array([d])) * abs(w)
        return result
