"""Measured terms of two models' equations: inertia, forces at rest and in motion.

Only accelerations at given states are used, as limits of a few tiny steps, with and without a
known force on each coordinate.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineError, LoadedModel
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.numerics.accelerations import Accelerations, Estimate, force_of
from physics_crosscheck.harness.numerics.coordinates import identity
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedTerm
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.solving.segments import even_indices
from .candidate import Candidate, ask
from .judge import Recorded
from .match import Match, halves
from .prepared import PreparedComparison
from .segments import reversed_segments
from .side import apart, percent
from .states import SampledStates, free_directions

SPEEDS = (0.3, 0.6)
"""Speeds at which resisting forces are measured, in units of motion size times rate."""

BASES = 2
"""Number of states at which resisting forces are measured."""

MORE_STATES = 6
"""States at which terms are measured, beyond the number of independent coordinates."""


@dataclass(frozen=True, kw_only=True)
class Mechanics:
    """Measured terms at N states, for r independent coordinates of the comparison.

    Attributes:
        rank: number of independently moving coordinates.
        mass: (N, r, r).
        rest: generalized forces at rest, (N, r).
        unweighted: the same without gravity; None if gravity cannot be set.
        odd: half the difference of the forces at opposite velocities of one coordinate at
            `SPEEDS`, at the first `BASES` states, (bases, speeds, r, r); the last but one index is
            that of the moving coordinate.
    """

    rank: int
    mass: Estimate
    rest: Estimate
    unweighted: Estimate | None
    odd: Estimate


def mechanics(
    candidate: Candidate, match: Match | None, signs: Array, start: Array, states: SampledStates
) -> Mechanics:
    """Measure one model.

    Args:
        candidate: the model.
        match: conversion of its own coordinates to those of the comparison; None: they are equal,
            except for `signs`.
        signs: -1 for each reversed coordinate, (m,).
        start: N states, in its own coordinates, (N, 2nz).
        states: that the comparison sampled, for the scales of the motions.

    Raises:
        EngineError: with file, place and remedy.
    """
    model = candidate.load()
    lens = _Lens(model, match, signs, start, states)
    z, w = halves(start)
    still, every = np.hstack([z, 0 * w]), range(len(z))
    rest, odd = lens.forces(model, still, every), lens.odd(model)
    unweighted = None
    try:
        # Measure this last: in some engines loading another model unloads this one.
        model = candidate.with_settings(gravity=[0.0, 0.0, 0.0]).load()
        unweighted = lens.forces(model, still, every)
    except EngineError:
        pass
    return Mechanics(rank=lens.rank, mass=lens.mass, rest=rest, unweighted=unweighted, odd=odd)


class _Lens:
    """A model in the coordinates of the comparison."""

    def __init__(
        self,
        model: LoadedModel,
        match: Match | None,
        signs: Array,
        start: Array,
        states: SampledStates,
    ) -> None:
        self.start, self.states = start, states
        (z, _), typical = halves(start), states.typical
        n = z.shape[1]
        extent = model.sampling_range
        size = (extent[:, 1] - extent[:, 0]) / 2
        self.speed = size * typical
        accelerations = self._accelerations(model)
        ease = np.diagonal(accelerations.inverse_mass(start[:1], np.ones(n))[0])
        largest = float(np.max(ease)) or 1.0  # no joint moves if a motor holds them all
        inverse = accelerations.inverse_mass(
            start, size * typical**2 / np.where(ease > 0, ease, largest)
        )
        plain = np.tile(np.diag(signs[:n]), (len(z), 1, 1))
        slopes = plain if match is None else match.slopes(z)
        compared = slopes @ inverse @ slopes.swapaxes(1, 2)
        self.rank = max(free_directions(one).shape[1] for one in compared)
        picked = list(states.independent)
        self.slopes = slopes[:, picked]
        ease = np.diagonal(compared[0])[picked]
        sizes = states.unit[picked] * typical**2 / np.where(ease > 0, ease, largest)
        self.mass, _ = accelerations.mechanics(start, sizes, self.slopes)
        # The velocities at which one independent coordinate alone moves.
        self.along = inverse @ self.slopes.swapaxes(1, 2) @ self.mass.value

    def _accelerations(self, model: LoadedModel) -> Accelerations:
        size, fastest = len(self.speed), self.states.fastest
        return Accelerations(
            model=model, coordinates=identity(size), speed=self.speed, fastest=fastest
        )

    def forces(self, model: LoadedModel, states: Array, indices: Sequence[int]) -> Estimate:
        """Return mass times acceleration (B, r), with the mass of the states numbered `indices`."""
        zero, rows = np.zeros((len(states), len(self.speed))), list(indices)
        measured = self._accelerations(model).measure(states, zero[:, :0], zero)
        slopes = self.slopes[rows]
        with np.errstate(invalid="ignore"):
            seen = np.einsum("bij,bj->bi", slopes, measured.value)
            error = np.einsum("bij,bj->bi", np.abs(slopes), measured.uncertainty)
        mass = Estimate(value=self.mass.value[rows], uncertainty=self.mass.uncertainty[rows])
        return force_of(mass, Estimate(value=seen, uncertainty=error))

    def odd(self, model: LoadedModel) -> Estimate:
        """Return `Mechanics.odd`; the curvature of the coordinates is even and cancels."""
        states, (z, _) = self.states, halves(self.start)
        bases = min(BASES, len(z))
        picked = list(states.independent)
        speed, r = states.unit[picked] * states.typical, len(picked)
        rows = [
            (base, sign * share * speed[j] * self.along[base, :, j])
            for base in range(bases)
            for share in SPEEDS
            for sign in (1.0, -1.0)
            for j in range(r)
        ]
        indices = [base for base, _ in rows]
        moving = np.hstack([z[indices], np.array([w for _, w in rows])])
        forces = self.forces(model, moving, indices)
        value, error = (
            one.reshape(bases, len(SPEEDS), 2, r, r) for one in (forces.value, forces.uncertainty)
        )
        return Estimate(
            value=(value[:, :, 0] - value[:, :, 1]) / 2,
            uncertainty=(error[:, :, 0] + error[:, :, 1]) / 2,
        )


def measured_terms(
    executor: Executor, prepared: PreparedComparison, recorded: Recorded, signs: Array
) -> tuple[ComparedTerm, ...]:
    """Return the terms that differ by more than their uncertainty, worst first.

    Args:
        executor: runs the engines.
        prepared: both models.
        recorded: runs of the source, from some of whose states terms are measured.
        signs: -1 for each reversed coordinate of the target, (m,).
    """
    states, match = recorded.states, prepared.match
    z, w = halves(recorded.compared.start)
    (going,) = np.nonzero(w.any(axis=1))
    if not len(going):
        return ()
    chosen = list(states.independent)
    picked = going[even_indices(len(going), len(chosen) + MORE_STATES)]
    source, target = prepared.source_first(prepared.models)
    runs = reversed_segments(recorded.compared.pick(picked), signs)
    rows = (
        (source, match, np.ones(len(signs)), recorded.runs.pick(picked).start),
        (target, None, signs, runs.start),
    )
    measured = [
        ask(
            executor,
            model,
            partial(mechanics, match=of_model, signs=turns, start=start, states=states),
            model,
        )
        for model, of_model, turns, start in rows
    ]
    a, b = prepared.source_first((measured[0], measured[1]))
    if a.rank != b.rank:
        return (_constraint(a.rank, b.rank),)
    comparison = _Pair(a, b, [match.names[i] for i in chosen], z[picked][:, chosen], states)
    every = [*comparison.inertia(), *comparison.resistance()]
    if any(term.kind == "friction" for term in every):
        pass  # at rest it balances any force, so that springs are unknown
    elif a.unweighted is not None and b.unweighted is not None:
        every += comparison.springs(a.unweighted, b.unweighted, "spring")
        every += comparison.pointwise(
            _less(a.rest, a.unweighted), _less(b.rest, b.unweighted), "gravity"
        )
    else:
        every += comparison.springs(a.rest, b.rest, "force")
    # Round to six digits, so that last digits do not change the order of like legs.
    sizes = [np.inf if term.effect is None else float(f"{term.effect:.5e}") for term in every]
    return tuple(every[i] for i in sorted(range(len(every)), key=lambda i: -sizes[i]))


def _constraint(rank_a: int, rank_b: int) -> ComparedTerm:
    more, less = ("A", "B") if rank_a > rank_b else ("B", "A")
    larger, smaller = max(rank_a, rank_b), min(rank_a, rank_b)
    joints = counted(larger, "joint")
    message = (
        f"{joints} can move independently in {more}, {smaller} in {less}. {less} has a constraint"
        f" that {more} lacks"
    )
    if smaller == 0:
        message = (
            f"no joint of {less} moves under a force; {joints} of {more} can. A motor or a"
            " constraint holds them, or they have no inertia"
        )
    return ComparedTerm(
        kind="constraint", joints=(), message=message, a=number(rank_a), b=number(rank_b),
        uncertainty=0.0, effect=1.0,
    )  # fmt: skip


def _less(total: Estimate, part: Estimate) -> Estimate:
    return Estimate(
        value=total.value - part.value, uncertainty=total.uncertainty + part.uncertainty
    )


class _Pair:
    """Measurements of two models, for r joints at N states."""

    def __init__(
        self, a: Mechanics, b: Mechanics, names: Sequence[str], places: Array, states: SampledStates
    ) -> None:
        self.a, self.b, self.names, self.places = a, b, names, places
        self.unit, self.typical = states.unit[list(states.independent)], states.typical
        inertia = np.max(np.abs(np.diagonal(a.mass.value, axis1=1, axis2=2)), axis=0, initial=0.0)
        self.forces = np.maximum(np.nan_to_num(inertia), 1e-300) * self.unit * self.typical**2

    def _between(self, what: str, i: int, j: int, single: str = "") -> tuple[tuple[str, ...], str]:
        """Return the joints of an entry of a matrix, and its name."""
        names = self.names
        if i == j:
            return (names[i],), f"{single or what} of {names[i]}"
        separator = "of" if single else "between"
        return (names[i], names[j]), f"{what} {separator} {names[i]} and {names[j]}"

    def inertia(self) -> Iterator[ComparedTerm]:
        """Yield differing entries of the mass matrix."""
        a, b = self.a.mass, self.b.mass
        error = _doubt(a, b)
        for i in range(len(self.names)):
            for j in range(i + 1):
                state = _worst(a.value[:, i, j] - b.value[:, i, j], error[:, i, j])
                if state is None:
                    continue
                here, there = float(a.value[state, i, j]), float(b.value[state, i, j])
                varies = float(np.ptp(a.value[:, i, j])) > 10 * float(np.max(error[:, i, j]))
                yield self._term(
                    "inertia",
                    *self._between("inertial coupling", j, i, "inertia"),
                    (here, there, float(error[state, i, j])),
                    abs(here - there) * self.unit[j] * self.typical**2 / self.forces[i],
                    state if varies else None,
                )

    def resistance(self) -> Iterator[ComparedTerm]:
        """Yield differences of damping, and of other forces that depend on the velocity."""
        a, b, error = self.a.odd.value, self.b.odd.value, _doubt(self.a.odd, self.b.odd)
        differing = np.abs(a - b) > error
        for i, name in enumerate(self.names):
            for j in range(len(self.names)):
                # At the higher speed, for which the value is reported.
                miss = a[..., j, i] - b[..., j, i]
                base = _worst(miss[:, 1], error[:, 1, j, i])
                if base is None:
                    continue
                doubts, ratio = error[base, :, j, i], SPEEDS[1] / SPEEDS[0]
                here, there = float(-a[base, 1, j, i]), float(-b[base, 1, j, i])
                effect = abs(here - there) / self.forces[i]
                speed = SPEEDS[1] * self.unit[j] * self.typical
                if abs(miss[base] @ (-ratio, 1.0)) > doubts @ (ratio, 1.0):
                    what, suffix = f"friction on {name}", ", whatever its speed"
                    if abs(miss[base, 1] - miss[base, 0]) > doubts.sum():
                        what = f"force on {name} that depends on the velocity, not linearly"
                        suffix = f" at {self.names[j]}_dot = {speed:.3g}"
                    values = here, there, float(doubts[1])
                    yield self._term("friction", (name,), what, values, effect, None, suffix)
                elif j >= i or not differing[..., i, j].any():  # else reported as (j, i)
                    values = here / speed, there / speed, float(doubts[1]) / speed
                    varies = np.ptp(a[:, 1, j, i]) > 10 * np.max(error[:, 1, j, i])
                    subject = self._between("damping", i, j)
                    yield self._term("damping", *subject, values, effect, base if varies else None)

    def springs(self, a: Estimate, b: Estimate, kind: str) -> Iterator[ComparedTerm]:
        """Yield differences of stiffness if forces are linear in the positions, else of forces."""
        count, r = self.places.shape
        design = np.hstack([self.places / self.unit, np.ones((count, 1))])
        back, error = np.linalg.pinv(design), _doubt(a, b)
        if not np.isfinite(error).all() or not (np.abs(a.value - b.value) > error).any():
            yield from self.pointwise(a, b, kind)
            return
        fits = [back @ m.value for m in (a, b)]
        residuals = [np.abs(m.value - design @ fit) for m, fit in zip((a, b), fits, strict=True)]
        allowed = 3 * error + 1e-9 * np.abs(a.value)
        linear = np.all([(one <= allowed).all(axis=0) for one in residuals], 0)
        doubt, miss = np.abs(back) @ error, np.abs(fits[0] - fits[1])
        for i, name in enumerate(self.names):
            if not linear[i] or count <= r + 1:
                yield from self.pointwise(a, b, kind, only=i)
                continue
            for j in range(r):
                if miss[j, i] <= doubt[j, i] or (j < i and miss[i, j] > doubt[i, j]):
                    continue  # it does not differ, or is reported as (j, i)
                values = *(-float(fit[j, i]) / self.unit[j] for fit in fits), doubt[j, i]
                here, there, limit = values[0], values[1], float(values[2]) / self.unit[j]
                effect = abs(here - there) * self.unit[j] / self.forces[i]
                subject = self._between("stiffness", i, j)
                yield self._term("stiffness", *subject, (here, there, limit), effect, None)
            if miss[r, i] > doubt[r, i]:
                here, there = (float(fit[r, i]) for fit in fits)
                what = f"{kind} force on {name} with every joint at zero"
                effect = abs(here - there) / self.forces[i]
                yield self._term(
                    kind, (name,), what, (here, there, float(doubt[r, i])), effect, None
                )

    def pointwise(
        self, a: Estimate, b: Estimate, kind: str, only: int | None = None
    ) -> Iterator[ComparedTerm]:
        """Yield differing forces, at the state with the largest difference."""
        error = _doubt(a, b)
        for i, name in enumerate(self.names):
            state = _worst(a.value[:, i] - b.value[:, i], error[:, i])
            if state is None or only not in (None, i):
                continue
            here, there = float(a.value[state, i]), float(b.value[state, i])
            what = f"{'force at rest' if kind == 'force' else kind + ' force'} on {name}"
            values = here, there, float(error[state, i])
            effect = abs(here - there) / self.forces[i]
            yield self._term(kind, (name,), what, values, effect, state)

    def _term(
        self,
        kind: str,
        joints: tuple[str, ...],
        name: str,
        values: tuple[float, float, float],
        effect: float,
        state: int | None,
        suffix: str = "",
    ) -> ComparedTerm:
        here, there, doubt = values
        shown = apart(here, there, doubt)
        certain = abs(here) > doubt and abs(there) > doubt
        share = f" ({percent((there - here) / here)})" if certain else ""
        message = f"{name}: {shown[0]} in A, {shown[1]} in B{share}"
        if state is not None:
            place = zip(self.names, self.places[state], strict=True)
            message += " at " + ", ".join(f"{n} = {value:.3g}" for n, value in list(place)[:4])
        return ComparedTerm(
            kind=kind,
            joints=joints,
            message=message + suffix,
            a=number(here),
            b=number(there),
            uncertainty=number(doubt),
            effect=number(effect),
        )


def _doubt(a: Estimate, b: Estimate) -> Array:
    doubt: Array = a.uncertainty + b.uncertainty + 64 * EPSILON * np.abs(a.value)
    return doubt


def _worst(miss: Array, error: Array) -> int | None:
    with np.errstate(invalid="ignore"):
        certain = np.abs(miss) > error
    if not certain.any():
        return None
    return int(np.argmax(np.where(certain, np.abs(miss), -1.0)))
