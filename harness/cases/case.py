"""One case: one model file in one engine in one scenario, from its load to its verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.cases.prepare import Equilibrium, Prepared
from harness.cases.verdict import Verdict, judge
from harness.engines.protocol import Model
from harness.engines.registry import engines
from harness.files.sidecar import Sidecar
from harness.numerics.coordinates import CoordinateMap, coordinate_map
from harness.numerics.full_run import TARGETS, StepStudy, study_step
from harness.numerics.linearization import EngineLinearization, linearize_engine
from harness.numerics.segments import Batch, Extrapolated, extrapolate
from harness.records.outcome import FLOOR, Outcome
from reference.motion import Motion
from reference.numeric import Array, NumericFunction
from reference.system import System

SERIES = 240
"""Samples of a series in results.json: as many as a plot of ordinary width can show."""

BLOWN_UP = 1e6
"""Global errors beyond so many amplitudes are an instability that ran out of time, not accuracy."""


@dataclass(frozen=True)
class CaseTask:
    """Everything a worker needs for one case."""

    system: System
    sidecar: Sidecar
    engine: str
    scenario: str
    motion: Motion
    scale: Array
    amplitude: Array
    power: NumericFunction
    components: tuple[str, ...]
    resolution: float


@dataclass(frozen=True)
class LinearizationTask:
    """Everything a worker needs for the linearizations of one model in one engine."""

    system: System
    sidecar: Sidecar
    engine: str
    equilibria: tuple[Equilibrium, ...]
    amplitude: Array
    push: Array


def case_task(
    prepared: Prepared, sidecar: Sidecar, engine: str, scenario: str, resolution: float
) -> CaseTask:
    """Gather what one case needs of its prepared system."""
    return CaseTask(
        prepared.system,
        sidecar,
        engine,
        scenario,
        prepared.motions[scenario],
        prepared.scales[scenario],
        prepared.amplitude,
        prepared.power,
        prepared.components,
        resolution,
    )


def load(system: System, sidecar: Sidecar, engine: str) -> tuple[Model, CoordinateMap]:
    """Load a model file and the map between its coordinates and the system's.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    model = engines()[engine].load(sidecar.spec(engine))
    return model, coordinate_map(system, sidecar, model.coordinates)


def run_case(task: CaseTask) -> dict[str, Any]:
    """Run and judge one case; returns the fields of its record that a run determines.

    Raises:
        EngineError, SidecarError, BlownUpError: the case is FAILED with that message.
    """
    began = time.perf_counter()
    model, coordinates = load(task.system, task.sidecar, task.engine)
    motion = task.motion
    claimed = model.exponents(motion.varying)[0]
    batch = Batch.of(motion, task.scale)
    found = extrapolate(model, coordinates, batch, resolution=task.resolution)
    verdict = judge(found.limit, motion, task.scale, task.components, claimed, task.resolution)
    amplitude = np.maximum(motion.amplitude, FLOOR * task.amplitude)
    study = study_step(
        model, coordinates, motion, power=task.power, amplitude=amplitude, claimed=claimed
    )
    outcome, reason = _with_full_runs(verdict, study, claimed)
    return {
        "outcome": str(outcome),
        "discrepancy": verdict.discrepancy,
        "uncertainty": verdict.uncertainty,
        "component": verdict.component,
        "time": verdict.time,
        "order": verdict.order,
        "claimed_order": claimed,
        "integrator": model.integrator,
        "shipped_step": model.step,
        "raw_error": study.global_error,
        "raw_order": study.global_order,
        "raw_residual": study.global_residual,
        "reason": reason,
        "steps": found.steps,
        "rungs": list(found.rungs),
        **_step_record(study),
        "series": _series(task, found, study, amplitude),
        "seconds": time.perf_counter() - began,
    }


def _with_full_runs(verdict: Verdict, study: StepStudy, claimed: int) -> tuple[Outcome, str]:
    if not study.shipped.finite:
        bad = study.shipped.t[~np.isfinite(study.shipped.states).all(axis=1)][0]
        return Outcome.FAILED, (
            f"at the shipped step of {study.shipped.h:g} s the motion is no longer finite at"
            f" t = {bad:.4g} s"
        )
    if study.global_error > BLOWN_UP:
        return Outcome.FAILED, (
            f"at the shipped step of {study.shipped.h:g} s the motion blows up, to"
            f" {study.global_error:.0e} of its amplitude; the step is too coarse for it"
        )
    if verdict.outcome is Outcome.AGREES and not study.converges:
        return Outcome.UNRESOLVED, (
            "every segment agrees, but a run from start to end does not converge to the motion"
            f" (order {study.global_order:.2f} where {claimed} is claimed, raw error"
            f" {study.global_error:.1e}, {study.global_residual:.1e} of it left as the step falls):"
            " something is carried from step to step"
        )
    return verdict.outcome, verdict.reason


