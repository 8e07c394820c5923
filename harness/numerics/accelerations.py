"""An engine's accelerations at given states, as limits of a few tiny steps.

The change of velocity over the k-th step, per second, converges to the acceleration at the start as
h -> 0, for every k. Unlike a segment's end, it is measured on rungs with equal numbers of steps.
State that an engine keeps between steps, such as the initial layer of a soft equality, makes it
differ between steps. That difference is part of the uncertainty.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.reference.mechanism.numeric import Array
from .coordinates import CoordinateMap
from .ladder import RUNGS, floored, weights
from .residual import FINEST, bounded_by_finest
from .rounding import with_companions
from .segments import BlownUpError, Observable, climb, lost_turns, spread

COMPARED_STEPS = range(4, 9)
"""Steps whose velocity changes are compared; a layer that is damped out step by step has vanished
by then. The last one is the result."""

LADDER_PERIODS = 1 / 20
"""Duration of the coarsest rung's steps, in periods of the fastest rate."""

LADDER = RUNGS[:8]

STEP_DIVISORS = (1.0, 16.0, 256.0)
"""Factors by which steps are shortened until every acceleration is resolved."""

RESOLVED_SHARE = 1e-6
"""Values are unresolved if their uncertainty exceeds this share of their scale. A difference larger
than its uncertainty is still a finding."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value from an engine with its uncertainty, infinite if it has no limit."""

    value: Array
    uncertainty: Array


@dataclass(frozen=True, kw_only=True)
class Velocities:
    """The C velocities that are measured.

    Attributes:
        select: maps engine positions and velocities, (B, nz) each, near states (B, 2n), to (B, C).
        speed: unit of relative errors, (C,), nowhere zero.
        rounding_scale: change of each position, then velocity, per unit of relative rounding,
            (2C,).
        vanishing: whether the equations' accelerations are zero. Rounding alone then has no limit,
            and the finest rungs bound what is left (`numerics.residual`).
    """

    select: Callable[[Array, Array, Array], Array]
    speed: Array
    rounding_scale: Array
    vanishing: bool = False


