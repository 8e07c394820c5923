"""Audit every model of some folders, without running a motion.

The jobs are those of a run's audits. With a cache, results of earlier runs and audits are reused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.checks.not_run import hurdle
from physics_crosscheck.harness.engines.registry import engines as registered
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, work
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.modelfiles.choice import Choice
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.bodies_plan import BodiesModel
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.planning.energies_plan import EnergiesModel
from physics_crosscheck.harness.planning.folder_plan import FolderWork
from physics_crosscheck.harness.planning.options import Options, Selection
from physics_crosscheck.harness.planning.result_builder import Collected
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import Outcome

AUDIT_ONLY = Selection(models=None)
"""Selects no derivation and no diagnosis."""


@dataclass(frozen=True)
class ModelAudit:
    """The audit of a model in an engine.

    Attributes:
        id: the model; its engine is `-` where it can't be read.
        findings: and notes.
        failure: why there are no findings; empty otherwise.
        absent: whether the failure is that the engine is not installed.
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
    cache: Cache | None = None,
    choice: Choice = Choice(),  # noqa: B008  # frozen
) -> tuple[ModelAudit, ...]:
    """Audit every model of the folders, or the chosen ones; other arguments are those of a run."""
    options = Options(
        engines=tuple(engines),
        jobs=jobs,
        limits=limits or Limits(),
        selection=AUDIT_ONLY,
        cache=cache,
        choice=choice,
    )
    of_folders = [_FolderAudits(folder, options) for folder in folders]
    with executor(jobs=options.jobs, limits=options.limits, sure=cache is None) as workers:
        work(chain.from_iterable(one.jobs() for one in of_folders), workers)
    return tuple(chain.from_iterable(one.results() for one in of_folders))


class _FolderAudits:
    """The audits of a folder's models: their jobs and their results."""

    def __init__(self, folder: Path, options: Options) -> None:
        self._folder, self._options = folder, options
        self._found = Collected(lambda *_: None)
        self._audits: list[ModelAudit] = []

    def jobs(self) -> Iterator[Job[Any]]:
        """Yield the jobs that prepare the folder where needed, then audit its models."""
        place = FolderWork(self._folder, self._options, {}, self._found)
        yield from place.begun(partial(self._models, place))

    def results(self) -> Iterator[ModelAudit]:
        """Yield the audits in the order of the models; or why the folder can't be prepared."""
        for case in self._found.cases:
            one = ModelId(system=case.system, model=case.model, engine=case.engine)
            yield ModelAudit(one, failure=case.reason)
        for audit in self._audits:
            record = self._found.models.get((str(self._folder), audit.id.model, audit.id.engine))
            if record is None:
                yield audit
            elif record.audit is not None:
                yield ModelAudit(audit.id, record.audit)
            elif record.audit_failure:
                failure = Failure(record.audit_failure, "")
                yield ModelAudit(audit.id, failure=failure.about(self._folder / audit.id.model))

    def _models(self, place: FolderWork) -> Iterator[Job[Any]]:
        system, known = place.facts.record.name, registered()
        model = BodiesModel if place.facts.bodies else EnergiesModel
        for file in model_files(self._folder):
            if not self._wants(file):
                continue
            if isinstance(file, UnreadModel):
                unread = ModelId(system=system, model=file.model, engine="-")
                self._audits.append(ModelAudit(unread, failure=file.reason))
                continue
            for engine in chosen_engines(file, self._options.engines):
                one = ModelId(system=system, model=file.model.name, engine=engine)
                if not self._wants(file, engine):
                    continue
                if why := hurdle(known, engine, file):
                    absent = why.outcome is Outcome.ABSENT
                    self._audits.append(ModelAudit(one, failure=why.reason, absent=absent))
                    continue
                self._audits.append(ModelAudit(one))  # its findings go to its record
                yield from model(place, known, file, engine, ()).audit()

    def _wants(self, file: Sidecar | UnreadModel, engine: str = "") -> bool:
        """Return whether a model is to be audited, in an engine or in any."""
        name = file.model if isinstance(file, UnreadModel) else file.model.name
        return self._options.choice.includes_model(str(self._folder), name, engine)