def _step_record(study: StepStudy) -> dict[str, Any]:
    parts = study.decomposition
    shipped = study.shipped
    return {
        "apart": None
        if parts is None
        else {
            "amplitude": parts.amplitude,
            "phase": parts.phase,
            "frequency": parts.frequency,
            "damping": parts.damping,
            "explained": parts.explained,
        },
        "steps_for": [
            {"target": target, "step": step}
            for target, step in zip(TARGETS, study.steps_for, strict=True)
        ],
        "checked_step": None
        if study.checked is None
        else dict(zip(("target", "step", "measured"), study.checked, strict=True)),
        "energy_error": shipped.energy,
        "constraint_drift": shipped.drift,
    }


def _series(
    task: CaseTask, found: Extrapolated, study: StepStudy, amplitude: Array
) -> dict[str, Any]:
    motion, shipped = task.motion, study.shipped
    picked = np.unique(np.linspace(0, len(shipped.t) - 1, SERIES).astype(int))
    t = shipped.t[picked]
    segments = np.unique(np.linspace(0, len(motion.t) - 1, SERIES).astype(int))
    defect = (found.limit.value - motion.end) / task.scale
    uncertainty = (found.limit.uncertainty + motion.bound) / task.scale
    raw = np.sqrt(np.mean(((found.raw - motion.end) / task.scale) ** 2, axis=1))
    runs = (shipped, *study.finer)
    balance = shipped.balance
    n = len(amplitude) // 2
    return {
        "t": _tidy(t, 7),
        "components": list(task.components),
        "reference": _tidy(motion.at(t).T, 6),
        "engine": _tidy(shipped.states[picked].T, 6),
        "error": _tidy(shipped.error[picked].T, 4),
        "segment_t": _tidy(motion.t[segments], 6),
        "defect": _tidy(defect[segments].T, 3),
        "defect_uncertainty": _tidy(uncertainty[segments].T, 3),
        "convergence": {
            "rungs": list(found.rungs),
            "h": _tidy(float(np.mean(motion.lengths)) / np.array(found.rungs), 6),
            "raw": _tidy(np.max(raw, axis=1), 4),
            "draws": _tidy(found.limit.increments, 4),
        },
        "plain": {
            "h": [run.h for run in runs],
            "error": [
                _round(float(np.max(np.abs(run.error[:, :n]) / amplitude[:n])), 5) for run in runs
            ],
            "seconds": [_round(run.seconds, 3) for run in runs],
        },
        "energy": {
            "held": _tidy(balance.held[picked] - balance.held[0], 5),
            "supplied": _tidy(balance.supplied[picked], 5),
            "dissipated": _tidy(balance.dissipated[picked], 5),
        },
    }


def run_linearizations(task: LinearizationTask) -> list[dict[str, Any]]:
    """The engine's linearization about every equilibrium, beside Taylor's."""
    model, coordinates = load(task.system, task.sidecar, task.engine)
    return [
        _linearization_record(
            linearize_engine(
                model,
                coordinates,
                equilibrium=e.name,
                position=e.position,
                taylor=e.matrices,
                amplitude=task.amplitude,
                push=task.push,
            )
        )
        for e in task.equilibria
    ]


def _linearization_record(found: EngineLinearization) -> dict[str, Any]:
    return {
        "equilibrium": found.equilibrium,
        "A": found.a.tolist(),
        "B": found.b.tolist(),
        "A_error": found.a_error,
        "B_error": found.b_error,
        "poles": [_pole(p) for p in found.poles],
        "taylor_poles": [_pole(p) for p in found.taylor_poles],
        "transfer_error": found.transfer_error,
        "shapes": found.shapes,
        "frequencies": _tidy(found.frequencies, 5),
        "response": _tidy(found.response, 5),
        "taylor_response": _tidy(found.taylor_response, 5),
    }


def _pole(value: complex) -> Mapping[str, float]:
    size = abs(value)
    return {
        "real": value.real,
        "imaginary": value.imag,
        "frequency": size,
        "damping": -value.real / size if size else math.nan,
    }


def _round(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _tidy(values: Array, digits: int) -> Any:
    """Nested lists of floats with so many significant digits: what a plot can show."""
    if values.ndim > 1:
        return [_tidy(row, digits) for row in values]
    return [_round(value, digits) for value in values.tolist()]