@dataclass(frozen=True, kw_only=True)
class Accelerations:
    """Measurement of accelerations: a loaded model, its map, and the size of the system's motions.

    Attributes:
        speed: largest velocity of each coordinate, (n,), nowhere zero.
        fastest: fastest rate of the system's motions, rad/s.
    """

    model: LoadedModel
    coordinates: CoordinateMap
    speed: Array
    fastest: float

    def measure(self, states: Array, inputs: Array, forces: Array) -> Estimate:
        """Return accelerations (B, n) at states (B, 2n), inputs (B, m) and forces (B, n).

        The forces are generalized. A model that is much faster than its equations, because of a
        wrong number, gets shorter steps.
        """
        n = len(self.speed)
        velocities = Velocities(
            select=lambda z, w, near: self.coordinates.from_engine(z, w, near)[:, n:],
            speed=self.speed,
            rounding_scale=self.coordinates.rounding_scale(*self.coordinates.to_engine(states)),
        )
        return self._resolved(velocities, states, inputs, forces)

    def off_the_map(self, states: Array, inputs: Array) -> tuple[Estimate, Array]:
        """Return accelerations (B, nz) of the coordinate map's residual, and their unit, (nz,).

        The equations have zero.
        """
        z, w = self.coordinates.to_engine(states)
        nz = z.shape[1]
        residual = Velocities(
            select=lambda z, w, near: self._residual(z, w, near)[:, nz:],
            speed=floored(np.max(np.abs(w), axis=0)),
            rounding_scale=self.coordinates.residual_rounding_scale(z, w),
            vanishing=True,
        )
        estimate = self._resolved(
            residual, states, inputs, np.zeros((len(states), len(self.speed)))
        )
        return estimate, residual.speed * self.fastest

    def _residual(self, z: Array, w: Array, near: Array) -> Array:
        return self.coordinates.residual(z, w, self.coordinates.from_engine(z, w, near))

    def _resolved(
        self, observed: Velocities, states: Array, inputs: Array, forces: Array
    ) -> Estimate:
        best: Estimate | None = None
        least = np.inf
        for fastest in (self.fastest * quicker for quicker in STEP_DIVISORS):
            estimate = self._over(observed, states, inputs, forces, fastest)
            size = np.maximum(np.nan_to_num(np.abs(estimate.value)), observed.speed * self.fastest)
            worst = float(np.max(estimate.uncertainty / size))
            if best is None or worst < least:
                best, least = estimate, worst
            if least <= RESOLVED_SHARE:
                break
        assert best is not None
        return best

    def _over(
        self, observed: Velocities, states: Array, inputs: Array, forces: Array, fastest: float
    ) -> Estimate:
        """Measure at one step size; forces keep their initial values, which is exact as h -> 0."""
        n = len(self.speed)
        z, w = self.coordinates.to_engine(states)
        slope = self.coordinates.back_slope(z).reshape(len(z), n, -1)
        push = np.einsum("bnz,bn->bz", slope, forces) + self.coordinates.pushes(z, inputs)
        last = COMPARED_STEPS[-1]
        starts = with_companions(z, w, self.model.epsilon)
        held = None
        if push.any():
            held = np.repeat((push[starts.rows] * starts.gain[:, None])[:, None], last, axis=1)
        longest = 2 * np.pi / fastest * LADDER_PERIODS / last * LADDER[0]
        near = states[starts.rows]
        by_step: list[Array] = []

        def changes(rung: int) -> Array:
            h = longest / rung
            ends_z, ends_w = self.model.rollout(starts.z, starts.w, h, last, held, 1)
            velocities = [
                observed.select(ends_z[:, k - 1], ends_w[:, k - 1], near)
                for k in range(COMPARED_STEPS[0] - 1, last + 1)
            ]
            slopes = np.diff(velocities, axis=0) / h
            by_step.append(slopes[:, : len(z)])
            latest: Array = slopes[-1]
            return latest

        # Rounding of the velocities, in differences over steps as short as the last rung's.
        count = len(observed.speed)
        size = observed.rounding_scale
        rounded = size[count:] + observed.speed * LADDER_PERIODS + size[:count] * fastest

        def lost(rung: int) -> Array:
            rates = spread(*(self.model.turning_rates(z, one * w) for one in (0.9, 1.1)))
            h = longest / rung
            missing: Array = lost_turns(self.model, rates, h) * np.maximum(rates, 1.0) / h
            return missing

        observable = Observable(
            values=changes,
            starts=starts,
            exponents=(1, 1),
            rounding_scale=rounded / longest * np.sqrt(LADDER[-1]),
            scale=observed.speed * self.fastest,
            lost=lost if self.model.lost_turn else None,
            where=lambda row, rung: f"from state {row}, in steps of {longest / rung:.3g} s",
        )
        try:
            limit = climb(observable, LADDER).limit
        except BlownUpError:
            bad = np.full((len(states), count), np.nan)
            return Estimate(value=bad, uncertainty=np.full_like(bad, np.inf))
        each = np.tensordot(weights(LADDER, (1, 1)), np.stack(by_step), axes=1)
        carried = np.max(np.abs(each - each[-1]), axis=0)
        value, uncertainty = limit.value, limit.uncertainty + 2 * carried
        if observed.vanishing:
            finest = np.concatenate(by_step[-FINEST:])
            value, uncertainty = bounded_by_finest(value, uncertainty, finest)
        return Estimate(value=value, uncertainty=uncertainty)

    def responses(
        self, states: Array, sizes: Array, directions: Array | None = None
    ) -> tuple[Estimate, Estimate]:
        """Return accelerations (B, n), and their changes per unit of r forces, (B, n, r).

        Args:
            states: B of them, (B, 2n).
            sizes: of the forces that are applied with both signs, (r,).
            directions: unit forces on the coordinates, (B, r, n); None: one on each coordinate.
        """
        count, n, r = len(states), len(self.speed), len(sizes)
        if directions is None:
            directions = np.broadcast_to(np.eye(n), (count, n, n))
        forces = directions * sizes[:, None]
        pushes = np.concatenate([np.zeros((count, 1, n)), forces, -forces], axis=1)
        estimate = self.measure(
            np.repeat(states, 2 * r + 1, axis=0),
            np.zeros((count * (2 * r + 1), self.coordinates.push.groups[1])),
            pushes.reshape(-1, n),
        )
        value, error = (
            one.reshape(count, 2 * r + 1, n) for one in (estimate.value, estimate.uncertainty)
        )
        # Rows are the forces; the transpose has a column for each.
        change = (value[:, 1 : r + 1] - value[:, r + 1 :]).swapaxes(1, 2) / (2 * sizes)
        change_error = (error[:, 1 : r + 1] + error[:, r + 1 :]).swapaxes(1, 2) / (2 * sizes)
        return (
            Estimate(value=value[:, 0], uncertainty=error[:, 0]),
            Estimate(value=change, uncertainty=change_error),
        )

    def inverse_mass(self, states: Array, sizes: Array) -> Array:
        """Return the response to a force of the given size on each coordinate, (B, n, n).

        A response within its uncertainty is zero: its rounding error would look like an inertia.
        """
        _, response = self.responses(states, sizes)
        value = response.value.copy()
        within = np.abs(value) <= 10 * response.uncertainty
        still = np.diagonal(within, axis1=1, axis2=2)
        value[still[:, :, None] | still[:, None, :]] = 0.0
        return value

    def mechanics(
        self, states: Array, sizes: Array, directions: Array | None = None
    ) -> tuple[Estimate, Estimate]:
        """Return the engine's mass matrices (B, r, r) and generalized forces (B, r) at states.

        The response to a force in each direction in turn, of the given size and both signs, is the
        inverse of the mass matrix. The arguments are those of `responses`.
        """
        free, response = self.responses(states, sizes, directions)
        seen, seen_error = free.value, free.uncertainty
        inverse, inverse_error = response.value, response.uncertainty
        if directions is not None:
            across = np.abs(directions)
            seen = np.einsum("brn,bn->br", directions, seen)
            seen_error = np.einsum("brn,bn->br", across, seen_error)
            inverse, inverse_error = directions @ inverse, across @ inverse_error
        regular: NDArray[np.bool_] = np.array([np.isfinite(one).all() for one in inverse])
        safe = np.where(regular.reshape(-1, 1, 1), inverse, np.eye(len(sizes)))
        regular = regular & (np.linalg.cond(safe) < 1e12)
        mass = np.full_like(inverse, np.nan)
        mass[regular] = np.linalg.inv(inverse[regular])
        size = np.abs(np.where(np.isfinite(mass), mass, 0.0))
        with np.errstate(invalid="ignore"):
            mass_error = _nan_to_infinity(size @ inverse_error @ size)
            mass_error[~regular] = np.inf
        whole = Estimate(value=mass, uncertainty=mass_error)
        return whole, force_of(whole, Estimate(value=seen, uncertainty=seen_error))


def force_of(mass: Estimate, accelerations: Estimate) -> Estimate:
    """Return generalized forces, (B, r), of mass matrices and accelerations."""
    size = np.abs(np.where(np.isfinite(mass.value), mass.value, 0.0))
    with np.errstate(invalid="ignore"):
        force = np.einsum("bij,bj->bi", mass.value, accelerations.value)
        error = np.einsum("bij,bj->bi", size, accelerations.uncertainty)
        error += np.einsum("bij,bj->bi", mass.uncertainty, np.abs(accelerations.value))
    return Estimate(value=force, uncertainty=_nan_to_infinity(error))


def _nan_to_infinity(uncertainty: Array) -> Array:
    return np.where(np.isnan(uncertainty), np.inf, uncertainty)
