"""Comparison of an engine's accelerations with the equations, without taking a step.

If an engine returns its accelerations, no limit is needed. At each state they must equal those of
the equations to the last digits; otherwise the model differs. Forces on each coordinate in turn
yield the mass matrix. It shows which forces differ: forces of positions, forces even in the
velocities (Coriolis), forces odd in the velocities (dampers), or forces of inputs.

The rounding of a solution a of M a = f is bounded by |M^-1| (|M| |a| + |f|) last digits (Higham
2002, Accuracy and Stability of Numerical Algorithms, 7.2). Companions reveal rounding that M and f
share (`harness.numerics.rounding`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, LoadedModel
from physics_crosscheck.harness.records.outcome import COARSEST, Outcome
from physics_crosscheck.reference.solving.next_state import Stepped
from physics_crosscheck.reference.solving.segments import even_indices
from .coordinates import CoordinateMap
from .judgement import LimitVerdict, excess, judge
from .ladder import EPSILON, floored
from .rounding import with_companions
from .stepping import ROUNDED_DIGITS, ROUNDING_MARGIN, is_linear

STATE_COMBINATIONS = 5
"""Number of combinations of each position with velocities and inputs of other states."""

FORCE_STATES = 8
"""Number of states at which forces are separated by kind."""

FORCE_KINDS = (
    "mass matrix", "forces by position", "forces even in velocity", "forces odd in velocity",
    "forces of inputs",
)  # fmt: skip

EQUALITIES = "equalities"
"""A further term: errors of the positions that soft equalities determine."""


@dataclass(frozen=True, kw_only=True)
class AccelerationComparison:
    """Difference of an engine's accelerations from the equations'.

    Attributes:
        judgement: verdict for B states and nz coordinates, relative to the largest value of each.
            If soft equalities are assumed exact, nz positions follow, relative to their range.
        states: number of states at which the engine returned accelerations.
        complete: whether it returned them at all states.
        force_errors: largest difference in generalized forces by name, relative to the largest
            force on the same coordinate; nan if the engine's mass matrix is singular.
            `EQUALITIES` is in positions.
        excess: by how much the differing coordinate accelerates too fast, see `judgement.excess`.
    """

    judgement: LimitVerdict
    states: int
    complete: bool
    force_errors: dict[str, float]
    excess: float = float("nan")

    @property
    def holds_equalities(self) -> bool:
        """True if soft equalities of the engine are assumed exact."""
        return EQUALITIES in self.force_errors


def mixed(states: Array, inputs: Array) -> tuple[Array, Array]:
    """Return states (B, 2n) and inputs (B, m) in `STATE_COMBINATIONS` combinations with other rows.

    Velocities and inputs are combined with positions of the motion, so that no joint limit is
    reached.
    """
    n, count = states.shape[1] // 2, len(states)
    turns = [round(k * count / STATE_COMBINATIONS) for k in range(STATE_COMBINATIONS)]
    return (
        np.concatenate([np.hstack([states[:, :n], np.roll(states[:, n:], k, 0)]) for k in turns]),
        np.concatenate([np.roll(inputs, 2 * k, axis=0) for k in turns]),
    )


def forward_dynamics(
    model: LoadedModel,
    coordinates: CoordinateMap,
    stepped: Stepped,
    states: Array,
    inputs: Array,
    resolution: float,
) -> AccelerationComparison | None:
    """Compare accelerations at states, and their terms.

    Args:
        model: loaded model.
        coordinates: map between the equations' coordinates and the engine's.
        stepped: the equations.
        states: q and rates, (B, 2n).
        inputs: inputs of the equations, (B, inputs).
        resolution: smallest relative difference that counts.

    Returns:
        None if the engine returns no accelerations, or its coordinates are nonlinear in the
        equations'.
    """
    if not is_linear(coordinates, states):
        return None
    compared = _Compared(model, coordinates, stepped)
    starts = with_companions(*coordinates.to_engine(states), model.epsilon)
    held = inputs[starts.rows] * starts.gain[:, None]
    with np.errstate(all="ignore"):
        took = model.accelerations(starts.z, starts.w, coordinates.pushes(starts.z, held))
    if took is None:
        return None
    returned: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(took[: len(states)]), axis=1)
    if not returned.any():
        return None
    expected, digit = compared.expected(states, inputs)
    scale = floored(np.max(np.abs(expected[returned]), axis=0))
    uncertainty = ROUNDED_DIGITS * model.epsilon * digit + ROUNDING_MARGIN * starts.last_digits(
        took
    )
    defect = np.abs(took[: len(states)] - expected) / scale
    # A fixed coordinate has no rounding at all.
    uncertainty = np.where(uncertainty > 0, uncertainty / scale, model.epsilon)
    rows = np.flatnonzero(returned)[even_indices(int(returned.sum()), FORCE_STATES)]
    force_errors = compared.force_errors(states[rows], inputs[rows])
    gaps = compared.equality_gaps(states)
    if gaps is not None:
        defect, uncertainty = np.hstack([defect, gaps[0]]), np.hstack([uncertainty, gaps[1]])
        force_errors[EQUALITIES] = float(np.max(gaps[0]))
    if model.epsilon > EPSILON:  # what the engine's numbers allow
        resolution = max(resolution, min(COARSEST, float(uncertainty[returned].max())))
    verdict = judge(defect[returned], uncertainty[returned], resolution, None)
    column = verdict.component
    ratio = float("nan")
    if column < took.shape[1] and verdict.outcome is Outcome.DIFFERS:
        with np.errstate(all="ignore"):
            ratio = excess(took[: len(states)][returned, column], expected[returned, column])
    return AccelerationComparison(
        judgement=replace(verdict, segment=int(np.flatnonzero(returned)[verdict.segment])),
        states=int(returned.sum()),
        complete=bool(returned.all()),
        force_errors=force_errors,
        excess=ratio,
    )


@dataclass(frozen=True)
class _Compared:
    """A model and its equations, for engine coordinates that are linear in the system's."""

    model: LoadedModel
    coordinates: CoordinateMap
    stepped: Stepped

    @property
    def _n(self) -> int:
        return self.coordinates.back.size

    @cached_property
    def _there(self) -> Array:
        slope: Array = self.coordinates.forward_slope(np.zeros((1, self._n)))
        return slope.reshape(-1, self._n)

    def expected(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return the equations' accelerations of z, and the effect of a last digit on them.

        Each is (B, nz).
        """
        q, m = self._halves(states)
        mass, force = self.stepped.mass(q), self.stepped.force(q, m, inputs)
        inverse = np.linalg.inv(mass)
        a = np.linalg.solve(mass, force[:, :, None])[:, :, 0]
        size = np.einsum("bij,bj->bi", np.abs(mass), np.abs(a)) + np.abs(force)
        lost = np.einsum("bij,bj->bi", np.abs(inverse), size)
        return a @ self._there.T, lost @ np.abs(self._there).T

    def equality_gaps(self, states: Array) -> tuple[Array, Array] | None:
        """Return the position errors of the engine's equalities, and their rounding.

        Each is (B, nz), relative to the range of each position; None without equalities.
        """
        z, w = self.coordinates.to_engine(states)
        gaps = self.model.equality_errors(z)
        if gaps is None:
            return None
        n, epsilon = z.shape[1], self.model.epsilon
        # An equality is relative to the joint positions of the file, a map to zero.
        size = np.maximum(np.abs(z), np.abs(self.model.home))
        digit = epsilon * self.coordinates.residual_rounding_scale(size, w)[:n]
        scale = floored(np.ptp(z, axis=0))
        uncertainty = np.maximum(ROUNDED_DIGITS * digit / scale, epsilon)
        return np.abs(gaps) / scale, np.broadcast_to(uncertainty, gaps.shape)

    def _halves(self, states: Array) -> tuple[Array, Array]:
        q, rates = states[:, : self._n], states[:, self._n :]
        return q, self.stepped.velocities(q, rates)

    def _accelerations(self, states: Array, inputs: Array, push: Array) -> Array:
        z, w = self.coordinates.to_engine(states)
        slope = self.coordinates.back_slope(z).reshape(len(z), self._n, -1)
        pushed = np.einsum("bnz,bn->bz", slope, push) + self.coordinates.pushes(z, inputs)
        accelerations = self.model.accelerations(z, w, pushed)
        assert accelerations is not None  # it returned some accelerations before
        result: Array = np.einsum("bnz,bz->bn", slope, accelerations)
        return result

    def force_errors(self, states: Array, inputs: Array) -> dict[str, float]:
        """Return the largest difference of each term, relative to the largest force."""
        with np.errstate(all="ignore"):
            engine, wanted = self._engine(states, inputs), self._equations(states, inputs)
        scale = floored(np.max([np.max(np.abs(one), axis=0) for one in wanted], axis=0))
        return {
            name: float(np.max(np.abs(a - b) / scale))
            for name, a, b in zip(FORCE_KINDS, engine, wanted, strict=True)
        }

    def _equations(self, states: Array, inputs: Array) -> list[Array]:
        q, m = self._halves(states)
        none = np.zeros_like(inputs)
        mass, force = self.stepped.mass(q), self.stepped.force
        still, forward, backward = (force(q, speed, none) for speed in (0 * m, m, -m))
        driven = force(q, m, inputs)
        a = np.linalg.solve(mass, driven[:, :, None])
        return [(mass @ a)[:, :, 0], *_parts(still, forward, backward, driven)]

    def _engine(self, states: Array, inputs: Array) -> list[Array]:
        """Return M a and the forces by kind, from the engine's responses to forces."""
        n, count = self._n, len(states)
        q, m = self._halves(states)
        speeds = (np.hstack([q, self.stepped.rates(q, speed)]) for speed in (0 * m, m, -m))
        none, still = np.zeros_like(inputs), np.zeros((count, n))
        free = [self._accelerations(one, none, still) for one in speeds]
        driven = self._accelerations(states, inputs, still)
        mass = self.stepped.mass(q)
        # A force large enough to compare with the inertial forces.
        sizes = np.maximum(np.max(np.abs(driven), axis=1, keepdims=True), 1.0) * np.einsum(
            "bii->bi", mass
        )
        answers = []
        for i in range(n):
            push = sizes * np.eye(n)[i]
            both = (self._accelerations(states, none, sign * push) for sign in (1, -1))
            answers.append((next(both) - next(both)) / (2 * sizes[:, i : i + 1]))
        mass_matrix = np.linalg.inv(np.stack(answers, axis=2))
        a = np.linalg.solve(mass, self.stepped.force(q, m, inputs)[:, :, None])
        rest, forward, backward, pushed = (
            np.einsum("bij,bj->bi", mass_matrix, one) for one in (*free, driven)
        )
        return [(mass_matrix @ a)[:, :, 0], *_parts(rest, forward, backward, pushed)]


def _parts(still: Array, forward: Array, backward: Array, driven: Array) -> list[Array]:
    """Separate forces at rest, moving both ways, and with inputs by what they depend on."""
    return [still, (forward + backward) / 2 - still, (forward - backward) / 2, driven - forward]
