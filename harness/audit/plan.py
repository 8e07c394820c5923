"""Audits of every model of some folders, without running a motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from harness.audit.run import run_audit
from harness.audit.task import audit_task
from harness.cases.multibody import PreparedTree, prepare_folder, survey_file
from harness.cases.not_run import hurdle
from harness.cases.prepare import Prepared
from harness.engines.registry import engines as registered
from harness.files.model_files import UnreadModel, chosen_engines, model_files
from harness.files.sidecar import Sidecar
from harness.records.case import ModelId
from harness.records.finding import AuditFinding
from harness.records.outcome import Outcome
from harness.records.survey import Audit, FileSurvey
from harness.schedule.chosen import executor
from harness.schedule.failure import Failure
from harness.schedule.jobs import Job, Task, work
from harness.schedule.limits import Limits


@dataclass(frozen=True)
class ModelAudit:
    """What the audit of a model in an engine has to say.

    Attributes:
        id: the model; `-` for its engine where it can't be read.
        findings: and notes.
        failure: why there are none; empty otherwise.
        absent: whether that is since the engine is not installed.
    """

    id: ModelId
    findings: tuple[AuditFinding, ...] = ()
    failure: str = ""
    absent: bool = False


def audits(
    folders: Sequence[Path],
    *,
    engines: Sequence[str] = (),
    jobs: int = 0,
    limits: Limits | None = None,
) -> tuple[ModelAudit, ...]:
    """Audit every model of the folders; `engines` and the limits are those of a run."""
    found: list[dict[ModelId, ModelAudit]] = [{} for _ in folders]
    with executor(jobs=jobs, limits=limits) as workers:
        plans = zip(folders, found, strict=True)
        work((_folder(folder, engines, into) for folder, into in plans), workers)
    return tuple(one for models in found for one in models.values())


def _folder(
    folder: Path, only: Sequence[str], found: dict[ModelId, ModelAudit]
) -> Job[Prepared | PreparedTree]:
    def failed(failure: Failure) -> tuple[()]:
        one = ModelId(system=folder.name, model="system.py", engine="-")
        found[one] = ModelAudit(one, failure=failure.about(folder / one.model))
        return ()

    preparing = partial(prepare_folder, described=False)
    return Job(task=Task(preparing, folder), done=partial(_models, only, found), failed=failed)


def _models(
    only: Sequence[str], found: dict[ModelId, ModelAudit], prepared: Prepared | PreparedTree
) -> Iterator[Job[Any]]:
    system, known = prepared.system.name, registered()
    for file in model_files(prepared.folder):
        if isinstance(file, UnreadModel):
            one = ModelId(system=system, model=file.model, engine="-")
            found[one] = ModelAudit(one, failure=file.reason)
            continue
        for engine in chosen_engines(file, only):
            one = ModelId(system=system, model=file.model.name, engine=engine)
            why = hurdle(known, engine, file)
            if why is not None:
                absent = why.outcome is Outcome.ABSENT
                found[one] = ModelAudit(one, failure=why.reason, absent=absent)
                continue
            found[one] = ModelAudit(one)  # keeps its place
            yield _audit(one, prepared, file, found)


def _audit(
    one: ModelId,
    prepared: Prepared | PreparedTree,
    sidecar: Sidecar,
    found: dict[ModelId, ModelAudit],
) -> Job[Any]:
    def done(audit: Audit | FileSurvey) -> tuple[()]:
        found[one] = ModelAudit(one, audit.findings)
        return ()

    def failed(failure: Failure) -> tuple[()]:
        found[one] = ModelAudit(one, failure=failure.about(sidecar.model))
        return ()

    if isinstance(prepared, PreparedTree):
        return Job(task=Task(survey_file, sidecar), done=done, failed=failed)
    task = Task(run_audit, audit_task(prepared, sidecar, one.engine))
    return Job(task=task, done=done, failed=failed)
