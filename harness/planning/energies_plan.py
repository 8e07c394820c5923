"""Jobs of a model in a folder that declares energies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.planning.model_plan import ModelPlan
from physics_crosscheck.harness.planning.result_builder import Jobs
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import Audit


class EnergiesModel(ModelPlan):
    """Cases in scenarios, measurements, linearizations, coverage, audit and diagnosis."""

    def _jobs(self) -> Iterator[Job[Any]]:
        self.begin()
        for case in self.cases:
            yield from self._case(case)
            yield from self.work.measure(case, self.sidecar)
        if self.options.described:
            yield from self._linearizations()
        if self.options.selection is None:
            yield from self._coverage()
        yield from self._audit()

    def _case(self, case: CaseId) -> Iterator[Job[Any]]:
        def done(value: Case) -> Jobs:
            self.work.found.add(value)
            return self._diagnosis()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, self.folder, failure))

        return self._do("case", done, failed, scenario=case.scenario)

    def _diagnosis(self) -> Iterator[Job[Any]]:
        """Diagnose a model after its last case if any of them differs."""
        mine = [c for c in self.work.found.cases if c.key == self.key]
        differs = any(case.outcome is Outcome.DIFFERS for case in mine)
        if not self.options.diagnosed or not differs or len(mine) < len(self.cases):
            return

        yield from self._do("diagnosis", self.diagnosed, self.undiagnosed)

    def _linearizations(self) -> Iterator[Job[Any]]:
        def done(value: tuple[EngineLinearization, ...]) -> Jobs:
            self.work.found.amend(self.key, linearizations=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, linearization_failure=failure.reason)
            return ()

        return self._do("linearizations", done, failed)

    def _audit(self) -> Iterator[Job[Any]]:
        def done(value: Audit) -> Jobs:
            self.work.found.amend(self.key, audit=value.findings, poses=value.poses)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, audit_failure=failure.reason)
            return ()

        return self._do("audit", done, failed)

    def _coverage(self) -> Iterator[Job[Any]]:
        def done(value: Coverage) -> Jobs:
            self.work.found.amend(self.key, coverage=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return self._do("coverage", done, failed)
