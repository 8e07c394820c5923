"""Measured terms of a model's equations: inertia, and forces at rest and in motion.

Only accelerations at given states are used, as limits of a few tiny steps, with and without a
known force on each coordinate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.candidate import Candidate
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.scales import free_directions, inverse_mass
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Model
from physics_crosscheck.harness.numerics.accelerations import Accelerations, Estimate
from physics_crosscheck.harness.numerics.coordinates import identity

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
