"""A model of a folder that declares energies: its cases, and what is found of it beside.

What workers run is imported where a task is made of it: nothing is where all of it is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from physics_crosscheck.harness.cases.not_run import failed_case
from physics_crosscheck.harness.collected import Jobs
from physics_crosscheck.harness.plan_model import ModelPlan
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import Audit
from physics_crosscheck.harness.schedule.jobs import Job, Task
from physics_crosscheck.harness.schedule.workers import Failure

if TYPE_CHECKING:
    from physics_crosscheck.harness.audit.task import AuditTask
    from physics_crosscheck.harness.cases.case import CaseTask
    from physics_crosscheck.harness.cases.prepare import Prepared


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
        from physics_crosscheck.harness.cases.case import case_task

        return case_task(
            prepared, self.sidecar, self.engine, case.scenario, self.options.resolution
        )

    def _audited(self, prepared: Prepared) -> AuditTask:
        from physics_crosscheck.harness.audit.task import audit_task

        return audit_task(prepared, self.sidecar, self.engine, self.options.resolution)

    def _measuring(
        self, case: CaseId, prepared: Prepared, accepted: Snapshot | None
    ) -> Task[Any, Any]:
        from physics_crosscheck.harness.baseline.measure import measure, measure_task

        return Task(measure, measure_task(self._task(prepared, case), prepared, accepted))

    def _case(self, case: CaseId) -> Iterator[Job[Any]]:
        def done(value: Case) -> Jobs:
            self.work.found.add(value)
            return self._diagnosis()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, self.folder, failure))

        def make(prepared: Prepared) -> Task[Any, Any]:
            from physics_crosscheck.harness.cases.case import run_case

            return Task(run_case, self._task(prepared, case))

        return self.work.do(
            "case",
            self.key,
            make,
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

        def make(prepared: Prepared) -> Task[Any, Any]:
            from physics_crosscheck.harness.diagnosis.task import diagnose_model, diagnosis_task

            return Task(diagnose_model, diagnosis_task(prepared, self.sidecar, self.engine))

        yield from self.work.do("diagnosis", self.key, make, self.diagnosed, self.undiagnosed)

    def _linearizations(self) -> Iterator[Job[Any]]:
        def done(value: tuple[EngineLinearization, ...]) -> Jobs:
            self.work.found.amend(self.key, linearizations=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, linearization_failure=failure.reason)
            return ()

        def make(prepared: Prepared) -> Task[Any, Any]:
            from physics_crosscheck.harness.cases.case import linearization_task, run_linearizations

            resolution = self.options.resolution
            task = linearization_task(prepared, self.sidecar, self.engine, resolution)
            return Task(run_linearizations, task)

        return self.work.do("linearizations", self.key, make, done, failed)

    def _audit(self) -> Iterator[Job[Any]]:
        def done(value: Audit) -> Jobs:
            self.work.found.amend(self.key, audit=value.findings, poses=value.poses)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, audit_failure=failure.reason)
            return ()

        def make(prepared: Prepared) -> Task[Any, Any]:
            from physics_crosscheck.harness.audit.run import run_audit

            return Task(run_audit, self._audited(prepared))

        return self.work.do("audit", self.key, make, done, failed)

    def _coverage(self) -> Iterator[Job[Any]]:
        """Apart from the audit: what moved numbers do to an engine must not lose its findings."""

        def done(value: Coverage) -> Jobs:
            self.work.found.amend(self.key, coverage=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        def make(prepared: Prepared) -> Task[Any, Any]:
            from physics_crosscheck.harness.coverage.count import count_numbers

            return Task(count_numbers, self._audited(prepared))

        return self.work.do("coverage", self.key, make, done, failed)
