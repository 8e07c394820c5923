"""An engine's accelerations at given states, without a motion: limits of a few tiny steps.

The change of velocity over the k-th step, per second, goes to the acceleration at the start as
h -> 0, for every k. What an engine carries from step to step, a soft equality's initial layer for
one, makes it differ from step to step: that difference is part of the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import RUNGS, limits, weights
from reference.numeric import Array

STEPS = range(4, 9)
"""Steps whose velocity changes are compared: a layer damped out step by step is over by then. The
last one counts."""

SHARE = 1 / 20
"""The coarsest rung's steps together, in periods of the fastest rate."""

LADDER = RUNGS[:8]

QUICKER = (1.0, 16.0, 256.0)
"""By how much steps are shortened until every acceleration is resolved."""

RESOLVED = 1e-6
"""Values are said to be unresolved where their uncertainty is above this share of their scale; what
differs by more than its uncertainty is a finding all the same."""


@dataclass(frozen=True)
class Estimate:
    """A value from an engine with its uncertainty, infinite where it has no limit."""

    value: Array
    uncertainty: Array


@dataclass(frozen=True)
class Probe:
    """What measures accelerations: a loaded model, its map, and the size of the system's motions.

    Attributes:
        speed: largest velocity of each coordinate, (n,), nowhere zero.
        fastest: fastest rate of the system's motions, rad/s.
    """

    model: Model
    coordinates: CoordinateMap
    speed: Array
    fastest: float

    def accelerations(self, states: Array, inputs: Array, forces: Array) -> Estimate:
        """Accelerations (B, n) at states (B, 2n) under inputs (B, m) and generalized forces (B, n).

        A model far quicker than its equations, by a wrong literal, is given shorter steps.
        """
        best: Estimate | None = None
        least = np.inf
        for fastest in (self.fastest * quicker for quicker in QUICKER):
            found = self._accelerations(states, inputs, forces, fastest)
            size = np.maximum(np.nan_to_num(np.abs(found.value)), self.speed * self.fastest)
            worst = float(np.max(found.uncertainty / size))
            if best is None or worst < least:
                best, least = found, worst
            if least <= RESOLVED:
                break
        assert best is not None
        return best

    def _accelerations(
        self, states: Array, inputs: Array, forces: Array, fastest: float
    ) -> Estimate:
        """The forces on the engine's coordinates are those at the start: as h -> 0 no others."""
        n = len(self.speed)
        z, w = self.coordinates.to_engine(states)
        slope = self.coordinates.back_slope(z).reshape(len(z), n, -1)
        push = np.einsum("bnz,bn->bz", slope, forces) + self.coordinates.push(z, inputs)
        last = STEPS[-1]
        held = np.repeat(push[:, None, :], last, axis=1) if push.any() else None
        longest = 2 * np.pi / fastest * SHARE / last
        rungs = []
        for rung in LADDER:
            h = longest * LADDER[0] / rung
            ends_z, ends_w = self.model.rollout(z, w, h, last, held, 1)
            velocities = [
                self.coordinates.from_engine(ends_z[:, k - 1], ends_w[:, k - 1], states)[:, n:]
                for k in range(STEPS[0] - 1, last + 1)
            ]
            rungs.append(np.diff(velocities, axis=0) / h)
        if not np.isfinite(rungs).all():
            bad = np.full((len(states), n), np.nan)
            return Estimate(bad, np.full_like(bad, np.inf))
        scale = self.speed * self.fastest
        # Rounding: of the velocities, in differences over steps as short as the last rung's.
        grain = self.coordinates.grain(z, w)
        rounded = grain[n:] + self.speed * SHARE + grain[:n] * fastest
        relative = rounded / (longest * LADDER[0]) * np.sqrt(LADDER[-1])
        limit = limits([changes[-1] for changes in rungs], LADDER, (1, 1), scale, relative)
        by_step = np.tensordot(weights(LADDER, (1, 1)), np.stack(rungs), axes=1)
        carried = np.max(np.abs(by_step - by_step[-1]), axis=0)
        return Estimate(limit.value, limit.uncertainty + 2 * carried)

    def mechanics(self, states: Array, sizes: Array) -> tuple[Estimate, Estimate]:
        """Mass matrices (B, n, n) and generalized forces (B, n) of the engine at states (B, 2n).

        The response to a force on each coordinate in turn, of the given size and both signs, is the
        inverse of the mass matrix.
        """
        count, n = len(states), len(sizes)
        pushes = np.concatenate([np.zeros((1, n)), np.diag(sizes), -np.diag(sizes)])
        found = self.accelerations(
            np.repeat(states, len(pushes), axis=0),
            np.zeros((count * len(pushes), self.coordinates.push.groups[1])),
            np.tile(pushes, (count, 1)),
        )
        value = found.value.reshape(count, len(pushes), n)
        error = found.uncertainty.reshape(count, len(pushes), n)
        # Rows are the coordinates pushed; the transpose has a column for each.
        inverse = (value[:, 1 : n + 1] - value[:, n + 1 :]).swapaxes(1, 2) / (2 * sizes)
        inverse_error = (error[:, 1 : n + 1] + error[:, n + 1 :]).swapaxes(1, 2) / (2 * sizes)
        regular: NDArray[np.bool_] = np.array([np.isfinite(one).all() for one in inverse])
        safe = np.where(regular.reshape(-1, 1, 1), inverse, np.eye(n))
        regular = regular & (np.linalg.cond(safe) < 1e12)
        mass = np.full_like(inverse, np.nan)
        mass[regular] = np.linalg.inv(inverse[regular])
        size = np.abs(np.where(np.isfinite(mass), mass, 0.0))
        with np.errstate(invalid="ignore"):
            mass_error = _known(size @ inverse_error @ size)
            mass_error[~regular] = np.inf
            force = np.einsum("bij,bj->bi", mass, value[:, 0])
            force_error = np.einsum("bij,bj->bi", size, error[:, 0])
            force_error += np.einsum("bij,bj->bi", mass_error, np.abs(value[:, 0]))
        return Estimate(mass, mass_error), Estimate(force, _known(force_error))


def _known(uncertainty: Array) -> Array:
    """Where infinities met zeros, nothing is known."""
    return np.where(np.isnan(uncertainty), np.inf, uncertainty)
