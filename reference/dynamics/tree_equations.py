"""Equations of motion of a tree of bodies, by recursion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.mechanism.assemble import TreeSystem
from physics_crosscheck.reference.mechanism.chart import Coupled, MinimalCoordinates
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, LONG_DOUBLES, Field, Scalars
from physics_crosscheck.reference.mechanism.system import ENTRIES
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .equations import EquationsOfMotion
from .recursion import Recursion
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


STATES_PER_RECURSION = 2000
"""States per recursion; more of them cost memory without saving time."""

ROUNDING_MARGIN = 4.0
"""Factor from the largest rounding observed at some states to the bound at all states."""


@dataclass(frozen=True)
class TreeEquations(EquationsOfMotion):
    """The equations of motion of a tree."""

    system: TreeSystem

    @property
    def linear(self) -> bool:
        """False: trees are always solved as nonlinear systems."""
        return False

    @cached_property
    def numeric_acceleration(self) -> TreeFunction:
        """a(q, v, u, (t,)), (..., n)."""
        return TreeFunction(self._accelerations, self.system.tree.dof)

    @cached_property
    def numeric_power(self) -> TreeFunction:
        """(energy, power supplied, power dissipated) of (q, v, u, (t,))."""
        return TreeFunction(self._powers, self.system.tree.dof)

    @cached_property
    def numeric_mass(self) -> TreeFunction:
        """M of (q, v, u, (t,)), in row-major order."""
        return TreeFunction(self._masses, self.system.tree.dof)

    @cached_property
    def turning(self) -> Array:
        """Mask of the coordinates that are angles, (n,)."""
        return np.array([c.unit == "rad" for c in self.system.coordinates], dtype=bool)

    def pushed_acceleration(self, q: Array, v: Array, forces: Array) -> Array:
        """Return accelerations under generalized forces, all (..., n)."""
        shape = np.broadcast_shapes(q.shape, v.shape, forces.shape)
        arguments = (_first(np.broadcast_to(part, shape)) for part in (q, v, forces))
        return _last(self._doubles.acceleration(*arguments))

    def pushed_slopes(self, states: Array, forces: Array) -> Array:
        """Return derivatives of accelerations under constant forces by q and v, (B, n, 2n).

        They are central differences of the residual force at fixed accelerations. That needs one
        mass matrix per state; differences of accelerations need one per component.

        Args:
            states: (B, 2n).
            forces: on the coordinates, (B, n).
        """
        n, equations = forces.shape[1], self._doubles
        x, rate, pushed = (_first(part) for part in (states[:, :n], states[:, n:], forces))
        second = equations.acceleration(x, rate, pushed)
        inverse = np.linalg.inv(np.moveaxis(equations.inertia(x), -1, 0))

        def residual(steps: Array) -> Scalars:
            """Return residual forces, (n, columns, B), at states displaced by (2n, columns)."""
            like = (n, steps.shape[1], len(states))
            moved = (x[:, None] + steps[:n, :, None], rate[:, None] + steps[n:, :, None])
            fixed = (np.broadcast_to(part[:, None], like) for part in (second, pushed))
            return equations.residual(*moved, *fixed)

        sizes = 1e-6 * np.maximum(np.max(np.abs(states), axis=0), 1e-3)
        columns = []
        for some in np.array_split(
            np.arange(2 * n), -(-2 * n * len(states) // STATES_PER_RECURSION)
        ):
            step = np.zeros((2 * n, len(some)))
            step[some, range(len(some))] = sizes[some]
            by = np.einsum("bij,jcb->icb", inverse, residual(step) - residual(-step), optimize=True)
            positions = np.broadcast_to(x[:, None], by.shape)
            columns.append(equations.second_derivatives(positions, by) / (2 * sizes[some][:, None]))
        return np.moveaxis(np.concatenate(columns, axis=1), 2, 0)

    def state_matrices(self, states: Array, forces: Array) -> Array:
        """Return derivatives of a state's rates by the state under constant forces, (B, 2n, 2n)."""
        n = forces.shape[1]
        result = np.zeros((len(states), 2 * n, 2 * n))
        result[:, range(n), range(n, 2 * n)] = 1.0
        result[:, n:] = self.pushed_slopes(states, forces)
        return result

    def mechanics(self, q: Array, v: Array, forces: Array) -> tuple[Array, Array]:
        """Return M, (B, n, n), and the other forces, (B, n), of M a = f in the coordinates.

        M is the inverse of the accelerations per unit force on each coordinate: not symmetric for
        joints that turn freely, whose forces are moments.
        """
        n, x = q.shape[1], _first(q)
        columns = [self._doubles.effect(x, _repeated(unit, x)) for unit in np.eye(n)]
        mass = np.linalg.inv(np.moveaxis(np.stack(columns, axis=1), -1, 0))
        other = np.einsum("bij,bj->bi", mass, self.pushed_acceleration(q, v, forces))
        return mass, other

    def forces_for(self, q: Array, v: Array, wanted: Array) -> Array:
        """Return the generalized forces that cause accelerations, all (..., n)."""
        return _last(self._doubles.forces_for(*map(_first, (q, v, wanted))))

    def inertia(self, q: Array) -> Array:
        """Return M of the velocities at positions (B, n), (B, n, n); definite wherever T is."""
        result: Array = np.moveaxis(self._doubles.inertia(_first(q)), -1, 0)
        return result

    def slopes_by_number(self, q: Array, v: Array, a: Array) -> Array:
        """Return derivatives of accelerations by the tree's parameters, (K, n, p), at K states."""
        return np.moveaxis(self._doubles.slopes(*map(_first, (q, v, a))), -1, 0)

    @property
    def nonsmooth(self) -> bool:
        """True if some forces are not smooth."""
        return self._doubles.nonsmooth

    def switching_functions(self, q: Array, v: Array) -> Array:
        """Return quantities that change sign where a force is not smooth, (..., m)."""
        return _last(self._doubles.switching_functions(_first(q), _first(v)))

    def rounding(self, q: Array, v: Array, forces: Array) -> Array:
        """Return a bound of the rounding of accelerations at states (..., n): (n,)."""
        arguments = [_first(part) for part in (q, v, forces)]
        long = Charted(self.system.tree, LONG_DOUBLES)
        exact = long.acceleration(*map(LONG_DOUBLES.array, arguments))
        apart = np.abs(exact - self._doubles.acceleration(*arguments)).astype(float)
        bound: Array = ROUNDING_MARGIN * np.max(apart.reshape(len(apart), -1), axis=1)
        return bound

    @cached_property
    def pushes(self) -> Array:
        """Generalized forces per unit input, (n, inputs)."""
        inputs = self.system.inputs
        rows = [[float(signal.on.get(c, 0)) for signal in inputs] for c in self.system.coordinates]
        return np.array(rows).reshape(len(rows), len(inputs))

    def acceleration_error(
        self,
        states: Array,
        inputs: Array,
        times: Array,
        *,
        off: Array,
        time_error: Array,
        rounded: bool,
    ) -> Array:
        """Return a bound of the error of the accelerations, from a comparison with long doubles."""
        n = self.system.tree.dof
        q, v, u = (_first(part) for part in (states[..., :n], states[..., n:], inputs))
        inverse = np.stack(
            [np.abs(self._doubles.effect(q, _repeated(column, q)))
             for column in self.pushes.T] or [np.zeros((n, 0))]
        )  # fmt: skip
        error = np.zeros_like(q)
        for column, by in zip(inverse, _first(off), strict=False):
            error = error + column * by
        if rounded:
            forces = _last(self._forces(u, v))
            rounding = self.rounding(states[..., :n], states[..., n:], forces)
            error = error + _repeated(rounding, q)
        return _last(error)

    @cached_property
    def _doubles(self) -> Charted:
        return Charted(self.system.tree, DOUBLES)

    def _forces(self, u: Array, like: Array) -> Array:
        return np.tensordot(self.pushes, u, 1) if len(u) else np.zeros_like(like)

    def _accelerations(self, q: Array, v: Array, u: Array) -> Array:
        result: Array = self._doubles.acceleration(q, v, self._forces(u, v))
        return result

    def _powers(self, q: Array, v: Array, u: Array) -> Array:
        return self._doubles.powers(q, v, self._forces(u, v))

    def _masses(self, q: Array, v: Array, u: Array) -> Array:
        mass = self._doubles.mass(q)
        return mass.reshape(-1, *mass.shape[2:])


