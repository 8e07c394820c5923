"""Judgement of many mechanisms in worker processes; a crash costs a single mechanism."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np
from msgspec.structs import replace

from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.faults import plant_faults
from campaigns.mechanisms.mechanism import RandomMechanism
from campaigns.mechanisms.results import MechanismResult
from campaigns.mechanisms.trial import (
    MechanismCase,
    MechanismJudgement,
    corrective_settings,
    judge_motion,
    prepare_case,
)
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.records.outcome import Outcome

RESOLUTION = 1e-9

SECONDS = 120
"""Limit of processor time for a mechanism; its process ends then."""


@dataclass(frozen=True, kw_only=True)
class CensusOptions:
    """Options of a census; `faults` is the number of faults in each mechanism."""

    seed: int
    engine: str = ""
    joints: int = 5
    segments: int = 31
    faults: int = 0


def study(options: CensusOptions, index: int) -> MechanismResult:
    """Draw and judge the mechanism of an index; an exception becomes the reason of the result."""
    began = process_time()
    mechanism = draw(options.seed, index, options.joints, options.engine)
    result = MechanismResult(
        index=index, group=mechanism.group, joints=len(mechanism.links), outcome="FAILED"
    )
    try:
        result = _judge(options, mechanism, result)
    except Exception as error:
        result = replace(result, reason=f"{type(error).__name__}: {error}")
    return replace(result, seconds=process_time() - began)


def _judge(
    options: CensusOptions, mechanism: RandomMechanism, result: MechanismResult
) -> MechanismResult:
    case = prepare_case(mechanism, options.segments)
    judgement = judge_motion(case, mechanism, RESOLUTION)
    verdict = judgement.verdict
    outside = int(np.sum(judgement.ratios > 1))
    explained = _engine_loss(case, judgement) if outside else ""
    return replace(
        result,
        outcome=str(verdict.outcome),
        discrepancy=verdict.discrepancy,
        uncertainty=verdict.uncertainty,
        worst=float(np.max(judgement.ratios)),
        limits=judgement.ratios.size,
        outside=outside,
        explained=explained,
        truth=float(np.max(case.truth.error / judgement.uncertainty)),
        reason=verdict.reason,
        faults=plant_faults(
            case, np.random.default_rng((options.seed, result.index, 1)), options.faults
        ),
    )


def _engine_loss(case: MechanismCase, judgement: MechanismJudgement) -> str:
    """Return a text on the digits that the engine loses; empty if they don't explain all errors."""
    settings = corrective_settings(case.mechanism)
    if not settings:
        return ""
    again = judge_motion(case, case.mechanism, RESOLUTION, settings)
    if again.verdict.outcome is not Outcome.AGREES or np.any(again.ratios > 1):
        return ""
    effect = judgement.verdict.largest_discrepancy
    return f"digits lost by the engine, corrected by {', '.join(settings)}; effect {effect:.0e}"


def census(options: CensusOptions, indices: Sequence[int], jobs: int) -> Iterator[MechanismResult]:
    """Yield the results in order; a process that dies or hangs costs a single mechanism."""
    with Workers(jobs, Limits(seconds=SECONDS)) as workers:
        tasks = [workers.submit(partial(study, options), index) for index in indices]
        for index, task in zip(indices, tasks, strict=True):
            result = workers.outcome(task)
            if isinstance(result, Failure):
                result = MechanismResult(
                    index=index, group="lost", joints=0, outcome="FAILED", reason=result.reason
                )
            yield result
