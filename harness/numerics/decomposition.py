"""Decomposition of an oscillation's error into amplitude and phase, and their growth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.motion import Motion


@dataclass(frozen=True, kw_only=True)
class OscillationError:
    """An oscillation's error by parts: engine(t) = (1 + gain) reference(t - lag) + shift.

    Gain, lag and shift are linear in t, fitted by least squares. For y = Re(a exp(s t)) + const
    this covers every change of a and s that is small over the motion. With s = -sigma + i omega,

        a exp(s (t - lag)) = a exp(sigma lag) exp(s t - i omega lag):

    a delayed oscillation has decayed less. The amplitude at the end changes by the factor (1 +
    gain) exp(sigma lag), which is to first order gain + damping ratio times phase (of the undamped
    frequency). The phase lags by omega lag.

    Attributes:
        amplitude: relative error of the amplitude at the end.
        phase: phase error at the end, rad; positive lags behind.
        frequency: relative error of the frequency.
        damping: error of the damping ratio.
        explained: share of the mean square error that the decomposition explains.
    """

    amplitude: float
    phase: float
    frequency: float
    damping: float
    explained: float


def decompose(t: Array, engine: Array, motion: Motion, component: int) -> OscillationError:
    """Decompose the error of one position into amplitude and phase, and their growth.

    Args:
        t: evenly spaced sample times, (S,).
        engine: positions there, (S,).
        component: index of the position in the motion.
    """
    n = motion.start.shape[1] // 2
    end = t[-1]
    gain, lag, shift = np.zeros(2), np.zeros(2), np.zeros(2)
    share = np.stack([np.ones_like(t), t / end], axis=1)
    # Gauss-Newton from zero error: at first order, a phase error of a tenth would leave half a
    # percent of amplitude, which would appear as damping.
    for _ in range(4):
        times = t - share @ lag
        inside = (times >= 0) & (times <= end)
        reference = motion.states_at(np.clip(times, 0, end))
        y, rate = reference[:, component], reference[:, n + component]
        residual = engine - (1 + share @ gain) * y - share @ shift
        basis = np.concatenate([share * y[:, None], -share * rate[:, None], share], axis=1)
        fit, *_ = np.linalg.lstsq(basis[inside], residual[inside], rcond=1e-10)
        gain, lag, shift = gain + fit[:2], lag + fit[2:4], shift + fit[4:]
    residual = (residual - basis @ fit)[inside]
    error = engine - motion.states_at(t)[:, component]
    total = float(np.sum(error[inside] ** 2))
    pace = float(np.std(rate) / max(float(np.std(y)), 1e-300))
    kept = float(np.exp(_decay(t, motion, component) * lag.sum()))
    return OscillationError(
        amplitude=float((1 + gain.sum()) * kept - 1),
        phase=float(lag.sum() * pace),
        frequency=float(-lag[1] / end),
        damping=float(-gain[1] / end / pace) if pace > 0 else 0.0,
        explained=1.0 - float(np.sum(residual**2)) / total if total > 0 else 1.0,
    )


def _decay(t: Array, motion: Motion, component: int) -> float:
    """Return the decay rate sigma of a position's oscillation, 1/s.

    Between samples, (y - const, v) of Re(a exp(s t)) + const is multiplied by a constant matrix,
    whose determinant is exp(-2 sigma) of the time between. The matrix is fitted. The result has no
    meaning for other motions.
    """
    n = motion.start.shape[1] // 2
    states = motion.states_at(t)
    pair = np.stack([states[:, component], states[:, n + component]], axis=1)
    size = np.max(np.abs(pair), axis=0)
    if len(t) < 8 or not size.all():
        return 0.0
    pair = pair / size
    before = np.concatenate([pair[:-1], np.ones((len(t) - 1, 1))], axis=1)
    turned, *_ = np.linalg.lstsq(before, pair[1:], rcond=None)
    determinant = float(np.linalg.det(turned[:2]))
    return -np.log(determinant) / (2 * float(t[1] - t[0])) if determinant > 0 else 0.0
