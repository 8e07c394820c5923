"""Diagnose one model in one engine: evidence, suspects, ranking, and the record of it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.cases.case import load
from harness.cases.prepare import Prepared
from harness.diagnosis.corrected import correct_motion
from harness.diagnosis.diagnose import Diagnosis, diagnose
from harness.diagnosis.fit import Finding
from harness.diagnosis.hypotheses import TrialModel, everything
from harness.diagnosis.hypotheses.trial import scratch
from harness.diagnosis.samples import engine_ends, reference_ends, sample_segments
from harness.engines.registry import engines
from harness.files.sidecar import Sidecar
from harness.numerics.ladder import EPSILON
from reference.motion import Motion
from reference.numeric import Array
from reference.system import System
from reference.variants import Variants

TOLD = 8
"""Findings told: the ranking's tail says nothing."""


@dataclass(frozen=True)
class DiagnosisTask:
    """Everything a worker needs to diagnose one model in one engine."""

    system: System
    sidecar: Sidecar
    engine: str
    motions: Mapping[str, Motion]
    scales: Mapping[str, Array]
    variants: Variants


def diagnosis_task(prepared: Prepared, sidecar: Sidecar, engine: str) -> DiagnosisTask:
    """Gather what a diagnosis needs of the prepared system."""
    return DiagnosisTask(
        prepared.system, sidecar, engine, prepared.motions, prepared.scales, prepared.variants
    )


def diagnose_model(task: DiagnosisTask) -> dict[str, Any]:
    """Name the cause of a model's discrepancy, from its motions alone.

    Raises:
        EngineError, SidecarError, PlaceError, BlownUpError: naming what could not be run.
    """
    began = time.perf_counter()
    with trial_model(task) as (whole, uncertainty):
        diagnosis = diagnose(whole, uncertainty)
        redrawn = correct_motion(whole, task.motions, diagnosis)
    return {
        "explained": diagnosis.explained,
        "floor": diagnosis.floor,
        "findings": [_record(finding) for finding in diagnosis.findings[:TOLD]],
        "redrawn": redrawn,
        "seconds": time.perf_counter() - began,
    }


def diagnosed(task: DiagnosisTask) -> Diagnosis:
    """The same as objects."""
    with trial_model(task) as (found, uncertainty):
        return diagnose(found, uncertainty)


@contextmanager
def trial_model(
    task: DiagnosisTask, known: Mapping[str, Array] | None = None
) -> Iterator[tuple[TrialModel, Array]]:
    """A bench for a model in an engine, with the uncertainty of its ends; gone afterwards.

    Args:
        task: the model and its motions.
        known: slopes of literals by address, where a model close by has shown them already.
    """
    engine = engines()[task.engine]
    model, coordinates = load(task.system, task.sidecar, task.engine)
    samples = sample_segments(task.motions, task.scales)
    ends, uncertainty = engine_ends(model, coordinates, samples)
    # Where no limit is known, not even its digits before the point, it may be anything seen here.
    largest = np.max(np.abs(ends - reference_ends(samples)))
    uncertainty = np.where(np.isfinite(uncertainty), uncertainty, largest)
    # What the reference leaves open, and rounding, as the verdict has them.
    bounds = [np.tile(task.motions[s.scenario].bound / s.scale, len(s.t)) for s in samples]
    uncertainty = np.maximum(uncertainty + np.concatenate(bounds), EPSILON)
    candidates = everything(task.system, task.sidecar, model, coordinates, task.variants)
    with scratch() as folder:
        yield (
            TrialModel(
                task.sidecar,
                engine,
                model,
                coordinates,
                task.variants,
                samples,
                ends,
                candidates,
                folder,
                known or {},
            ),
            uncertainty,
        )


def _record(finding: Finding) -> dict[str, Any]:
    return {
        "cause": " and ".join(cause.cause for cause in finding.causes),
        "kind": " and ".join(cause.kind for cause in finding.causes),
        "nominal": [cause.value for cause in finding.causes],
        "estimate": list(finding.estimates),
        "standard_error": list(finding.standard_errors),
        "remaining": finding.remaining,
        "tied_with": list(finding.tied_with),
        "where": [cause.where for cause in finding.causes],
    }
