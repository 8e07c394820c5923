"""A model of a folder that declares bodies: its states, and what its file says besides.

What workers run is imported where a task is made of it: nothing is where all of it is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from msgspec import structs

from physics_crosscheck.harness.cases.not_run import failed_case, not_of_a_tree
from physics_crosscheck.harness.collected import Jobs
from physics_crosscheck.harness.plan_model import ModelPlan
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import FileSurvey
from physics_crosscheck.harness.schedule.jobs import Job, Task
from physics_crosscheck.harness.schedule.workers import Failure

if TYPE_CHECKING:
    from physics_crosscheck.harness.cases.multibody import PreparedTree
    from physics_crosscheck.harness.cases.robot_task import RobotTask


class BodiesModel(ModelPlan):
    """One case at chosen states, a measurement, coverage, and a diagnosis where it differs."""

    def _jobs(self) -> Iterator[Job[Any]]:
        if reason := not_of_a_tree(self.sidecar):
            for case in self.cases:
                self.work.found.add(failed_case(case, self.folder, Failure(reason, "")))
            return
        self.begin()
        for case in self.cases:
            yield from self._states(case)
            yield from self.work.measure(case, self._measuring)
        yield from self._audit()
        if self.options.selection is None:
            yield from self._coverage()

    def _task(self, prepared: PreparedTree) -> RobotTask:
        return prepared.task(self.sidecar, self.engine, self.options.resolution)

    def _measuring(self, prepared: PreparedTree, accepted: Snapshot | None) -> Task[Any, Any]:
        from physics_crosscheck.harness.baseline.measure_tree import MeasureTreeTask, measure_tree

        task = MeasureTreeTask(
            task=self._task(prepared),
            system=prepared.system.tree_system,
            accepted=accepted,
            reads=prepared.reads,
        )
        return Task(measure_tree, task)

    def _states(self, case: CaseId) -> Iterator[Job[Any]]:
        def done(value: Case) -> Jobs:
            self.work.found.add(value)
            asked = self.options.diagnosed
            return self._named() if asked and value.outcome is Outcome.DIFFERS else ()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, self.folder, failure))

        def make(prepared: PreparedTree) -> Task[Any, Any]:
            from physics_crosscheck.harness.cases.robot import run_robot

            return Task(run_robot, self._task(prepared))

        return self.work.do(
            "case",
            self.key,
            make,
            done,
            failed,
            scenario=case.scenario,
        )

    def _named(self) -> Iterator[Job[Any]]:
        """The numbers of a file that are not those of the declared bodies."""

        def make(prepared: PreparedTree) -> Task[Any, Any]:
            from physics_crosscheck.harness.diagnosis.robot_task import (
                RobotDiagnosisTask,
                diagnose_robot,
            )

            task = RobotDiagnosisTask(task=self._task(prepared), own=False)
            return Task(diagnose_robot, task)

        return self.work.do("diagnosis", self.key, make, self.diagnosed, self.undiagnosed)

    def _coverage(self) -> Iterator[Job[Any]]:
        def done(value: Coverage) -> Jobs:
            known = self.work.found.models[self.key].coverage or Coverage()
            coverage = structs.replace(value, left_out=known.left_out)
            self.work.found.amend(self.key, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        def make(prepared: PreparedTree) -> Task[Any, Any]:
            from physics_crosscheck.harness.coverage.robot import count_robot

            return Task(count_robot, self._task(prepared))

        return self.work.do("coverage", self.key, make, done, failed)

    def _audit(self) -> Iterator[Job[Any]]:
        def done(value: FileSurvey) -> Jobs:
            known = self.work.found.models[self.key].coverage or Coverage()
            coverage = structs.replace(known, left_out=value.left_out)
            self.work.found.amend(self.key, audit=value.findings, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            self.work.found.amend(self.key, audit_failure=failure.reason)
            return ()

        def make(_: PreparedTree) -> Task[Any, Any]:
            from physics_crosscheck.harness.cases.multibody import survey_file

            return Task(survey_file, self.sidecar)

        return self.work.do("survey", self.key, make, done, failed)
