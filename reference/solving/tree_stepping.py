"""A tree's state as engines step it, with angular velocities instead of coordinate rates.

Velocities of hinges and slides are coordinate rates. A ball joint has the angular velocity about
the axes of its link. A free joint has that and the velocity of its origin along the joint's axes.
At constant angular velocity w a body rotates about a fixed axis: q(t + h) = q(t) exp(h w), which
replaces q + h v in a step.
"""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import Tree


class SteppedTree:
    """M(x) dm/dt = f(x, m, u) of a tree for integrators, with stored velocities m.

    Arrays are (n, B), in the independent coordinates.

    Args:
        tree: the links.
    """

    def __init__(self, tree: Tree) -> None:
        self._dynamics, self._chart = Dynamics(tree), MinimalCoordinates(tree)
        self._coupled = Coupled(tree)

    def velocities(self, x: Scalars, rate: Scalars) -> Scalars:
        """Return the stored velocities for coordinate rates."""
        return self._chart.stored_velocities(self._all(x), self._rates(rate))[self._coupled.kept]

    def rates(self, x: Scalars, m: Scalars) -> Scalars:
        """Return the coordinate rates for stored velocities."""
        return self._chart.rates_of_stored(self._all(x), self._rates(m))[self._coupled.kept]

    def advanced(self, x: Scalars, m: Scalars, h: float) -> Scalars:
        """Return the coordinates after h seconds at constant velocities."""
        return self._chart.advance(self._all(x), self._rates(m), h)[self._coupled.kept]

    def exponential_rate(self, moved: Scalars, m: Scalars) -> Scalars:
        """Return m as the rate of the displacement of `advanced`, after displacements."""
        return self._chart.exponential_rate(self._rates(moved), self._rates(m))[self._coupled.kept]

    def mass(self, x: Scalars) -> Scalars:
        """Return M, (n, n, B)."""
        y = self._all(x)
        mass = self._dynamics.mass(self._chart.positions(y))
        if not self._chart.plain:
            half = np.stack([self._chart.to_joint_axes(y, column) for column in mass], axis=1)
            mass = np.stack([self._chart.to_joint_axes(y, row) for row in half])
        return self._coupled.mass(mass)

    def force(self, x: Scalars, m: Scalars, u: Scalars) -> Scalars:
        """Return f under forces u: moments about link axes, forces along the joint's axes."""
        y, m = self._all(x), self._rates(m)
        forces = np.zeros_like(m)
        forces[self._coupled.kept] = u
        residual = self._dynamics.residual(
            self._chart.positions(y),
            self._chart.tree_velocities(y, m),
            self._chart.frame_acceleration(y, m),
            self._chart.forces(y, forces),
        )
        return self._coupled.forces(self._chart.to_joint_axes(y, residual))

    def _all(self, x: Scalars) -> Scalars:
        return self._coupled.positions(x)

    def _rates(self, kept: Scalars) -> Scalars:
        return self._coupled.rates(kept)
