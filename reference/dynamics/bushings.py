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
    rotation_vector,
    turned,
    turned_back,
)
from physics_crosscheck.reference.mechanism.tree import Bush, Tree


class Bushes:
    """The bushings of a tree over one number type; the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field

    def __bool__(self) -> bool:
        """Return whether the tree has bushings."""
        return bool(self._tree.bushes)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return their forces on the joints, (nv, ...)."""
        out = 0 * v
        for bush in self._tree.bushes:
            there = self._tree.velocities[bush.link]
            turn, *stretched = self._stretched(bush, q)
            forces = [-self._sprung(bush, x) * x for x in stretched]
            rates = self._rates(v[there], turn)
            forces = [f - self._damped(bush, w) * w for f, w in zip(forces, rates, strict=True)]
            if len(forces) == 2:
                forces[1] = turned_back(turn, forces[1])
            out[there] = np.concatenate(forces)
        return out

    def stored(self, q: Scalars) -> Scalars:
        """Return their potential energy, joules, (...)."""
        found: Scalars = 0 * q[0]
        for bush in self._tree.bushes:
            for x in self._stretched(bush, q)[1:]:
                size = (x * x).sum(axis=0) ** 0.5
                for i, k in enumerate(bush.stiffness, start=1):
                    found = found + self._field.array([k / (i + 1)]) * size ** (i + 1)
        return found

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power dissipated by their dampers, watts, (...)."""
        found: Scalars = 0 * v[0]
        for bush in self._tree.bushes:
            for w in self._rates(v[self._tree.velocities[bush.link]], self._turn(bush, q)):
                found = found + (self._damped(bush, w) * w * w).sum(axis=0)
        return found

    def bends(self, q: Scalars, v: Scalars) -> Iterator[Scalars]:
        """Yield quantities, (m, ...), that change sign where a force is not smooth.

        These are the cosine of half the rotation angle of each spring, and the rates of even-power
        dampers.
        """
        for bush in self._tree.bushes:
            if bush.stiffness:
                yield self._apart(bush, q)[:1]
            if any(bush.damping[::2]):
                yield from self._rates(v[self._tree.velocities[bush.link]], self._turn(bush, q))

    def _turn(self, bush: Bush, q: Scalars) -> Scalars:
        """Return the joint's rotation, (3, 3, ...)."""
        here = self._tree.positions[bush.link]
        return from_quaternion(q[here.stop - 4 : here.stop])

    def _apart(self, bush: Bush, q: Scalars) -> Scalars:
        """Return the rotation from the spring's rest, a quaternion (4, ...)."""
        here = self._tree.positions[bush.link]
        turn = q[here.stop - 4 : here.stop]
        back = np.array(bush.turn) * [1.0, -1.0, -1.0, -1.0]
        rest = self._field.array(back).reshape(4, *(1,) * (q.ndim - 1)) + 0 * turn
        found: Scalars = quaternion_product(rest, turn)
        return found

    def _stretched(self, bush: Bush, q: Scalars) -> list[Scalars]:
        """Return the joint's rotation, and its rotation vector and displacement from rest."""
        here = self._tree.positions[bush.link]
        found = [self._turn(bush, q), rotation_vector(self._apart(bush, q))]
        if here.stop - here.start == 7:
            place = self._field.array(np.array(bush.place)).reshape(3, *(1,) * (q.ndim - 1))
            found.append(q[here.start : here.start + 3] - place)
        return found

    def _rates(self, own: Scalars, turn: Scalars) -> list[Scalars]:
        """Return the angular velocity in the link's axes and the linear velocity in the joint's."""
        return [own[:3]] if len(own) == 3 else [own[:3], turned(turn, own[3:])]

    def _sprung(self, bush: Bush, x: Scalars) -> Scalars:
        """Return the secant stiffness: the force per unit of deflection."""
        found: Scalars = 0 * x[0]
        size = (x * x).sum(axis=0) ** 0.5 if len(bush.stiffness) > 1 else found
        for k in reversed(bush.stiffness):
            found = found * size + self._field.array([k])
        return found

    def _damped(self, bush: Bush, w: Scalars) -> Scalars:
        """Return the secant damping of each rate: the force per unit of rate."""
        found: Scalars = 0 * w
        for d in reversed(bush.damping):
            found = (found + self._field.array([d])) * abs(w)
        return found
