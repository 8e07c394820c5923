"""A tree's state as engines step it: velocities of rotations about the bodies' axes, not rates.

Of hinges and slides velocities are rates. A ball joint's are angular, about the axes of what it
turns; a free joint's are those and its origin's along the joint's axes. Held over a time they turn
a body about one axis: q(t + h) = q(t) exp(h w), which a step takes for q + h v.
"""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.chart import Chart
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import Tree


class SteppedTree:
    """What integrators ask of a tree: M(x) dm/dt = f(x, m, u) of the velocities m that they keep.

    Arrays are (n, B), of the coordinates that follow no other.

    Args:
        tree: the links.
    """

    def __init__(self, tree: Tree) -> None:
        self._dynamics, self._chart = Dynamics(tree), Chart(tree)
        self._coupled = Coupled(tree)

    def velocities(self, x: Scalars, rate: Scalars) -> Scalars:
        """Of the coordinates' rates."""
        return self._chart.carried(self._all(x), self._rates(rate))[self._coupled.kept]

    def rates(self, x: Scalars, m: Scalars) -> Scalars:
        """Of velocities."""
        return self._chart.carrying(self._all(x), self._rates(m))[self._coupled.kept]

    def advanced(self, x: Scalars, m: Scalars, h: float) -> Scalars:
        """Coordinates after velocities are held for h seconds."""
        return self._chart.turned_on(self._all(x), self._rates(m), h)[self._coupled.kept]

    def unturned(self, moved: Scalars, m: Scalars) -> Scalars:
        """m as the rate of the moves that turn bodies on, after moves."""
        return self._chart.unturned(self._rates(moved), self._rates(m))[self._coupled.kept]

    def mass(self, x: Scalars) -> Scalars:
        """M, (n, n, B)."""
        y = self._all(x)
        mass = self._dynamics.mass(self._chart.positions(y))
        if not self._chart.plain:
            half = np.stack([self._chart.given(y, column) for column in mass], axis=1)
            mass = np.stack([self._chart.given(y, row) for row in half])
        return self._coupled.mass(mass)

    def force(self, x: Scalars, m: Scalars, u: Scalars) -> Scalars:
        """f, under forces u on the coordinates: a moment about axes, a force along the joint's."""
        y, m = self._all(x), self._rates(m)
        forces = np.zeros_like(m)
        forces[self._coupled.kept] = u
        left = self._dynamics.residual(
            self._chart.positions(y),
            self._chart.own(y, m),
            self._chart.steady(y, m),
            self._chart.forces(y, forces),
        )
        return self._coupled.forces(self._chart.given(y, left))

    def _all(self, x: Scalars) -> Scalars:
        return self._coupled.positions(x)

    def _rates(self, kept: Scalars) -> Scalars:
        return self._coupled.rates(kept)
