"""What the check would catch: models made wrong, on purpose, in copies.

Every bound literal is made wrong by three sizes and four factors, and every known mistake
(`harness.mutation.mistakes`) is made wherever a model has a place for it. It tells what a
validation is worth: whether a fault is seen in the motions of the folder's scenarios, whether its
cause is named from them alone, and at what size it is first seen.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.cases.case import load
from harness.cases.prepare import prepare
from harness.diagnosis.diagnose import Diagnosis, diagnose
from harness.diagnosis.hypotheses.trial import scratch
from harness.diagnosis.task import DiagnosisTask, trial_model
from harness.engines.protocol import EngineError
from harness.engines.registry import engines
from harness.files.bindings import bindings
from harness.files.sidecar import Sidecar
from harness.mutation.mistakes import Edit, Mistake, Subject, known_mistakes
from harness.numerics.full_run import follow
from harness.numerics.segments import BlownUpError
from harness.run import Options, model_files
from harness.schedule.workers import Failure, Workers
from reference.numeric import Array

SIZES = {"1e-6": 1 + 1e-6, "1e-3": 1 + 1e-3, "5 %": 1.05}
FACTORS = {"left out": 0.0, "sign": -1.0, "double": 2.0, "half": 0.5}
"""What a literal is multiplied by: the small faults, and the mistakes that people make."""

FAULTS = SIZES | FACTORS

RESOLUTION = 1e-9
"""A model whose motions are known no better than this does not agree,"""

BESIDE = 10.0
"""unless they are known no worse, by this factor, than those of the sound model."""

NAMED, CAUGHT, REFUSED, UNSEEN, MISSED = "named", "caught", "refused", "unseen", "missed"
AGREES = "agrees"

LITERAL, KNOWN, SOUND = "literal", "mistake", "no mistake"
"""Kinds of rows."""


@dataclass(frozen=True)
class Survey:
    """What the sound model shows: how its motions depend on each literal, and what can go wrong.

    Attributes:
        addresses: of the bound literals, in the order of `slopes`.
        slopes: change of the ends per unit of each literal, (L, N).
        first_caught: relative fault of each literal at which it is first seen, (L,); inf: never.
        ends, uncertainty: of the sound model, (N,).
        faults: everything that is to be made wrong.
    """

    addresses: tuple[str, ...]
    slopes: Array
    first_caught: Array
    ends: Array
    uncertainty: Array
    faults: tuple[Mistake, ...]


@dataclass(frozen=True)
class MutationTask:
    """One model in one engine, made wrong in one way."""

    inquiry: DiagnosisTask
    survey: Survey
    fault: Mistake


@dataclass(frozen=True)
class Mutation:
    """What became of one fault.

    Attributes:
        system, model, engine: what was made wrong.
        kind: `literal`; `mistake`, a known one; or `no mistake`, another step or integrator.
        name: a key of `SIZES` or `FACTORS` for a literal, otherwise what the user did.
        place: the literal's address, the joint or the setting.
        verdict: `named`; `caught` (it does not agree) but not named; `refused` by the engine;
            `unseen` since no motion depends on it (the audit may see it); or `missed`. Of no
            mistake: `agrees` if it does.
        discrepancy: largest defect, relative.
        told: the first cause of the diagnosis, the engine's refusal, or the raw errors of a plain
            run before and after.
        estimate_error: error of the estimated fault, relative to the fault; nan where not named.
        first_caught: for a literal, the relative fault at which it is first seen; for a mistake,
            the share of it; inf: never.
        seconds: processor time that it took.
    """

    system: str
    model: str
    engine: str
    kind: str
    name: str
    place: str
    verdict: str
    discrepancy: float
    told: str
    estimate_error: float
    first_caught: float
    seconds: float = 0.0


def survey(task: DiagnosisTask) -> Survey:
    """Move every literal of the sound model a little, and look for what can be made wrong.

    Raises:
        MutationError: for a model that is not sound to begin with.
    """
    found = bindings(task.system, task.sidecar)
    with trial_model(task) as (whole, uncertainty):
        wrong = float(np.max(np.abs(whole.defect({})) - uncertainty))
        if wrong > 0:
            raise MutationError(
                f"{task.sidecar.model}: it differs from its equations already in {task.engine}; to"
                " show what would be caught it must be right: see `crosscheck run`"
            )
        bound = tuple(s for s in whole.candidates if s.hypothesis.kind == "literal")
        slopes = replace(whole, candidates=bound).slopes({})
        known = known_mistakes(Subject(task, whole.model, whole.coordinates, found))
    sizes = np.array([abs(b.value) or 1.0 for b in found])
    seen = np.abs(slopes) * sizes[:, None]
    # What differs by no more than twice the rounding of the ends depends on nothing.
    seen = np.where(seen * 1e-4 > 2 * uncertainty, seen, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(seen > 0, uncertainty / seen, np.inf)
    first = np.min(needed, axis=1, initial=np.inf)
    # A number with the other sign may be as good as an axis that points the other way.
    mirrored = {f"axis of {name} reversed" for name in whole.model.coordinates}
    literals = tuple(
        Mistake(
            label,
            b.address,
            Edit({b.address: b.value * factor}),
            frozenset({b.address, *(mirrored if factor < 0 else ())}),
        )
        for b in found
        if b.value
        for label, factor in FAULTS.items()
    )
    addresses = tuple(b.address for b in found)
    return Survey(addresses, slopes, first, whole.ends, uncertainty, (*literals, *known))


def mutated(task: MutationTask) -> Mutation:
    """Make one model wrong in one way, and see what the check says."""
    began = time.process_time()
    return replace(_checked(task), seconds=time.process_time() - began)


def _checked(task: MutationTask) -> Mutation:
    inquiry, known, fault = task.inquiry, task.survey, task.fault
    # A model that is nearly right depends on its literals as the sound one does.
    near = dict(zip(known.addresses, known.slopes, strict=True)) if fault.name in SIZES else None
    with scratch() as copies:
        wrong = replace(inquiry, sidecar=fault.edit.made(inquiry.sidecar, inquiry.engine, copies))
        try:
            with trial_model(wrong, near) as (whole, uncertainty):
                defect = np.abs(whole.defect({}))
                row = _row(task, float(np.max(defect)))
                moved = np.abs(whole.ends - known.ends) - known.uncertainty
                if fault.sound and np.all(moved <= uncertainty) and _known(uncertainty, known):
                    return replace(row, verdict=AGREES, told=_raw_errors(inquiry, wrong))
                if not np.any(defect > uncertainty):
                    if not _known(uncertainty, known):
                        return replace(row, told=f"unresolved, to {np.max(uncertainty):.0e}")
                    return replace(row, verdict=_unnoticed(row, bool(np.any(moved > uncertainty))))
                if row.kind != LITERAL:
                    seen = defect > uncertainty
                    share = float(np.min(uncertainty[seen] / defect[seen]))
                    row = replace(row, first_caught=share)
                return _told(row, task, diagnose(whole, uncertainty))
        except (EngineError, BlownUpError) as error:
            return replace(_row(task, float("inf")), verdict=REFUSED, told=str(error))


def _row(task: MutationTask, size: float) -> Mutation:
    """The row of a fault before anything is known of it but the size of its discrepancy."""
    inquiry, fault = task.inquiry, task.fault
    literal = fault.place in task.survey.addresses and fault.name in FAULTS
    kind = LITERAL if literal else SOUND if fault.sound else KNOWN
    first = float("inf")
    if literal:
        first = float(task.survey.first_caught[task.survey.addresses.index(fault.place)])
    return Mutation(
        inquiry.system.name,
        inquiry.sidecar.model.name,
        inquiry.engine,
        kind,
        fault.name,
        fault.place,
        CAUGHT,
        size,
        "",
        float("nan"),
        first,
    )


def _known(uncertainty: Array, sound: Survey) -> bool:
    """Whether motions are known well enough to agree."""
    enough = max(RESOLUTION, BESIDE * float(np.max(sound.uncertainty)))
    return float(np.max(uncertainty)) <= enough


def _unnoticed(row: Mutation, moved: bool) -> str:
    """Missed if the motions depend on it, unseen if they don't."""
    depends = np.isfinite(row.first_caught) if row.kind == LITERAL else moved
    return MISSED if depends else UNSEEN


