"""What the check would catch: every bound literal made wrong, on purpose, in copies of the model.

It tells what a validation is worth: whether a fault of a given size is seen in the motions of the
folder's scenarios, whether its cause is named from them alone, and at what size it is first seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.bindings import Binding, bindings, with_literals
from harness.diagnose import Diagnosis, diagnose
from harness.engine import EngineError
from harness.inquiry import InquiryTask, bench
from harness.prepare import prepare
from harness.run import Options, model_files
from harness.segments import BlownUpError
from harness.sidecar import Sidecar
from harness.suspects.bench import scratch
from harness.workers import Failure, Workers
from reference.numeric import Array

SIZES = {"1e-6": 1 + 1e-6, "1e-3": 1 + 1e-3, "5 %": 1.05}
MISTAKES = {"left out": 0.0, "sign": -1.0, "double": 2.0, "half": 0.5}
"""Factors on the literal: the small faults, and the mistakes that people make."""

FACTORS = SIZES | MISTAKES

NAMED, CAUGHT, REFUSED, UNSEEN, MISSED = "named", "caught", "refused", "unseen", "missed"


@dataclass(frozen=True)
class Survey:
    """What the sound model shows: how its motions depend on each literal.

    Attributes:
        found: the bindings, in the order of `slopes`.
        slopes: change of the ends per unit of each literal, (L, N).
        first_caught: relative fault of each literal at which it is first seen; inf: never.
    """

    found: tuple[Binding, ...]
    slopes: Array
    first_caught: Array


@dataclass(frozen=True)
class MutationTask:
    """One literal of one model in one engine, made wrong in one way."""

    inquiry: InquiryTask
    survey: Survey
    index: int
    label: str


@dataclass(frozen=True)
class Mutation:
    """What became of one fault.

    Attributes:
        label: which fault, a key of `SIZES` or `MISTAKES`.
        verdict: `named`, `caught` but not named, `refused` by the engine, `unseen` since no motion
            depends on the literal (the audit of bindings sees it), or `missed`.
        discrepancy: largest defect, relative.
        told: the first cause of the diagnosis.
        estimate_error: error of the estimated fault, relative to the fault; nan where not named.
    """

    system: str
    model: str
    engine: str
    address: str
    label: str
    verdict: str
    discrepancy: float
    told: str
    estimate_error: float
    first_caught: float


def survey(task: InquiryTask) -> Survey:
    """Move every literal of the sound model a little."""
    found = bindings(task.system, task.sidecar)
    with bench(task) as (whole, uncertainty):
        bound = tuple(s for s in whole.suspects if s.hypothesis.kind == "literal")
        slopes = replace(whole, suspects=bound).slopes({})
    seen = np.abs(slopes) * np.array([[abs(b.value) or 1.0] for b in found])
    # What differs by no more than twice the rounding of the ends depends on nothing.
    seen = np.where(seen * 1e-4 > 2 * uncertainty, seen, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(seen > 0, uncertainty / seen, np.inf)
    first = np.min(needed, axis=1, initial=np.inf)
    return Survey(found, slopes, first)


def mutated(task: MutationTask) -> Mutation:
    """Make one literal wrong in one way, and see what the check says."""
    inquiry, known = task.inquiry, task.survey
    binding, first = known.found[task.index], float(known.first_caught[task.index])
    value = binding.value * FACTORS[task.label]
    slopes = {b.address: row for b, row in zip(known.found, known.slopes, strict=True)}

    def result(verdict: str, size: float, told: str, error: float = float("nan")) -> Mutation:
        return _row(task, verdict, size, told, error)

    with scratch() as copies:
        wrong = with_literals(inquiry.sidecar, {binding.address: value}, copies)
        try:
            with bench(replace(inquiry, sidecar=wrong), slopes) as (whole, uncertainty):
                defect = whole.defect({})
                size = float(np.max(np.abs(defect)))
                if not np.any(np.abs(defect) > uncertainty):
                    return result(MISSED if np.isfinite(first) else UNSEEN, size, "")
                answer = diagnose(whole, uncertainty)
        except (EngineError, BlownUpError) as error:
            return result(REFUSED, float("inf"), str(error))
    return _told(answer, binding, value, size, result)


def _row(
    task: MutationTask, verdict: str, size: float, told: str, error: float = float("nan")
) -> Mutation:
    inquiry = task.inquiry
    return Mutation(
        inquiry.system.name, inquiry.sidecar.model.name, inquiry.engine,
        task.survey.found[task.index].address, task.label, verdict, size, told, error,
        float(task.survey.first_caught[task.index]),
    )  # fmt: skip


def _told(
    answer: Diagnosis, binding: Binding, value: float, size: float,
    result: Callable[..., Mutation],
) -> Mutation:  # fmt: skip
    first = answer.findings[0]
    told = " and ".join(cause.cause for cause in first.causes)
    named = binding.address in (told, *first.tied_with) and answer.explained
    error = float("nan")
    for finding in answer.findings:
        if len(finding.causes) == 1 and finding.causes[0].cause == binding.address:
            error = abs(finding.estimates[0] - binding.value) / abs(value - binding.value)
    return result(NAMED if named else CAUGHT, size, told, error)


Progress = Callable[[int, int, Mutation | None], None]


def mutate(folders: Sequence[Path], options: Options, progress: Progress) -> list[Mutation]:
    """Mutate every bound literal of every model of some folders.

    Raises:
        DeclarationError, SidecarError and the like: a folder must be sound to be mutated.
    """
    rows: list[Mutation] = []
    total = 0
    with Workers(options.jobs or 2, options.limit) as workers:
        waiting: dict[Future[Any], Any] = {workers.submit(prepare, f): "folder" for f in folders}
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                about, value = waiting.pop(future), workers.outcome(future)
                if isinstance(about, MutationTask):
                    # An engine that dies of a number has refused it, in its way.
                    dead = isinstance(value, Failure)
                    rows.append(_row(about, REFUSED, float("inf"), value.reason) if dead else value)
                    progress(len(rows), total, rows[-1])
                elif isinstance(value, Failure):
                    raise MutationError(value.reason)
                elif isinstance(about, InquiryTask):
                    tasks = [
                        MutationTask(about, value, index, label)
                        for index in range(len(value.found))
                        for label in FACTORS
                    ]
                    total += len(tasks)
                    waiting |= {workers.submit(mutated, task): task for task in tasks}
                else:
                    for task in _inquiries(value, options):
                        waiting[workers.submit(survey, task)] = task
    labels = list(FACTORS)

    def reading(row: Mutation) -> tuple[str, str, str, str, int]:
        return row.system, row.model, row.engine, row.address, labels.index(row.label)

    return sorted(rows, key=reading)


class MutationError(ValueError):
    """A folder that is not sound to begin with; the message names file and remedy."""


def _inquiries(prepared: Any, options: Options) -> list[InquiryTask]:
    tasks = []
    for found in model_files(prepared.folder):
        if not isinstance(found, Sidecar):
            raise MutationError(found["reason"])
        tasks += [
            InquiryTask(
                prepared.system, found, name, prepared.motions, prepared.scales, prepared.variants
            )
            for name in found.engines
            if (not options.engines or name in options.engines) and found.bindings
        ]
    return tasks
