"""A model of a folder that declares energies: its cases, and what is found of it beside."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from harness.audit.run import Audit, run_audit
from harness.audit.task import audit_task
from harness.baseline.measure import measure, measure_task
from harness.cases.case import (
    CaseTask,
    case_task,
    linearization_task,
    run_case,
    run_linearizations,
)
from harness.cases.not_run import failed_case
from harness.cases.prepare import Prepared
from harness.collected import Jobs
from harness.coverage.count import count_numbers
from harness.diagnosis.task import diagnose_model, diagnosis_task
from harness.plan_model import ModelPlan
from harness.records.baseline import Snapshot
from harness.records.case import Case, CaseId
from harness.records.coverage import Coverage
from harness.records.model import EngineLinearization
from harness.records.outcome import Outcome
from harness.schedule.jobs import Job, Task
from harness.schedule.workers import Failure


class EnergiesModel(ModelPlan):
    """Cases in scenarios, measurements, linearizations, coverage, audit and diagnosis."""

    def _jobs(self) -> Iterator[Job[Any]]:
        self.begin()
        for case in self.cases:
            yield from self._case(case)
            yield from self.work.measure(case, partial(self._measuring, case))
        if self.options.described:
            yield from self._linearizations()
        if self.options.selection is None:
            yield from self._coverage()
        yield from self._audit()

    def _task(self, prepared: Prepared, case: CaseId) -> CaseTask:
        return case_task(
            prepared, self.sidecar, self.engine, case.scenario, self.options.resolution
        )

    def _measuring(
        self, case: CaseId, prepared: Prepared, accepted: Snapshot | None
    ) -> Task[Any, Any]:
        return Task(measure, measure_task(self._task(prepared, case), prepared, accepted))

    def _case(self, case: CaseId) -> Iterator[Job[Any]]:
        def done(value: Case) -> Jobs:
            self.work.found.add(value)
            return self._diagnosis()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, self.folder, failure))

        return self.work.do(
            "case",
            self.key,
            lambda prepared: Task(run_case, self._task(prepared, case)),
            done,
            failed,
            scenario=case.scenario,
        )

    def _diagnosis(self) -> Iterator[Job[Any]]:
        """The diagnosis of a model, once its last case is in and one of them differs."""
        mine = [c for c in self.work.found.cases if c.key == self.key]
        differs = any(case.outcome is Outcome.DIFFERS for case in mine)
        if not self.options.diagnosed or not differs or len(mine) < len(self.cases):
            return
        yield from self.work.do(
            "diagnosis",
            self.key,
            lambda prepared: Task(
                diagnose_model, diagnosis_task(prepared, self.sidecar, self.engine)
            ),
            self.diagnosed,
            self.undiagnosed,
        )

    def _linearizations(self) -> Iterator[Job[Any]]:
        def done(value: tuple[EngineLinearization, ...]) -> Jobs:
            self.work.found.amend(self.key, linearizations=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, linearization_failure=failure.reason)
            return ()

        return self.work.do(
            "linearizations",
            self.key,
            lambda prepared: Task(
                run_linearizations,
                linearization_task(prepared, self.sidecar, self.engine, self.options.resolution),
            ),
            done,
            failed,
        )

    def _audit(self) -> Iterator[Job[Any]]:
        def done(value: Audit) -> Jobs:
            self.work.found.amend(self.key, audit=value.findings, poses=value.poses)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, audit_failure=failure.reason)
            return ()

        return self.work.do(
            "audit",
            self.key,
            lambda prepared: Task(run_audit, audit_task(prepared, self.sidecar, self.engine)),
            done,
            failed,
        )

    def _coverage(self) -> Iterator[Job[Any]]:
        """Apart from the audit: what moved numbers do to an engine must not lose its findings."""

        def done(value: Coverage) -> Jobs:
            self.work.found.amend(self.key, coverage=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return self.work.do(
            "coverage",
            self.key,
            lambda prepared: Task(count_numbers, audit_task(prepared, self.sidecar, self.engine)),
            done,
            failed,
        )
