"""Diagnosis of one model in one engine: samples, hypotheses, ranking, and its record."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.diagnosis.corrected import causes, correct_motion
from physics_crosscheck.harness.diagnosis.diagnose import Ranking, diagnose
from physics_crosscheck.harness.diagnosis.fit import Fit
from physics_crosscheck.harness.diagnosis.hypotheses import TrialModel, everything
from physics_crosscheck.harness.diagnosis.hypotheses.trial import scratch
from physics_crosscheck.harness.diagnosis.samples import (
    engine_ends,
    freedoms,
    reference_ends,
    sample_segments,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.finding import Diagnosis, Explanation
from physics_crosscheck.reference.mechanism.numeric import Array

RECORDED = 8
"""Maximum number of explanations in the record."""


def diagnose_model(task: SystemTask) -> Diagnosis:
    """Find the cause of a model's discrepancy, from its motions alone.

    A degree of freedom that the equations lack has no value to fit. It is named if no cause
    explains the motion, or if the discrepancy does not show in the coordinates of the equations.

    Raises:
        EngineError, SidecarError, LocationError, BlownUpError: for a failing run.
    """
    began = time.perf_counter()
    with trial_model(task) as (whole, uncertainty):
        shows = bool(np.any(np.abs(whole.defect({})) > uncertainty))
        ranking = diagnose(whole, uncertainty) if shows else Ranking((), False, 1.0)
        free: tuple[str, ...] = ()
        if not ranking.explained:
            free = freedoms(whole.model, whole.coordinates, whole.samples)
        corrected = correct_motion(whole, task.target.motions, ranking)
    if free:
        return Diagnosis(
            failure=(
                "the model has a degree of freedom that the equations lack, or a "
                f"constraint that does not hold: {', '.join(free)}"
            ),
            seconds=time.perf_counter() - began,
        )
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(explanation(fit) for fit in ranking.fits[:RECORDED]),
        floor=number(ranking.floor),
        corrected=corrected,
        seconds=time.perf_counter() - began,
    )


def explanation(fit: Fit) -> Explanation:
    """Build the record of a fit."""
    return Explanation(causes=causes(fit), remaining=fit.remaining, tied_with=fit.tied_with)


def ranked(task: SystemTask) -> Ranking:
    """Rank all fits, without a corrected motion."""
    with trial_model(task) as (trial, uncertainty):
        return diagnose(trial, uncertainty)


@contextmanager
def trial_model(
    task: SystemTask, known_slopes: Mapping[CauseId, Array] | None = None
) -> Iterator[tuple[TrialModel, Array]]:
    """Yield a model to try in an engine, with the uncertainty of its end states.

    Args:
        task: the model and its motions.
        known_slopes: slopes of literals, if known from a similar model.
    """
    engine = engines()[task.engine]
    model, coordinates = task.load()
    samples = sample_segments(task.target.motions)
    ends, uncertainty = engine_ends(model, coordinates, samples)
    # Where no limit is known, the error may be as large as the largest discrepancy.
    largest = np.max(np.abs(ends - reference_ends(samples)))
    uncertainty = np.where(np.isfinite(uncertainty), uncertainty, largest)
    # Add the reference's error bound and rounding error, as in the verdict.
    bounds = [np.tile(some.bound / some.unit, len(some.t)) for some in samples]
    uncertainty = np.maximum(uncertainty + np.concatenate(bounds), EPSILON)
    candidates = everything(
        task.target.system, task.declared, model, coordinates, task.target.variants
    )
    with scratch() as folder:
        trial = TrialModel(
            sidecar=task.declared,
            engine=engine,
            model=model,
            coordinates=coordinates,
            variants=task.target.variants,
            samples=samples,
            ends=ends,
            candidates=candidates,
            folder=folder,
            known_slopes=known_slopes or {},
        )
        yield trial, uncertainty
