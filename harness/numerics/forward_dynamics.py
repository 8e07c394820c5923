"""What an engine accelerates with, against the equations: evidence without a step.

Where an engine tells its accelerations, no limit has to be taken: at each state they are the
equations' to the last digits, or the model is another one. Pushed along each coordinate in turn it
tells its mass matrix too, and with it which of its forces are others: those of positions, those
that are even in the velocities (Coriolis'), those that are odd (dampers'), and those of the inputs.

What rounding does to a solution a of M a = f is bounded by |M^-1| (|M| |a| + |f|) last digits
(Higham 2002, Accuracy and Stability of Numerical Algorithms, 7.2); what is rounded alike on the way
to M and f is seen in companions (`harness.numerics.rounding`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, Model
from physics_crosscheck.harness.numerics.batch import floored
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.evenly import evenly
from physics_crosscheck.harness.numerics.judgement import Judgement, judge
from physics_crosscheck.harness.numerics.rounding import with_companions
from physics_crosscheck.harness.numerics.stepping import MARGIN, ROUNDED, is_linear
from physics_crosscheck.reference.solving.next_state import Stepped

TURNS = 5
"""How often velocities and inputs go round among the positions: five times the states."""

TAKEN_APART = 8
"""States at which forces are told apart."""

TERMS = (
    "mass matrix", "forces by position", "forces even in velocity", "forces odd in velocity",
    "forces of inputs",
)  # fmt: skip

EQUALITIES = "equalities"
"""A further term: where soft equalities put the positions that follow others."""


@dataclass(frozen=True, kw_only=True)
class ForwardDynamics:
    """How far an engine's accelerations are from the equations'.

    Attributes:
        judgement: of B states and nz coordinates, relative to the largest of each; where soft
            equalities are taken to hold exactly, nz positions follow, relative to their range.
        states: how many the engine told of.
        complete: whether it told of all that it was asked for.
        terms: by name, the largest difference in generalized forces, relative to the largest on
            the same coordinate; nan where the engine's mass matrix can't be inverted. That of
            `EQUALITIES` is in positions.
    """

    judgement: Judgement
    states: int
    complete: bool
    terms: dict[str, float]

    @property
    def holds_equalities(self) -> bool:
        """Whether soft equalities of the engine are taken to hold exactly."""
        return EQUALITIES in self.terms


def mixed(states: Array, inputs: Array) -> tuple[Array, Array]:
    """States (B, 2n) and inputs (B, m) with others' velocities and inputs: `TURNS` times as many.

    Positions remain those that are passed, so that no stop is met.
    """
    n, count = states.shape[1] // 2, len(states)
    turns = [round(k * count / TURNS) for k in range(TURNS)]
    return (
        np.concatenate([np.hstack([states[:, :n], np.roll(states[:, n:], k, 0)]) for k in turns]),
        np.concatenate([np.roll(inputs, 2 * k, axis=0) for k in turns]),
    )


def forward_dynamics(
    model: Model,
    coordinates: CoordinateMap,
    stepped: Stepped,
    states: Array,
    inputs: Array,
    resolution: float,
) -> ForwardDynamics | None:
    """Compare accelerations at states, and their terms.

    Args:
        model: as its engine has loaded it.
        coordinates: between the equations' coordinates and the engine's.
        stepped: the equations.
        states: q and rates, (B, 2n).
        inputs: of the equations, (B, inputs).
        resolution: that is asked of a difference, relative.

    Returns:
        None where the engine tells no accelerations, or its coordinates bend beside the equations'.
    """
    if not is_linear(coordinates, states):
        return None
    of = _Compared(model, coordinates, stepped)
    starts = with_companions(*coordinates.to_engine(states), model.epsilon)
    held = inputs[starts.rows] * starts.gain[:, None]
    with np.errstate(all="ignore"):
        took = model.accelerations(starts.z, starts.w, coordinates.pushes(starts.z, held))
    if took is None:
        return None
    told: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(took[: len(states)]), axis=1)
    if not told.any():
        return None
    expected, digit = of.expected(states, inputs)
    scale = floored(np.max(np.abs(expected[told]), axis=0))
    uncertainty = ROUNDED * model.epsilon * digit + MARGIN * starts.last_digits(took)
    defect = np.abs(took[: len(states)] - expected) / scale
    # What stands still has no rounding at all.
    uncertainty = np.where(uncertainty > 0, uncertainty / scale, model.epsilon)
    rows = np.flatnonzero(told)[evenly(int(told.sum()), TAKEN_APART)]
    terms = of.terms(states[rows], inputs[rows])
    gaps = of.equality_gaps(states)
    if gaps is not None:
        defect, uncertainty = np.hstack([defect, gaps[0]]), np.hstack([uncertainty, gaps[1]])
        terms[EQUALITIES] = float(np.max(gaps[0]))
    found = judge(defect[told], uncertainty[told], resolution, None)
    return ForwardDynamics(
        judgement=replace(found, segment=int(np.flatnonzero(told)[found.segment])),
        states=int(told.sum()),
        complete=bool(told.all()),
        terms=terms,
    )


@dataclass(frozen=True)
class _Compared:
    """A model and the equations, where engine coordinates are linear in the system's."""

    model: Model
    coordinates: CoordinateMap
    stepped: Stepped

    @property
    def _n(self) -> int:
        return self.coordinates.back.size

    @cached_property
    def _there(self) -> Array:
        """dz/dq, (nz, n)."""
        found: Array = self.coordinates.forward_slope(np.zeros((1, self._n)))
        return found.reshape(-1, self._n)

    def expected(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Engine coordinates' accelerations by the equations, and what a last digit does to them.

        Each (B, nz).
        """
        q, m = self._halves(states)
        mass, force = self.stepped.mass(q), self.stepped.force(q, m, inputs)
        inverse = np.linalg.inv(mass)
        a = np.linalg.solve(mass, force[:, :, None])[:, :, 0]
        size = np.einsum("bij,bj->bi", np.abs(mass), np.abs(a)) + np.abs(force)
        lost = np.einsum("bij,bj->bi", np.abs(inverse), size)
        return a @ self._there.T, lost @ np.abs(self._there).T

    def equality_gaps(self, states: Array) -> tuple[Array, Array] | None:
        """How far positions are from where the engine's equalities put them, and the rounding.

        Each (B, nz), relative to the range of each; None where it holds none.
        """
        z, w = self.coordinates.to_engine(states)
        gaps = self.model.equality_errors(z)
        if gaps is None:
            return None
        n, epsilon = z.shape[1], self.model.epsilon
        # An equality counts from where the file draws its joints, and a map from zero.
        size = np.maximum(np.abs(z), np.abs(self.model.home))
        digit = epsilon * self.coordinates.residual_rounding_scale(size, w)[:n]
        scale = floored(np.ptp(z, axis=0))
        uncertainty = np.maximum(ROUNDED * digit / scale, epsilon)
        return np.abs(gaps) / scale, np.broadcast_to(uncertainty, gaps.shape)

    def _halves(self, states: Array) -> tuple[Array, Array]:
        """Positions and the velocities that a step keeps."""
        q, rates = states[:, : self._n], states[:, self._n :]
        return q, self.stepped.velocities(q, rates)

    def _own(self, states: Array, inputs: Array, push: Array) -> Array:
        """The engine's accelerations of the coordinates q, (B, n), pushed along them besides."""
        z, w = self.coordinates.to_engine(states)
        slope = self.coordinates.back_slope(z).reshape(len(z), self._n, -1)
        pushed = np.einsum("bnz,bn->bz", slope, push) + self.coordinates.pushes(z, inputs)
        found = self.model.accelerations(z, w, pushed)
        assert found is not None  # it has told some
        own: Array = np.einsum("bnz,bz->bn", slope, found)
        return own

    def terms(self, states: Array, inputs: Array) -> dict[str, float]:
        """The largest difference of each, relative to the largest force on its coordinate."""
        with np.errstate(all="ignore"):
            own, wanted = self._engine(states, inputs), self._equations(states, inputs)
        scale = floored(np.max([np.max(np.abs(one), axis=0) for one in wanted], axis=0))
        return {
            name: float(np.max(np.abs(a - b) / scale))
            for name, a, b in zip(TERMS, own, wanted, strict=True)
        }

    def _equations(self, states: Array, inputs: Array) -> list[Array]:
        """M a and the forces by term, (B, n) each."""
        q, m = self._halves(states)
        none = np.zeros_like(inputs)
        mass, at = self.stepped.mass(q), self.stepped.force
        still, ahead, astern = (at(q, speed, none) for speed in (0 * m, m, -m))
        driven = at(q, m, inputs)
        a = np.linalg.solve(mass, driven[:, :, None])
        return [(mass @ a)[:, :, 0], *_parts(still, ahead, astern, driven)]

    def _engine(self, states: Array, inputs: Array) -> list[Array]:
        """The same by the engine's mass matrix, which its answers to pushes tell."""
        n, count = self._n, len(states)
        q, m = self._halves(states)
        speeds = (np.hstack([q, self.stepped.rates(q, speed)]) for speed in (0 * m, m, -m))
        none, still = np.zeros_like(inputs), np.zeros((count, n))
        free = [self._own(one, none, still) for one in speeds]
        driven = self._own(states, inputs, still)
        mass = self.stepped.mass(q)
        # As large as what it does against the inertia there is.
        sizes = np.maximum(np.max(np.abs(driven), axis=1, keepdims=True), 1.0) * np.einsum(
            "bii->bi", mass
        )
        answers = []
        for i in range(n):
            push = sizes * np.eye(n)[i]
            both = (self._own(states, none, sign * push) for sign in (1, -1))
            answers.append((next(both) - next(both)) / (2 * sizes[:, i : i + 1]))
        own = np.linalg.inv(np.stack(answers, axis=2))
        a = np.linalg.solve(mass, self.stepped.force(q, m, inputs)[:, :, None])
        rest, ahead, astern, pushed = (np.einsum("bij,bj->bi", own, one) for one in (*free, driven))
        return [(own @ a)[:, :, 0], *_parts(rest, ahead, astern, pushed)]


def _parts(still: Array, ahead: Array, astern: Array, driven: Array) -> list[Array]:
    """Forces by what they depend on, from those at rest, moving both ways, and driven."""
    return [still, (ahead + astern) / 2 - still, (ahead - astern) / 2, driven - ahead]
