"""Measured terms of two models' equations: inertia, forces at rest and in motion.

Only accelerations at given states are used, as limits of a few tiny steps, with and without a
known force on each coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.candidate import Candidate
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.property import apart, percent
from physics_crosscheck.harness.compare.scales import free_directions, inverse_mass
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Model
from physics_crosscheck.harness.numerics.accelerations import Accelerations, Estimate
from physics_crosscheck.harness.numerics.coordinates import identity
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedTerm
from physics_crosscheck.harness.results.status import counted

SPEEDS = (0.3, 0.6)
"""Speeds at which resisting forces are measured, in units of motion size times rate."""

WINDOWS = (1.0, 2.0, 4.0, 8.0)
"""Divisors of the time window of an acceleration.

Long windows have little rounding error, short ones little of every other error. The difference
between the two most accurate values adds to the uncertainty.
"""

BASES = 2
"""Number of states at which resisting forces are measured."""


@dataclass(frozen=True, kw_only=True)
class MechanicsTask:
    """Input of a worker that measures one model.

    Attributes:
        match: conversion of its own coordinates to those of the comparison; None: they are equal,
            except for `signs`.
        signs: -1 for each reversed coordinate, (m,).
        z, w: states, in its own coordinates, (N, nz) each.
        independent: coordinates of the comparison that determine the others.
        unit: size of the motions in the coordinates of the comparison, (m,).
        fastest, typical: rates of the motions, rad/s.
    """

    candidate: Candidate
    match: Match | None
    signs: Array
    z: Array
    w: Array
    independent: tuple[int, ...]
    unit: Array
    fastest: float
    typical: float


@dataclass(frozen=True, kw_only=True)
class Mechanics:
    """Measured terms at N states, for r independent coordinates of the comparison.

    Attributes:
        rank: number of independently moving coordinates, (N,).
        mass: (N, r, r).
        rest: generalized forces at rest, (N, r).
        unweighted: the same without gravity; None if gravity cannot be set.
        odd: half the difference of the forces at opposite velocities of one coordinate at
            `SPEEDS`, at the first `BASES` states, (bases, speeds, r, r); the last but one index is
            that of the moving coordinate.
    """

    rank: tuple[int, ...]
    mass: Estimate
    rest: Estimate
    unweighted: Estimate | None
    odd: Estimate


def mechanics(task: MechanicsTask) -> Mechanics:
    """Measure one model.

    Raises:
        EngineError: with file, place and remedy.
    """
    model = task.candidate.load()
    lens = _Lens(task, model)
    mass = lens.mass
    rest = lens.forces(model, task.z, np.zeros_like(task.w), range(len(task.z)))
    odd = lens.odd(model)
    rank = tuple(free_directions(one).shape[1] for one in lens.compared)
    # Measure this last: in some engines loading another model unloads this one.
    return Mechanics(rank=rank, mass=mass, rest=rest, unweighted=_unweighted(task, lens), odd=odd)


def _unweighted(task: MechanicsTask, lens: _Lens) -> Estimate | None:
    """Return forces at rest without gravity, for engines whose gravity can be set."""
    try:
        model = task.candidate.with_settings(gravity=[0.0, 0.0, 0.0]).load()
    except EngineError:
        return None
    return lens.forces(model, task.z, np.zeros_like(task.w), range(len(task.z)))


class _Lens:
    """A model in the coordinates of the comparison."""

    def __init__(self, task: MechanicsTask, model: Model) -> None:
        self.task = task
        extent = model.sampling_range
        self.size = (extent[:, 1] - extent[:, 0]) / 2
        self.speed = self.size * task.typical
        n, picked = task.z.shape[1], list(task.independent)
        full = np.tile(np.diag(task.signs[:n]), (len(task.z), 1, 1))
        slopes = full if task.match is None else task.match.slopes(task.z)
        self.slopes = slopes[:, picked]
        rough = inverse_mass(self._accelerations(model), task.z[:1], task.w[:1], np.ones(n)).value[
            0
        ]
        ease = np.diagonal(rough)
        largest = float(np.max(ease)) or 1.0  # no joint moves if a motor holds them all
        sizes = self.size * task.typical**2 / np.where(ease > 0, ease, largest)
        inverse = self._agreed(
            [inverse_mass(self._accelerations(model, by), task.z, task.w, sizes) for by in WINDOWS]
        )
        self.inverse = inverse.value
        self.compared = slopes @ inverse.value @ slopes.swapaxes(1, 2)
        reduced = self.slopes @ inverse.value @ self.slopes.swapaxes(1, 2)
        error = np.abs(self.slopes) @ inverse.uncertainty @ np.abs(self.slopes).swapaxes(1, 2)
        mass, mass_error = np.full_like(reduced, np.nan), np.full_like(reduced, np.inf)
        for k, matrix in enumerate(reduced):
            if np.isfinite(matrix).all() and np.linalg.cond(matrix) < 1e12:
                mass[k] = np.linalg.inv(matrix)
                mass_error[k] = _nan_to_inf(np.abs(mass[k]) @ error[k] @ np.abs(mass[k]))
        self.mass = Estimate(value=mass, uncertainty=mass_error)

    def _accelerations(self, model: Model, by: float = 1.0) -> Accelerations:
        return Accelerations(
            model=model,
            coordinates=identity(len(self.size)),
            speed=self.speed,
            fastest=by * self.task.fastest,
        )

    @staticmethod
    def _agreed(estimates: list[Estimate]) -> Estimate:
        """Return the most accurate values, and their distance from the next best as uncertainty."""
        value, error = (
            np.stack([getattr(one, key) for one in estimates]) for key in ("value", "uncertainty")
        )
        order = np.argsort(error, axis=0)[:2]
        best, next_best = np.take_along_axis(value, order, axis=0)
        with np.errstate(invalid="ignore"):
            doubt = np.take_along_axis(error, order, axis=0)[0] + np.abs(best - next_best)
        return Estimate(value=best, uncertainty=_nan_to_inf(doubt))

    def forces(self, model: Model, z: Array, w: Array, indices: Sequence[int]) -> Estimate:
        """Return mass times acceleration (B, r), with the mass of the states numbered `indices`."""
        states = np.hstack([z, w])
        accelerations = self._agreed(
            [
                self._accelerations(model, by).measure(
                    states, np.zeros((len(z), 0)), np.zeros_like(z)
                )
                for by in WINDOWS
            ]
        )
        slopes, mass, error = (
            one[list(indices)] for one in (self.slopes, self.mass.value, self.mass.uncertainty)
        )
        with np.errstate(invalid="ignore"):
            seen = np.einsum("bij,bj->bi", slopes, accelerations.value)
            seen_error = np.einsum("bij,bj->bi", np.abs(slopes), accelerations.uncertainty)
            value = np.einsum("bij,bj->bi", mass, seen)
            doubt = np.einsum("bij,bj->bi", np.abs(mass), seen_error)
            doubt += np.einsum("bij,bj->bi", error, np.abs(seen))
        return Estimate(value=value, uncertainty=_nan_to_inf(doubt))

    def odd(self, model: Model) -> Estimate:
        """Return `Mechanics.odd`; the curvature of the coordinates is even and cancels."""
        task, bases = self.task, min(BASES, len(self.task.z))
        r = len(task.independent)
        speed = task.unit[list(task.independent)] * task.typical
        z, w, indices = [], [], []
        for base in range(bases):
            # The velocity at which one independent coordinate alone moves.
            along = self.inverse[base] @ self.slopes[base].T @ self.mass.value[base]
            for share in SPEEDS:
                for sign in (1.0, -1.0):
                    for j in range(r):
                        z.append(task.z[base])
                        w.append(sign * share * speed[j] * along[:, j])
                        indices.append(base)
        forces = self.forces(model, np.array(z), np.array(w), indices)
        value, error = (
            one.reshape(bases, len(SPEEDS), 2, r, r) for one in (forces.value, forces.uncertainty)
        )
        return Estimate(
            value=(value[:, :, 0] - value[:, :, 1]) / 2,
            uncertainty=(error[:, :, 0] + error[:, :, 1]) / 2,
        )


def _nan_to_inf(uncertainty: Array) -> Array:
    """Replace NaN, from infinities times zeros, by infinity."""
    return np.where(np.isnan(uncertainty), np.inf, uncertainty)


EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class TermFrame:
    """Joints and states at which terms are measured.

    Attributes:
        names: of the joints, (r,).
        places: joint positions at the N states, (N, r).
        unit: size of their motions, (r,).
        typical: typical rate, rad/s.
    """

    names: Sequence[str]
    places: Array
    unit: Array
    typical: float


def differing_terms(a: Mechanics, b: Mechanics, frame: TermFrame) -> tuple[ComparedTerm, ...]:
    """Return the terms that differ by more than their uncertainty, worst first."""
    constraint = tuple(_constraint(a, b))
    if constraint:
        return constraint
    comparison = _Pair(a, b, frame)
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
    return tuple(sorted(every, key=_rounded_effect, reverse=True))


def _rounded_effect(term: ComparedTerm) -> float:
    return float("inf") if term.effect is None else float(f"{term.effect:.5e}")


def _constraint(a: Mechanics, b: Mechanics) -> Iterator[ComparedTerm]:
    rank_a, rank_b = max(a.rank), max(b.rank)
    if rank_a != rank_b:
        more, less = ("A", "B") if rank_a > rank_b else ("B", "A")
        joints = counted(max(rank_a, rank_b), "joint")
        yield ComparedTerm(
            kind="constraint",
            joints=(),
            message=f"no joint of {less} moves under a force; {joints}"
            f" of {more} can. A motor or a constraint holds them, or they have no inertia"
            if min(rank_a, rank_b) == 0
            else f"{joints} can move independently in {more},"
            f" {min(rank_a, rank_b)} in {less}. {less} has a constraint that {more} lacks",
            a=number(rank_a),
            b=number(rank_b),
            uncertainty=0.0,
            effect=1.0,
        )


def _less(total: Estimate, part: Estimate) -> Estimate:
    return Estimate(
        value=total.value - part.value, uncertainty=total.uncertainty + part.uncertainty
    )


class _Pair:
    """Measurements of two models."""

    def __init__(self, a: Mechanics, b: Mechanics, frame: TermFrame) -> None:
        self.a, self.b, self.frame = a, b, frame
        inertia = np.max(np.abs(np.diagonal(a.mass.value, axis1=1, axis2=2)), axis=0, initial=0.0)
        self.forces = np.maximum(np.nan_to_num(inertia), 1e-300) * frame.unit * frame.typical**2

    def inertia(self) -> Iterator[ComparedTerm]:
        """Yield differing entries of the mass matrix."""
        a, b, frame = self.a.mass, self.b.mass, self.frame
        error = a.uncertainty + b.uncertainty + 64 * EPSILON * np.abs(a.value)
        for i, name_i in enumerate(frame.names):
            for j, name_j in enumerate(frame.names[: i + 1]):
                state = _worst(a.value[:, i, j] - b.value[:, i, j], error[:, i, j])
                if state is None:
                    continue
                here, there = float(a.value[state, i, j]), float(b.value[state, i, j])
                about = (name_i,) if i == j else (name_j, name_i)
                name = (
                    f"inertia of {name_i}"
                    if i == j
                    else f"inertial coupling of {name_j} and {name_i}"
                )
                varies = float(np.ptp(a.value[:, i, j])) > 10 * float(np.max(error[:, i, j]))
                effect = abs(here - there) * frame.unit[j] * frame.typical**2 / self.forces[i]
                yield self._term(
                    "inertia",
                    about,
                    name,
                    here,
                    there,
                    float(error[state, i, j]),
                    effect,
                    state if varies else None,
                )

    def resistance(self) -> Iterator[ComparedTerm]:
        """Yield differences of damping, and of other forces that depend on the velocity."""
        a, b, frame = self.a.odd, self.b.odd, self.frame
        error = a.uncertainty + b.uncertainty + 64 * EPSILON * np.abs(a.value)
        differing = np.abs(a.value - b.value) > error
        for i, name_i in enumerate(frame.names):
            for j, name_j in enumerate(frame.names):
                # At the higher speed, for which the value is reported.
                base = _worst((a.value - b.value)[:, 1, j, i], error[:, 1, j, i])
                if base is None:
                    continue
                slow, fast = ((a.value - b.value)[base, k, j, i] for k in range(len(SPEEDS)))
                ratio = SPEEDS[1] / SPEEDS[0]
                nonlinear = (
                    abs(fast - ratio * slow) > error[base, 1, j, i] + ratio * error[base, 0, j, i]
                )
                symmetric = differing[..., i, j].any()
                if j < i and symmetric and not nonlinear:
                    continue  # already reported as (j, i)
                speed = SPEEDS[1] * frame.unit[j] * frame.typical
                here, there = (float(-m.value[base, 1, j, i]) for m in (a, b))
                doubt = float(error[base, 1, j, i])
                effect = abs(here - there) / self.forces[i]
                if nonlinear:
                    dry = abs(fast - slow) <= error[base, :, j, i].sum()
                    name = (
                        f"friction on {name_i}"
                        if dry
                        else (f"force on {name_i} that depends on the velocity, not linearly")
                    )
                    suffix = ", whatever its speed" if dry else f" at {name_j}_dot = {speed:.3g}"
                    yield self._term(
                        "friction", (name_i,), name, here, there, doubt, effect, None, suffix
                    )
                else:
                    about = (name_i,) if i == j else (name_i, name_j)
                    name = (
                        f"damping of {name_i}"
                        if i == j
                        else f"damping between {name_i} and {name_j}"
                    )
                    varies = np.ptp(a.value[:, 1, j, i]) > 10 * np.max(error[:, 1, j, i])
                    yield self._term(
                        "damping",
                        about,
                        name,
                        here / speed,
                        there / speed,
                        doubt / speed,
                        effect,
                        base if varies else None,
                    )

    def springs(self, a: Estimate, b: Estimate, kind: str) -> Iterator[ComparedTerm]:
        """Yield differences of stiffness if forces are linear in the positions, else of forces."""
        frame = self.frame
        count, r = frame.places.shape
        design = np.hstack([frame.places / frame.unit, np.ones((count, 1))])
        back = np.linalg.pinv(design)
        error = a.uncertainty + b.uncertainty + 64 * EPSILON * np.abs(a.value)
        if not np.isfinite(error).all() or not (np.abs(a.value - b.value) > error).any():
            yield from self.pointwise(a, b, kind)
            return
        fits = [back @ m.value for m in (a, b)]
        residuals = [np.abs(m.value - design @ fit) for m, fit in zip((a, b), fits, strict=True)]
        linear = np.all(
            [(one <= 3 * error + 1e-9 * np.abs(a.value)).all(axis=0) for one in residuals], 0
        )
        doubt = np.abs(back) @ error
        for i, name_i in enumerate(frame.names):
            if not linear[i] or count <= r + 1:
                yield from self.pointwise(a, b, kind, only=i)
                continue
            for j, name_j in enumerate(frame.names):
                here, there = (-float(fit[j, i]) / frame.unit[j] for fit in fits)
                limit = float(doubt[j, i]) / frame.unit[j]
                reported = j < i and abs(fits[0][i, j] - fits[1][i, j]) > doubt[i, j]
                if abs(here - there) > limit and not reported:
                    name = (
                        f"stiffness of {name_i}"
                        if i == j
                        else f"stiffness between {name_i} and {name_j}"
                    )
                    effect = abs(here - there) * frame.unit[j] / self.forces[i]
                    about = (name_i,) if i == j else (name_i, name_j)
                    yield self._term("stiffness", about, name, here, there, limit, effect, None)
            here, there = (float(fit[r, i]) for fit in fits)
            if abs(here - there) > doubt[r, i]:
                name = f"{kind} force on {name_i} with every joint at zero"
                effect = abs(here - there) / self.forces[i]
                yield self._term(
                    kind, (name_i,), name, here, there, float(doubt[r, i]), effect, None
                )

    def pointwise(
        self, a: Estimate, b: Estimate, kind: str, only: int | None = None
    ) -> Iterator[ComparedTerm]:
        """Yield differing forces, at the state with the largest difference."""
        error = a.uncertainty + b.uncertainty + 64 * EPSILON * np.abs(a.value)
        for i, name_i in enumerate(self.frame.names):
            if only is not None and i != only:
                continue
            state = _worst(a.value[:, i] - b.value[:, i], error[:, i])
            if state is None:
                continue
            here, there = float(a.value[state, i]), float(b.value[state, i])
            name = f"{'force at rest' if kind == 'force' else kind + ' force'} on {name_i}"
            effect = abs(here - there) / self.forces[i]
            yield self._term(
                kind, (name_i,), name, here, there, float(error[state, i]), effect, state
            )

    def _term(
        self,
        kind: str,
        about: tuple[str, ...],
        name: str,
        here: float,
        there: float,
        doubt: float,
        effect: float,
        state: int | None,
        suffix: str = "",
    ) -> ComparedTerm:
        shown = apart(here, there, doubt)
        message = f"{name}: {shown[0]} in A, {shown[1]} in B{_share(here, there, doubt)}"
        if state is not None:
            place = zip(self.frame.names, self.frame.places[state], strict=True)
            message += " at " + ", ".join(f"{n} = {value:.3g}" for n, value in list(place)[:4])
        return ComparedTerm(
            kind=kind,
            joints=about,
            message=message + suffix,
            a=number(here),
            b=number(there),
            uncertainty=number(doubt),
            effect=number(effect),
        )


def _worst(miss: Array, error: Array) -> int | None:
    """Return the state with the largest certain difference."""
    with np.errstate(invalid="ignore"):
        certain = np.abs(miss) > error
    if not certain.any():
        return None
    return int(np.argmax(np.where(certain, np.abs(miss), -1.0)))


def _share(here: float, there: float, doubt: float) -> str:
    if abs(here) <= doubt or abs(there) <= doubt:
        return ""
    return f" ({percent((there - here) / here)})"
