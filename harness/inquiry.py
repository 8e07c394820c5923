"""Diagnose one model in one engine: evidence, suspects, ranking, and the record of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.coordinates import coordinate_map
from harness.diagnose import Diagnosis, Finding, diagnose
from harness.engines import engines
from harness.evidence import engine_ends, pick, reference_ends
from harness.hypotheses import (
    flip_suspects,
    gravity_suspects,
    literal_suspects,
    reference_suspects,
    scratch,
    together,
)
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
    return {
        "explained": diagnosis.explained,
        "floor": diagnosis.floor,
        "findings": [_record(finding) for finding in diagnosis.findings[:TOLD]],
        "seconds": time.perf_counter() - began,
    }


def diagnosed(task: InquiryTask) -> Diagnosis:
    """The same as objects."""
    engine = engines()[task.engine]
    model = engine.load(task.sidecar.spec(task.engine))
    coordinates = coordinate_map(task.system, task.sidecar, model.coordinates)
    samples = pick(task.motions, task.scales)
    ends, uncertainty = engine_ends(model, coordinates, samples)
    uncertainty = np.where(np.isfinite(uncertainty), uncertainty, np.max(np.abs(ends)))
    defect = ends - reference_ends(samples)
    suspects = [reference_suspects(task.variants, samples)]
    suspects.append(flip_suspects(model, coordinates, samples, ends))
    suspects.append(gravity_suspects(task.sidecar, engine, model, coordinates, samples, ends))
    with scratch() as folder:
        suspects.append(
            literal_suspects(task.system, task.sidecar, engine, coordinates, samples, ends, folder)
        )
        everything = together(*suspects)
        return diagnose(defect, uncertainty, everything.hypotheses, everything.slopes)


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
