"""The motion redrawn with the value that a diagnosis found, to show that it explains the motion.

Where the cause is a number of the equations, they are solved again with the estimate. Otherwise the
model is run again, repaired.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy.integrate

from harness.diagnosis.diagnose import Diagnosis
from harness.diagnosis.fit import Finding
from harness.diagnosis.hypotheses import TrialModel
from harness.diagnosis.samples import Sample
from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.full_run import follow
from reference.motion import Motion
from reference.numeric import Array
from reference.variants import Variants

SAMPLES = 240
TOLERANCE = 1e-10
"""Of the redrawn motion, relative: far below what a plot can show."""

BEYOND = 1e3
"""A redrawn motion that leaves by so many amplitudes ends there."""


def correct_motion(
    trial_model: TrialModel, motions: Mapping[str, Motion], diagnosis: Diagnosis
) -> dict[str, Any] | None:
    """Motions and defects with the estimate of the best finding put in.

    Returns None where nothing is explained.

    Raises:
        EngineError, BlownUpError: naming what could not be run.
    """
    if not diagnosis.explained:
        return None
    finding, equations = _chosen(trial_model, diagnosis)
    if equations:
        point = trial_model.point(finding.repair)
        redrawn = {name: _solved(trial_model.variants, point, m) for name, m in motions.items()}
    else:
        model = trial_model.repaired(finding.repair)
        if model is None:
            return None
        redrawn = {name: _run(model, trial_model.coordinates, m) for name, m in motions.items()}
    before, after = trial_model.defect({}), trial_model.defect(finding.repair)
    return {
        "cause": " and ".join(cause.cause for cause in finding.causes),
        "estimate": list(finding.estimates),
        "what": "equations" if equations else "file",
        "scenarios": _scenarios(redrawn, trial_model.samples, before, after),
    }


def _chosen(trial_model: TrialModel, diagnosis: Diagnosis) -> tuple[Finding, bool]:
    """The best finding that is of the equations, if one is as good as the best; else the best."""
    best = diagnosis.findings[0]
    for finding in diagnosis.findings:
        alike = finding.remaining <= max(3 * best.remaining, 3 * diagnosis.floor)
        if alike and all(trial_model.candidates[i].change.parameters for i in finding.members):
            return finding, True
    return best, False


def _solved(variants: Variants, point: Array, motion: Motion) -> tuple[Array, Array]:
    """(t, states) of the equations at other parameters, from where the motion starts."""
    state = motion.start[0]
    n = len(state) // 2
    limit = BEYOND * np.maximum(motion.amplitude, 1e-12)
    times = np.linspace(0.0, motion.duration, SAMPLES)
    found = []
    for span in motion.spans:
        stop = span.start + span.length * span.count
        last = span is motion.spans[-1]
        inside = times[(times >= span.start) & ((times <= stop) if last else (times < stop))]
        short = 1e-9 * span.length

        def field(t: float, y: Array, end: float = stop - short) -> Array:
            # Up to the end of a span its own input holds, not the next one's.
            u = motion.inputs(np.array([min(t, end)]))
            a = variants.acceleration(y[None, :n], y[None, n:], u, np.array([[t]]), point[None])
            return np.concatenate([y[n:], a[0]])

        def gone(t: float, y: Array) -> float:
            return float(np.min(limit - np.abs(y)))

        gone.terminal = True  # type: ignore[attr-defined]
        done = scipy.integrate.solve_ivp(
            field,
            (span.start, stop),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=TOLERANCE * motion.amplitude,
            t_eval=np.union1d(inside, [stop]),
            events=gone,
        )
        states = done.y.T
        found.append(states[np.isin(done.t, inside)])
        if done.status != 0:
            break
        state = states[-1]
    states = np.concatenate(found)
    return times[: len(states)], states


def _run(model: Model, coordinates: CoordinateMap, motion: Motion) -> tuple[Array, Array]:
    t, states = follow(model, coordinates, motion, model.step)
    picked = np.unique(np.linspace(0, len(t) - 1, SAMPLES).astype(int))
    return t[picked], states[picked]


def _scenarios(
    motions: Mapping[str, tuple[Array, Array]],
    samples: Sequence[Sample],
    before: Array,
    after: Array,
) -> list[dict[str, Any]]:
    starts = np.cumsum([0, *(sample.end.size for sample in samples)])
    found = []
    for name, (t, states) in motions.items():
        times, rows = [], []
        for i, sample in enumerate(samples):
            if sample.scenario == name:
                part = slice(starts[i], starts[i + 1])
                times.append(sample.t)
                rows.append(np.stack([d[part].reshape(sample.end.shape) for d in (before, after)]))
        both = np.concatenate(rows, axis=1)
        found.append(
            {
                "scenario": name,
                "t": _short(t, 6),
                "redrawn": [_short(row, 6) for row in states.T],
                "segment_t": _short(np.concatenate(times), 6),
                "before": [_short(row, 3) for row in both[0].T],
                "after": [_short(row, 3) for row in both[1].T],
            }
        )
    return found


def _short(values: Array, digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values.tolist()]
