"""Jobs of a model in a folder that declares bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec import structs

from physics_crosscheck.harness.checks.not_run import failed_case, not_of_a_tree
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.planning.model_plan import ModelPlan
from physics_crosscheck.harness.planning.result_builder import Jobs
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import FileSurvey


class BodiesModel(ModelPlan):
    """One case at sampled states, a measurement, coverage, and a diagnosis if it differs."""

    def _jobs(self) -> Iterator[Job[Any]]:
        if reason := not_of_a_tree(self.sidecar):
            for case in self.cases:
                self.work.found.add(
                    failed_case(case, self.folder, Failure(reason, "", kind="sidecar"))
                )
            return
        self.begin()
        for case in self.cases:
            yield from self._states(case)
            yield from self.work.measure(case, self.sidecar)
        yield from self._audit()
        if self.options.selection is None:
            yield from self._coverage()

    def _states(self, case: CaseId) -> Iterator[Job[Any]]:
        def done(value: Case) -> Jobs:
            self.work.found.add(value)
            is_diagnosed = self.options.diagnosed
            return self._named() if is_diagnosed and value.outcome is Outcome.DIFFERS else ()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, self.folder, failure))

        return self._do("case", done, failed, scenario=case.scenario)

    def _named(self) -> Iterator[Job[Any]]:
        """Find the numbers of a file that differ from those of the declared bodies."""
        return self._do("diagnosis", self.diagnosed, self.undiagnosed)

    def _coverage(self) -> Iterator[Job[Any]]:
        def done(value: Coverage) -> Jobs:
            counted = self.work.found.models[self.key].coverage or Coverage()
            coverage = structs.replace(value, left_out=counted.left_out)
            self.work.found.amend(self.key, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return self._do("coverage", done, failed)

    def _audit(self) -> Iterator[Job[Any]]:
        def done(value: FileSurvey) -> Jobs:
            counted = self.work.found.models[self.key].coverage or Coverage()
            coverage = structs.replace(counted, left_out=value.left_out)
            self.work.found.amend(self.key, audit=value.findings, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, audit_failure=failure.reason)
            return ()

        return self._do("survey", done, failed)