@dataclass(frozen=True)
class TreeFunction:
    """A function of (q, v, u) with the batch last, called as (q, v, u, (t,)) with it first.

    Attributes:
        dof: degrees of freedom of the tree, the length of q.
    """

    function: Callable[[Array, Array, Array], Array]
    dof: int

    def __call__(self, *arguments: Array) -> Array:
        """Evaluate."""
        shape = np.broadcast_shapes(*(np.shape(a)[:-1] for a in arguments))
        q, v, u = (_first(np.broadcast_to(a, (*shape, a.shape[-1]))) for a in arguments[:3])
        return _last(self.function(q, v, u))

    def scalar(self, *columns: float) -> Sequence[float]:
        """Return the same function of plain numbers: q, v, u and t."""
        n = self.dof
        q, v, u = np.array(columns[:n]), np.array(columns[n : 2 * n]), np.array(columns[2 * n : -1])
        result: list[float] = self.function(q, v, u).tolist()
        return result


def _first(values: Array) -> Scalars:
    """Move the last axis to the front."""
    return np.moveaxis(values, -1, 0)


def _last(values: Scalars) -> Array:
    """Move the first axis to the end."""
    return np.moveaxis(values, 0, -1)


def _repeated(column: Array, like: Array) -> Array:
    """Repeat a column (n,) at every state of a batch (n, ...)."""
    return np.broadcast_to(column.reshape(-1, *(1,) * (like.ndim - 1)), like.shape)


class TreeFrames:
    """Position and rotation of F frames as a function of a tree's independent coordinates.

    Args:
        tree: the links.
        names: the frames, of those that the tree has.
    """

    def __init__(self, tree: Tree, names: Sequence[str]) -> None:
        self._recursion, self._frames = Recursion(tree), [tree.frames[name] for name in names]
        self._coupled, self._chart = Coupled(tree), MinimalCoordinates(tree)

    def __call__(self, x: Array) -> Array:
        """Return the poses at K positions (K, n): (K, 12 F), as `frame_function` does."""
        links = self._recursion.poses(self._chart.positions(self._coupled.positions(x.T)))
        count = len(x)
        values = np.empty((count, len(self._frames), ENTRIES))
        for f, (link, place) in enumerate(self._frames):
            rotation, origin = np.eye(3)[None], np.zeros((1, 3))
            if link != WORLD:
                pose = links[link]
                rotation = np.moveaxis(np.broadcast_to(pose.rotation, (3, 3, count)), -1, 0)
                origin = np.moveaxis(np.broadcast_to(pose.origin, (3, count)), -1, 0)
            values[:, f, :3] = origin + rotation @ place.origin
            values[:, f, 3:] = (rotation @ place.rotation).reshape(-1, 9)
        return values.reshape(count, -1)
