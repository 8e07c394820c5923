"""A tree's equations of motion in its independent minimal coordinates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, Field, Scalars
from physics_crosscheck.reference.mechanism.tree import Tree
from .tree_dynamics import Dynamics, solved


class Charted:
    """Accelerations, mass matrices and powers in a tree's independent coordinates.

    Positions, rates and forces are (n, ...) with the batch last, for all n independent coordinates.
    M and the forces of the whole tree are projected onto them.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._dynamics, self._chart = (
            tree,
            Dynamics(tree, field),
            MinimalCoordinates(tree, field),
        )
        self._field = field
        self._coupled = Coupled(tree) if tree.couplings else None

    def acceleration(self, x: Scalars, rate: Scalars, forces: Scalars) -> Scalars:
        """Return the second derivatives of the coordinates under generalized forces."""
        chart = self._chart
        if chart.plain and self._coupled is None:
            return self._dynamics.acceleration(x, rate, forces)
        y, v, q = self._state(x, rate)
        applied = self._dynamics.force(q, v, chart.forces(y, self._spread(forces)))
        return self._independent(chart.second_derivatives(y, v, self._solved(q, applied)))

    def forces_for(self, x: Scalars, rate: Scalars, wanted: Scalars) -> Scalars:
        """Return the generalized forces that cause these second derivatives (inverse dynamics)."""
        y = self._state(x, rate)[0]
        applied = -self.residual(x, rate, wanted, 0 * x)
        return self._independent(self._chart.to_joint_axes(y, self._spread(applied)))

    def residual(self, x: Scalars, rate: Scalars, second: Scalars, forces: Scalars) -> Scalars:
        """Return the residual forces of given second derivatives, on the independent velocities."""
        return self.residuals(x, rate, second, forces)(self._tree)

    def residuals(
        self, x: Scalars, rate: Scalars, second: Scalars, forces: Scalars
    ) -> Callable[[Tree], Scalars]:
        """Return the function that gives `residual` for a tree that differs in some links.

        Links that the tree shares with this one, as the same objects, are not computed again.
        """
        y, v, q = self._state(x, rate)
        a = self._chart.accelerations(y, v, self._all(second))
        u = self._chart.forces(y, self._spread(forces))
        mine, field, coupled = self._tree, self._field, self._coupled
        trace = self._dynamics.recursion.trace(q, v, a)

        def residual(tree: Tree) -> Scalars:
            alike = tree.couplings == mine.couplings and np.array_equal(tree.gravity, mine.gravity)
            if not alike or [one.kind for one in tree.links] != [one.kind for one in mine.links]:
                return Charted(tree, field).residual(x, rate, second, forces)
            like = self._dynamics
            dynamics = like if tree is mine else Dynamics(tree, field, like.recursion)
            by = dynamics.residual(q, v, a, u, trace)
            return by if coupled is None else coupled.forces(by, field)

        return residual

    def inertia(self, x: Scalars) -> Scalars:
        """Return the inertia of `residual` forces: M of the independent velocities, (n, n, ...)."""
        mass = self._dynamics.mass(self._state(x, 0 * x)[2])
        return mass if self._coupled is None else self._coupled.mass(mass, self._field)

    def second_derivatives(self, x: Scalars, by: Scalars) -> Scalars:
        """Return the second derivatives of the coordinates caused by accelerations.

        The accelerations are the derivatives of the independent velocities.
        """
        y = self._state(x, 0 * x)[0]
        return self._independent(self._chart.rates(y, self._all(by)))

    def effect(self, x: Scalars, forces: Scalars) -> Scalars:
        """Return the change of the second derivatives caused by generalized forces."""
        y, _, q = self._state(x, 0 * x)
        applied = self._chart.forces(y, self._spread(forces))
        return self._independent(self._chart.rates(y, self._solved(q, applied)))

    def slopes(self, x: Scalars, rate: Scalars, second: Scalars) -> Scalars:
        """Return first-order changes of the second derivatives by the tree's parameters, (n, p, B).

        The p = 10 links + 4 nv parameters are the inertial parameters of each link
        (`Recursion.regressor`), and a damper, an armature, a spring and a constant force on each
        velocity. States are (n, B).
        """
        y, v, _ = self._state(x, rate)
        a = self._chart.accelerations(y, v, self._all(second))
        eye = np.eye(self._tree.nv)[:, :, None]
        along = np.concatenate([eye * part for part in (v, a, y, np.ones_like(v))], axis=1)
        if self._coupled is not None:
            along = self._coupled.forces(along, self._field)
        forces = np.concatenate([self.bodies(x, rate, second), along], axis=1)
        mass = np.moveaxis(self.inertia(x), -1, 0)
        by = np.linalg.solve(mass, np.moveaxis(forces, -1, 0))
        return self.second_derivatives(x[:, None], np.moveaxis(by, 0, -1))

    def bodies(self, x: Scalars, rate: Scalars, second: Scalars) -> Scalars:
        """Return the force regressor of each body's ten inertial parameters, (n, 10 links, ...).

        The parameters are those of `Recursion.regressor`. The forces are on the independent
        velocities.
        """
        y, v, q = self._state(x, rate)
        a = self._chart.accelerations(y, v, self._all(second))
        regressor = self._dynamics.recursion.regressor(q, v, a)
        return regressor if self._coupled is None else self._coupled.forces(regressor, self._field)

    def mass(self, x: Scalars) -> Scalars:
        """Return M of the kinetic energy rate^T M rate / 2, (n, n, ...)."""
        y, _, q = self._state(x, 0 * x)
        mass = self._dynamics.mass(q)
        if not self._chart.plain:
            eye = self._field.array(np.eye(self._tree.nv))
            columns = np.stack([
                self._chart.velocities(y, eye[i].reshape(-1, *(1,) * (y.ndim - 1)) + 0 * y)
                for i in range(self._tree.nv)
            ], axis=1)  # fmt: skip
            applied = (mass[:, :, None] * columns[None]).sum(axis=1)
            mass = (columns[:, :, None] * applied[:, None]).sum(axis=0)
        return mass if self._coupled is None else self._coupled.mass(mass, self._field)

    def powers(self, x: Scalars, rate: Scalars, forces: Scalars) -> Scalars:
        """Return energy, power supplied by forces, and dissipated power, (3, ...)."""
        y, v, q = self._state(x, rate)
        energy = self._dynamics.kinetic(q, v) + self._dynamics.potential(q)
        supplied = (v * self._chart.forces(y, self._spread(forces))).sum(axis=0)
        return np.stack([energy, supplied, self._dynamics.dissipated(q, v)])

    @property
    def nonsmooth(self) -> bool:
        """True if some forces are not smooth."""
        return self._dynamics.nonsmooth

    def switching_functions(self, x: Scalars, rate: Scalars) -> Scalars:
        """Return quantities that change sign where a force is not smooth, (m, ...)."""
        _, v, q = self._state(x, rate)
        return self._dynamics.switching_functions(q, v)

    def _state(self, x: Scalars, rate: Scalars) -> tuple[Scalars, Scalars, Scalars]:
        """Return all coordinates, and the tree's own velocities and positions."""
        y = x if self._coupled is None else self._coupled.positions(x, self._field)
        return y, self._chart.velocities(y, self._all(rate)), self._chart.positions(y)

    def _solved(self, q: Scalars, applied: Scalars) -> Scalars:
        """Return the accelerations of the whole tree under forces and couplings."""
        mass = self._dynamics.mass(q)
        if self._coupled is None:
            return solved(mass, applied)
        coupled, field = self._coupled, self._field
        return self._all(solved(coupled.mass(mass, field), coupled.forces(applied, field)))

    def _all(self, rates: Scalars) -> Scalars:
        """Return rates of all coordinates from those of the independent ones."""
        return rates if self._coupled is None else self._coupled.rates(rates, self._field)

    def _independent(self, values: Scalars) -> Scalars:
        """Select the independent coordinates."""
        return values if self._coupled is None else values[self._coupled.kept]

    def _spread(self, forces: Scalars) -> Scalars:
        """Place forces on the independent coordinates among all coordinates."""
        if self._coupled is None:
            return forces
        out = self._field.array(np.zeros((self._tree.nv, *forces.shape[1:])))
        out[self._coupled.kept] = forces
        return out