def _told(row: Mutation, task: MutationTask, answer: Diagnosis) -> Mutation:
    """What the diagnosis says of a fault, and whether it is right.

    Two causes together name a fault if both are of those that may be named for it.
    """
    if not answer.findings:
        return row
    first, wanted = answer.findings[0], task.fault.causes
    causes = [cause.cause for cause in first.causes]
    right = wanted.issuperset(causes) or bool(len(causes) == 1 and wanted & {*first.tied_with})
    verdict = NAMED if right and answer.explained else CAUGHT
    error = float("nan")
    if row.kind == LITERAL:
        binding = next(
            b for b in bindings(task.inquiry.system, task.inquiry.sidecar) if b.address == row.place
        )
        wrong = task.fault.edit.literals[row.place]
        for finding in answer.findings:
            if [cause.cause for cause in finding.causes] == [row.place]:
                error = abs(finding.estimates[0] - binding.value) / abs(wrong - binding.value)
    return replace(row, verdict=verdict, told=" and ".join(causes), estimate_error=error)


def _raw_errors(before: DiagnosisTask, after: DiagnosisTask) -> str:
    """Errors of a plain run at the step stated, before and after, of the scenario that moves least.

    Where it moves much, two steps may end anywhere.
    """
    motion = min(before.motions.values(), key=lambda m: float(np.max(m.amplitude)))
    n = len(before.system.q)
    told = []
    for task in (before, after):
        model, coordinates = load(task.system, task.sidecar, task.engine)
        t, states = follow(model, coordinates, motion, model.step)
        off = np.abs(states - motion.at(t))[:, :n]
        error = float(np.max(off / np.maximum(motion.amplitude[:n], 1e-300)))
        told.append(f"{error:.2%}" if error > 1e-4 else f"{error:.1e}")
    return f"raw error {told[0]} -> {told[1]}"


