"""Effect of a changed tree on its short segments, exact and to first order.

A segment is solved by Gauss collocation with a few stages. A changed tree leaves residual forces at
the stages, which one recursion computes. Their effect on the end is a linear problem whose matrix
is the same for all changes. So the derivative by one parameter costs one recursion instead of a
solution. Inertial parameters need not even that, because forces are linear in them.

Informative states are chosen once, and solved once by two methods. They stay informative for other
parameters, and the new segments are close to the known ones. Newton's method starts from the known
segments with the known Jacobian (`solving.flows`). Each further sample of parameters then costs
only a few recursions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.dynamics.recursion import bodies_apart
from physics_crosscheck.reference.dynamics.tree_equations import Charted, TreeEquations
from physics_crosscheck.reference.mechanism.assemble import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import Tree
from .collocation import ReferenceError, gauss
from .samples import rate_of, rounding_of, solved
from .segments import Segments

STAGES = 4
"""Order 8: over a twentieth of the fastest period its error is 1e-14 of the movement."""

ITERATIONS = 60

CONVERGED = 1e-15
"""Iteration ends at this change of the stages, relative to the largest of each component."""

MAX_CHANGE_RATIO, RATIO_ITERATIONS = 0.25, 5
"""Within so many iterations the change must shrink to this share; otherwise 60 do not suffice."""

STALLED_CHANGE = 1e-11
"""Accepted change if rounding prevents further convergence."""

PERTURBATION, MIN_STATE_SIZE = 1e-7, 1e-3
"""Perturbation of a state for the Jacobian, as a share of its size, and the smallest size."""

TINY = 1e-300

_OF_TREE = ("_rounding_residual", "_residuals", "_inverse")
"""Cached quantities that belong to a tree."""


_Step = Callable[[Scalars], Scalars]


class Flow:
    """B segments of one length, in the n independent coordinates of a tree.

    Args:
        tree: the links.
        start: states (y, rates), (B, 2 n).
        forces: constant generalized forces, (B, n).
        length: seconds.
        stages: stages of the collocation; its order is twice as large.

    Raises:
        ReferenceError: if the segments can't be solved.
    """

    def __init__(
        self, tree: Tree, start: Array, forces: Array, length: float, stages: int = STAGES
    ) -> None:
        self._count = stages
        self._nodes, self._weights, self._matrix, _ = gauss(stages)
        self._start, self._length = start.T[..., None], length
        self._forces = np.repeat(forces.T[..., None], stages, axis=2)
        equations = Charted(tree)
        self._take(tree, equations, self._iterated(equations))

    def for_tree(self, tree: Tree) -> Flow:
        """Return the segments of another tree, solved with this tree's Jacobian.

        Raises:
            ReferenceError: if they can't be solved.
        """
        _ = self._to_ends
        flow = Flow.__new__(Flow)
        flow.__dict__ |= {k: v for k, v in self.__dict__.items() if k not in _OF_TREE}
        equations = Charted(tree)
        flow._take(tree, equations, self._corrected(equations))
        return flow

    @property
    def end(self) -> Array:
        """Ends of the segments, (B, 2 n)."""
        moved = self._length * np.einsum("s,xbs->bx", self._weights, self._slopes)
        result: Array = self._start[..., 0].T + moved
        return result

    def apart(self, other: Flow) -> Array:
        """Return the ends minus those of another tree from the same states, (B, 2 n)."""
        by = self._slopes - other._slopes
        result: Array = self._length * np.einsum("s,xbs->bx", self._weights, by)
        return result

    def variation(self, changed: Tree) -> Array:
        """Return the first-order displacement of the ends for a slightly changed tree, (B, 2 n).

        Raises:
            ReferenceError: if the changed tree's forces are not finite.
        """
        by = self._pushed(self._forces_apart(changed))
        field = np.concatenate([np.zeros_like(by), by])
        if not np.isfinite(field).all():
            raise ReferenceError("the changed tree has no finite forces")
        result: Array = (self._to_ends @ _flat(field))[..., 0]
        return result

    def moved(self, changed: Tree) -> Array:
        """Return the displacement of the ends for a changed tree, (B, 2 n).

        Raises:
            ReferenceError: if it can't be solved.
        """
        return self.for_tree(changed).apart(self)

    def _take(self, tree: Tree, equations: Charted, slopes: Scalars) -> None:
        """Store a tree, its equations, and the rates at the stages, (2 n, B, stages)."""
        self.tree, self._equations, self._slopes = tree, equations, slopes
        self._stages = self._staged(slopes)

    def _forces_apart(self, changed: Tree) -> Scalars:
        """Return the residual forces of a changed tree at the stages, minus this tree's."""
        by = bodies_apart(changed, self.tree)
        if by is None:
            return self._residuals(changed) - self._rounding_residual
        moved = np.flatnonzero(by)
        result: Scalars = -np.tensordot(self._bodies[:, moved], by[moved], ([1], [0]))
        return result

    @cached_property
    def _bodies(self) -> Scalars:
        """Regressor of the forces at the stages by the bodies' inertial parameters."""
        n = self.tree.dof
        return self._equations.bodies(self._stages[:n], self._stages[n:], self._slopes[n:])

    @cached_property
    def _rounding_residual(self) -> Scalars:
        """Residual of the tree's own forces, caused by rounding."""
        return self._residuals(self.tree)

    @cached_property
    def _residuals(self) -> Callable[[Tree], Scalars]:
        """Residual forces at the stages, by the tree."""
        return self._residuals_at(self._stages)

    @cached_property
    def _inverse(self) -> Scalars:
        """Inverse mass matrix at the stages, (n, n, B, stages)."""
        mass = self._equations.inertia(self._stages[: self.tree.dof])
        mass = np.moveaxis(mass, (0, 1), (-2, -1))
        result: Scalars = np.moveaxis(np.linalg.inv(mass), (-2, -1), (0, 1))
        return result

    def _residuals_at(self, states: Scalars) -> Callable[[Tree], Scalars]:
        """Return the function of a tree that gives its residual forces at these accelerations."""
        n = self.tree.dof
        return self._equations.residuals(states[:n], states[n:], self._slopes[n:], self._forces)

    def _pushed(self, forces: Scalars) -> Scalars:
        """Return the change of the coordinates' second derivatives caused by forces."""
        by = np.einsum("ij...,j...->i...", self._inverse, forces)
        return self._equations.second_derivatives(self._stages[: self.tree.dof], by)

    def _staged(self, slopes: Scalars) -> Scalars:
        result: Scalars = self._start + self._length * np.einsum(
            "st,xbt->xbs", self._matrix, slopes
        )
        return result

    def _field(self, equations: Charted, states: Scalars) -> Scalars:
        rate = states[len(states) // 2 :]
        return np.concatenate(
            [rate, equations.acceleration(states[: len(states) // 2], rate, self._forces)]
        )

    def _iterated(self, equations: Charted) -> Scalars:
        """Return the rates at the stages, iterated from the segments' starts."""
        slopes = self._field(equations, np.repeat(self._start, self._count, axis=2))
        return self._solved(equations, slopes, lambda residual: residual)

    def _corrected(self, equations: Charted) -> Scalars:
        """Return the rates of a changed tree, by Newton's method with the known Jacobian."""
        return self._solved(equations, self._slopes, self._newton)

    def _newton(self, residual: Scalars) -> Scalars:
        step = (self._resolvent @ _flat(residual)).reshape(residual.shape[1], self._count, -1)
        return np.moveaxis(step, (2, 0, 1), (0, 1, 2))

    def _solved(self, equations: Charted, slopes: Scalars, step: _Step) -> Scalars:
        last = before = np.inf
        for count in range(1, ITERATIONS + 1):
            with np.errstate(all="ignore"):
                try:
                    by = step(self._field(equations, self._staged(slopes)) - slopes)
                except np.linalg.LinAlgError:
                    break
                size = np.abs(slopes).max(axis=(1, 2)) + TINY
                change = float(np.max(np.abs(by).max(axis=(1, 2)) / size))
            if not np.isfinite(change):
                break
            slopes = slopes + by
            if change < CONVERGED or (change < STALLED_CHANGE and change > last / 4):
                return slopes
            if count % RATIO_ITERATIONS == 0:
                if change > MAX_CHANGE_RATIO * before:
                    break
                before = change
            last = change
        raise ReferenceError("the stage equations of the collocation do not converge")

    @cached_property
    def _resolvent(self) -> Array:
        """(1 - h A x J)^-1, (B, stages 2 n, stages 2 n)."""
        jacobian = self._jacobian()
        count, _, size, _ = jacobian.shape
        rows = np.einsum("st,bsxy->bsxty", self._length * self._matrix, jacobian)
        whole = np.eye(self._count * size) - rows.reshape(count, self._count * size, -1)
        result: Array = np.linalg.inv(whole)
        return result

    @cached_property
    def _to_ends(self) -> Array:
        """Map from added rates at the stages to the ends, (B, 2 n, stages 2 n)."""
        weights = np.kron(self._length * self._weights, np.eye(len(self._stages)))
        result: Array = weights @ self._resolvent
        return result

    def _jacobian(self) -> Array:
        """Return the Jacobian of the rates at the stages, (B, stages, 2 n, 2 n), by differences.

        Differences of accelerations come from residual forces, which need no mass matrix.
        """
        size, n = len(self._stages), self.tree.dof
        units = np.eye(size)[:, :, None, None]
        columns = []
        for i in range(size):
            by = PERTURBATION * max(float(np.abs(self._stages[i]).max()), MIN_STATE_SIZE)
            forces = (
                self._residuals_at(self._stages + by * units[i])(self.tree)
                - self._rounding_residual
            )
            rates = np.broadcast_to(units[i, n:], forces.shape)
            columns.append(np.concatenate([rates, self._pushed(forces) / by]))
        return np.moveaxis(np.stack(columns), (0, 1, 2, 3), (3, 2, 0, 1))


def _flat(field: Scalars) -> Array:
    """Reshape (x, B, stages) to columns (B, stages x, 1)."""
    return np.moveaxis(field, (0, 1, 2), (2, 0, 1)).reshape(field.shape[1], -1, 1)


MAX_RATE_RATIO = 1.5
"""Largest ratio of rates for which both trees share one segment length. Faster trees get shorter
segments, solved by two methods like the first."""

RESOLVED_STAGES = 6
"""Stages of the collocation, order 12. Its error is below rounding over a twentieth of the fastest
period; order 8 had an error of up to 1e-12 of the movement."""

ERROR_FACTOR = 4.0
"""Factor from the collocation's error for the known segments to that for a sample."""


class ReusedSegments:
    """Segments of a tree, and those of trees with other parameters.

    Args:
        system: system of the tree.
        samples: its solved segments.

    Raises:
        ReferenceError: if the collocation does not reproduce the known ends.
    """

    def __init__(self, system: TreeSystem, samples: Segments) -> None:
        self._system, self._samples = system, samples
        self._rate = rate_of(TreeEquations(system), samples.start, samples.start_inputs)
        self._flow = Flow(
            system.tree, samples.start, samples.start_inputs, samples.length, RESOLVED_STAGES
        )
        self._off: Array = np.max(np.abs(self._flow.end - samples.end), axis=0)

    def for_tree(self, tree: Tree) -> Segments:
        """Return the segments of another tree with the same joints, from the same states.

        Raises:
            ReferenceError: if they can't be solved.
        """
        samples, equations = self._samples, TreeEquations(replace(self._system, tree=tree))
        ratio = rate_of(equations, samples.start, samples.start_inputs) / self._rate
        fastest = samples.fastest * max(ratio, 1.0)
        length = samples.length / (ratio if ratio > MAX_RATE_RATIO else 1.0)
        if ratio <= MAX_RATE_RATIO:
            try:
                return self._near(equations, fastest)
            except ReferenceError:  # the tree is too different
                pass
        return solved(equations, samples.start, samples.start_inputs, length, fastest)

    def _near(self, equations: TreeEquations, fastest: float) -> Segments:
        samples = self._samples
        flow = self._flow.for_tree(equations.system.tree)
        end = samples.end + flow.apart(self._flow)
        rounded = rounding_of(equations, samples.start, samples.start_inputs, end, samples.length)
        bound = samples.bound + ERROR_FACTOR * self._off + rounded
        return replace(samples, end=end, bound=bound, fastest=fastest)
