"""Mechanism after mechanism: each judged, in processes of their own, whatever becomes of one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np
from msgspec.structs import replace

from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.faults import plant
from campaigns.mechanisms.mechanism import Mechanism
from campaigns.mechanisms.results import Result
from campaigns.mechanisms.trial import Judged, Posed, examine, pose, undone
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.records.outcome import Outcome

RESOLUTION = 1e-9

SECONDS = 120
"""Of a processor, for one mechanism, before its process is ended."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Of a census; `faults`: how many are planted in each mechanism."""

    seed: int
    engine: str = ""
    joints: int = 5
    segments: int = 31
    faults: int = 0


def study(options: Options, index: int) -> Result:
    """Draw and judge the mechanism of that number; what goes wrong is told in the result."""
    began = process_time()
    mechanism = draw(options.seed, index, options.joints, options.engine)
    result = Result(
        index=index, group=mechanism.group, joints=len(mechanism.links), outcome="FAILED"
    )
    try:
        result = _studied(options, mechanism, result)
    except Exception as error:
        result = replace(result, reason=f"{type(error).__name__}: {error}")
    return replace(result, seconds=process_time() - began)


def _studied(options: Options, mechanism: Mechanism, result: Result) -> Result:
    posed = pose(mechanism, options.segments)
    found = examine(posed, mechanism, RESOLUTION)
    verdict = found.verdict
    outside = int(np.sum(found.ratios > 1))
    explained = _explained(posed, found) if outside else ""
    return replace(
        result,
        outcome=str(verdict.outcome),
        discrepancy=verdict.discrepancy,
        uncertainty=verdict.uncertainty,
        worst=float(np.max(found.ratios)),
        limits=found.ratios.size,
        outside=outside,
        explained=explained,
        truth=float(np.max(posed.truth.error / found.uncertainty)),
        reason=verdict.reason,
        faults=plant(posed, np.random.default_rng((options.seed, result.index, 1)), options.faults),
    )


def _explained(posed: Posed, found: Judged) -> str:
    """What the engine does to the file's digits, if nothing is wrong once that is undone."""
    settings = undone(posed.mechanism)
    if not settings:
        return ""
    again = examine(posed, posed.mechanism, RESOLUTION, settings)
    if again.verdict.outcome is not Outcome.AGREES or np.any(again.ratios > 1):
        return ""
    felt = found.verdict.largest_discrepancy
    return f"the engine's own, undone by {', '.join(settings)}; felt at {felt:.0e}"


def census(options: Options, indices: Sequence[int], jobs: int) -> Iterator[Result]:
    """Results as they come, in order; a process that dies or hangs costs its mechanism alone."""
    with Workers(jobs, Limits(seconds=SECONDS)) as workers:
        tasks = [workers.submit(partial(study, options), index) for index in indices]
        for index, task in zip(indices, tasks, strict=True):
            found = workers.outcome(task)
            if isinstance(found, Failure):
                found = Result(
                    index=index, group="lost", joints=0, outcome="FAILED", reason=found.reason
                )
            yield found