Progress = Callable[[int, int, Mutation | None], None]
"""Called with (faults done, faults in all or 0 while that is unknown, the one just done)."""


def mutate(folders: Sequence[Path], options: Options, progress: Progress) -> list[Mutation]:
    """Make every model of some folders wrong in every known way; engines not there are left out.

    Raises:
        MutationError: a folder must be sound to be mutated; the message names file and remedy.
    """
    rows: list[Mutation] = []
    order: dict[tuple[str, str, str, str, str, str], int] = {}
    with Workers(options.jobs or 2, options.limit) as workers:
        waiting: dict[Future[Any], Any] = {workers.submit(prepare, f): "folder" for f in folders}
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                about, value = waiting.pop(future), workers.outcome(future)
                if isinstance(about, MutationTask):
                    # An engine that dies of a number has refused it, in its way.
                    dead = isinstance(value, Failure)
                    refusal = replace(_row(about, float("inf")), verdict=REFUSED)
                    rows.append(replace(refusal, told=value.reason) if dead else value)
                    unknown = any(not isinstance(a, MutationTask) for a in waiting.values())
                    progress(len(rows), 0 if unknown else len(order), rows[-1])
                elif isinstance(value, Failure):
                    raise MutationError(value.reason)
                elif isinstance(about, DiagnosisTask):
                    for fault in value.faults:
                        # Sent once for each fault: without all the others.
                        task = MutationTask(about, replace(value, faults=()), fault)
                        order[_key(_row(task, 0.0))] = len(order)
                        waiting[workers.submit(mutated, task)] = task
                else:
                    for inquiry in _inquiries(value, options):
                        waiting[workers.submit(survey, inquiry)] = inquiry
    return sorted(rows, key=lambda r: (r.system, r.model, r.engine, order[_key(r)]))


def _key(row: Mutation) -> tuple[str, str, str, str, str, str]:
    return row.system, row.model, row.engine, row.kind, row.place, row.name


class MutationError(ValueError):
    """A folder that is not sound to begin with; the message names file and remedy."""


def _inquiries(prepared: Any, options: Options) -> list[DiagnosisTask]:
    tasks = []
    known = engines()
    for found in model_files(prepared.folder):
        if not isinstance(found, Sidecar):
            raise MutationError(found["reason"])
        tasks += [
            DiagnosisTask(
                prepared.system, found, name, prepared.motions, prepared.scales, prepared.variants
            )
            for name in found.engines
            if (not options.engines or name in options.engines)
            and name in known
            and known[name].version() is not None
        ]
    return tasks
