"""Audit models of system folders, and robot files, without running a motion.

The jobs are those of a run's audits. With a cache, results of earlier runs and audits are reused.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.checks.not_run import cannot_run
from physics_crosscheck.harness.documents.expanded import relocated
from physics_crosscheck.harness.engines.registry import engines as registered
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, run_jobs
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.planning.model_plan import ModelPlan
from physics_crosscheck.harness.planning.options import Options, Selection
from physics_crosscheck.harness.planning.plan import Plan
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.planning.target_plan import TargetPlan
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import ActingQuantity


@dataclass(frozen=True)
class ModelAudit:
    """The audit of a model in an engine.

    Attributes:
        id: name of the model; its engine is `-` if it cannot be read.
        target: its file, or its folder.
        findings: findings and notes.
        failure: the reason for missing findings; empty otherwise.
        absent: whether the failure is that the engine is not installed.
        left_out: statements of the file that the equations omit.
        acting: quantities that its numbers act as.
        bodies: whether its equations come from bodies, so that no number is bound to a formula.
        mechanics: whether its compiled terms were compared with the equations.
    """

    id: ModelId
    target: Path
    findings: tuple[AuditFinding, ...] = ()
    failure: str = ""
    absent: bool = False
    left_out: tuple[str, ...] = ()
    acting: tuple[ActingQuantity, ...] = ()
    bodies: bool = False
    mechanics: bool = True


def audits(targets: Sequence[Path], options: Options) -> tuple[ModelAudit, ...]:
    """Audit every model of the folders, or the chosen ones, and the robot files."""
    options = replace(options, selection=Selection(models=None))  # no derivation, no diagnosis
    planned = [_TargetAudits(target, options) for target in targets]
    prestart = options.cache is None
    with executor(jobs=options.jobs, limits=options.limits, prestart=prestart) as workers:
        run_jobs(chain.from_iterable(plan.jobs() for plan in planned), workers)
    results = chain.from_iterable(plan.results() for plan in planned)
    return tuple(replace(one, findings=relocated(one.findings, SourceLine)) for one in results)


class _TargetAudits:
    """The audits of a target's models: their jobs and their results."""

    def __init__(self, target: Path, options: Options) -> None:
        self._target, self._options = target, options
        self._results = ResultBuilder(lambda *_: None)
        self._audits: list[ModelAudit] = []

    def jobs(self) -> Iterator[Job[Any]]:
        """Yield the jobs that prepare the target where needed, then audit its models."""
        for place in Plan(self._options, None, self._results).readable([self._target]):
            target = TargetPlan(place, self._options, self._results)
            yield from target.jobs(partial(self._models, target))

    def results(self) -> Iterator[ModelAudit]:
        """Yield the audits in the order of the models, or the reason for a failed preparation."""
        for case in self._results.cases:
            model_id = ModelId(system=case.system, model=case.model, engine=case.engine)
            yield ModelAudit(model_id, self._target, failure=case.reason)
        for audit in self._audits:
            record = self._results.models.get((str(self._target), audit.id.model, audit.id.engine))
            if record is None:
                yield audit
            elif record.audit_failure:
                failure = Failure(record.audit_failure, "")
                yield replace(audit, failure=failure.about(self._target / audit.id.model))
            elif record.audit is not None:
                left_out = () if record.coverage is None else record.coverage.left_out
                yield replace(audit, findings=record.audit, left_out=left_out, acting=record.acting)

    def _models(self, target: TargetPlan) -> Iterator[Job[Any]]:
        system, adapters = target.facts.record.name, registered()
        audit = partial(ModelAudit, target=self._target)
        bodies = target.facts.declares != "energies"
        for file in [self._target] if target.standalone else model_files(self._target):
            name = file.model if isinstance(file, UnreadModel) else model_path(file).name
            if not self._wants(name):
                continue
            if isinstance(file, UnreadModel):
                unread = ModelId(system=system, model=name, engine="-")
                self._audits.append(audit(unread, failure=file.reason))
                continue
            for engine in chosen_engines(file, self._options.engines):
                model_id = ModelId(system=system, model=name, engine=engine)
                if not self._wants(name, engine):
                    continue
                why = cannot_run(adapters, engine, file)
                # The findings of a robot file apply to every engine, also to missing ones.
                if why and not target.standalone:
                    absent = why.outcome is Outcome.ABSENT
                    self._audits.append(audit(model_id, failure=why.reason, absent=absent))
                    continue
                # Its findings go to its record.
                self._audits.append(audit(model_id, bodies=bodies, mechanics=not why))
                model = ModelPlan(target, file, engine, ())
                model.begin()
                if not why:
                    yield from model.checks("audit")

    def _wants(self, model: str, engine: str = "") -> bool:
        return self._options.choice.includes_model(str(self._target), model, engine)
