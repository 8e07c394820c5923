"""Energy balance of a run: stored energy, work of the inputs, work of the dampers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.motion import Motion


@dataclass(frozen=True)
class EnergyBalance:
    """Energies over a run, joules.

    Attributes:
        held: T + V at the samples, (S,).
        supplied: work of the inputs up to each sample, (S,).
        dissipated: work of the dampers up to each sample, (S,).
        scale: the largest exchanged energy: supplied, dissipated or kinetic.
    """

    held: Array
    supplied: Array
    dissipated: Array
    scale: float

    @property
    def error(self) -> float:
        """Largest imbalance, relative to the scale: of order h^p for a method of order p."""
        imbalance = self.held - self.held[0] - self.supplied + self.dissipated
        return float(np.max(np.abs(imbalance))) / self.scale if self.scale else 0.0


def energy_balance(t: Array, states: Array, motion: Motion, power: VectorFunction) -> EnergyBalance:
    """Compute the energy balance of a sampled run.

    Args:
        t: sample times, (S,).
        states: (q, v) there, (S, 2n).
        motion: provides the inputs and their breaks.
        power: (energy, supplied, dissipated) of (q, v, u, (t,)).
    """
    from scipy.integrate import cumulative_simpson  # slow import, not needed by every command

    n = states.shape[1] // 2

    def powers(times: Array, y: Array, u: Array) -> Array:
        return power(y[:, :n], y[:, n:], u, times[:, None])

    u = motion.inputs(t)
    held = powers(t, states, u)[:, 0]
    still = states * (np.arange(2 * n) < n)
    kinetic = held - powers(t, still, u)[:, 0]
    energies = np.zeros((len(t), 2))
    done = np.zeros(2)
    for span in motion.spans:
        # Integrate each piece from break to break, since an input that jumps between samples would
        # reduce the quadrature's order.
        stop = min(span.start + span.length * span.count, t[-1])
        inside = (t > span.start) & (t < stop)
        times = np.concatenate([[span.start], t[inside], [stop]])
        y = np.stack([np.interp(times, t, column) for column in states.T], axis=1)
        before_stop = np.minimum(times, stop - 1e-9 * span.length)
        rates = powers(times, y, motion.inputs(before_stop))[:, 1:]
        summed = cumulative_simpson(rates.T, x=times, initial=0.0).T + done
        energies[inside] = summed[1:-1]
        energies[t >= stop] = done = summed[-1]
    largest = max(float(np.ptp(held)), float(np.max(np.abs(energies))), float(np.max(kinetic)))
    return EnergyBalance(held, energies[:, 0], energies[:, 1], largest)
