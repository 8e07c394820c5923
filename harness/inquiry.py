"""Diagnose one model in one engine: evidence, suspects, ranking, and the record of it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from harness.case import load
from harness.coordinates import CoordinateMap
from harness.diagnose import Diagnosis, Finding, diagnose
from harness.engine import Engine, Model
from harness.engines import engines
from harness.evidence import Sample, engine_ends, pick, reference_ends
from harness.hypotheses import (
    Suspects,
    exchange_suspects,
    flip_suspects,
    gravity_suspects,
    literal_suspects,
    reference_suspects,
    remedy_suspects,
    scratch,
    together,
    zero_suspects,
)
from harness.redraw import RedrawTask, redraw
from harness.sidecar import Sidecar
from reference.motion import Motion
from reference.numeric import Array
from reference.system import System
from reference.variants import Variants

TOLD = 8
"""Findings told: the ranking's tail says nothing."""


@dataclass(frozen=True)
class InquiryTask:
    """Everything a worker needs to diagnose one model in one engine."""

    system: System
    sidecar: Sidecar
    engine: str
    motions: Mapping[str, Motion]
    scales: Mapping[str, Array]
    variants: Variants


def inquire(task: InquiryTask) -> dict[str, Any]:
    """Name the cause of a model's discrepancy, from its motions alone.

    Raises:
        EngineError, SidecarError, PlaceError, BlownUpError: naming what could not be run.
    """
    began = time.perf_counter()
    diagnosis = diagnosed(task)
    shown = RedrawTask(
        task.system, task.sidecar, task.engine, task.motions, task.scales, task.variants
    )
    return {
        "explained": diagnosis.explained,
        "floor": diagnosis.floor,
        "findings": [_record(finding) for finding in diagnosis.findings[:TOLD]],
        "redrawn": redraw(shown, diagnosis),
        "seconds": time.perf_counter() - began,
    }


def diagnosed(task: InquiryTask) -> Diagnosis:
    """The same as objects."""
    engine = engines()[task.engine]
    model, coordinates = load(task.system, task.sidecar, task.engine)
    samples = pick(task.motions, task.scales)
    ends, uncertainty = engine_ends(model, coordinates, samples)
    uncertainty = np.where(np.isfinite(uncertainty), uncertainty, np.max(np.abs(ends)))
    defect = ends - reference_ends(samples)
    with scratch() as folder:
        suspects = everything(task, engine, model, coordinates, samples, ends, folder)
        return diagnose(defect, uncertainty, suspects.hypotheses, suspects.slopes)


def everything(
    task: InquiryTask, engine: Engine, model: Model, coordinates: CoordinateMap,
    samples: Sequence[Sample], ends: Array, folder: Path, known: Array | None = None,
) -> Suspects:  # fmt: skip
    """All that might be wrong with a model, whose segments end at `ends`.

    Args:
        folder: for copies of the model.
        known: slopes of the literals, where a model close by has shown them already.
    """
    sidecar = task.sidecar
    return together(
        reference_suspects(task.variants, samples),
        exchange_suspects(task.variants, samples),
        flip_suspects(model, coordinates, samples, ends),
        zero_suspects(sidecar, engine, model, coordinates, samples, ends),
        gravity_suspects(sidecar, engine, model, coordinates, samples, ends),
        remedy_suspects(sidecar, engine, model, coordinates, samples, ends),
        literal_suspects(task.system, sidecar, engine, coordinates, samples, ends, folder, known),
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
