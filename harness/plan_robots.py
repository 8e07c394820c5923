"""The jobs of robots' files: each is read and solved once, and run in every engine for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import structs

from harness.baseline.measure_tree import MeasureTreeTask, measure_tree
from harness.cases.not_run import absent, barred_case, failed_case
from harness.cases.robot import PreparedRobot, RobotTask, prepare_robot, run_robot
from harness.collected import Collected, Jobs
from harness.coverage.robot import count_robot
from harness.diagnosis.robot_task import RobotDiagnosisTask, diagnose_robot
from harness.engines.protocol import Engine
from harness.engines.registry import readers, runners
from harness.options import Options
from harness.plan_model import text_of
from harness.records.baseline import Measurement, Snapshot
from harness.records.case import Case, CaseId
from harness.records.coverage import Coverage
from harness.records.finding import Diagnosis
from harness.records.model import Model
from harness.records.outcome import Outcome
from harness.schedule.jobs import Job, Task
from harness.schedule.workers import Failure


class RobotPlan:
    """What is to be done for robots' files; values go to `found`."""

    def __init__(self, options: Options, found: Collected) -> None:
        self._options, self._found = options, found

    def file(self, file: Path) -> Job[PreparedRobot]:
        """Prepare a file, then run it."""
        one = _stand_in(file)
        self._found.expect(str(file), [one])
        failed = partial(self._failed, one, file)
        prepare = partial(prepare_robot, floating=self._options.floating)
        return Job(task=Task(prepare, file), done=partial(self._engines, one), failed=failed)

    def _engines(self, one: CaseId, prepared: PreparedRobot) -> Iterator[Job[Any]]:
        """The file in every engine that reads its format, or in those that are wanted."""
        file = prepared.file
        self._found.systems.append(prepared.record)
        wanted = [
            engine
            for engine in (readers if self._options.engines else runners)(file.suffix)
            if not self._options.engines or engine.name in self._options.engines
        ]
        found = [(engine, _id(prepared, engine)) for engine in wanted]
        choice = self._options.choice
        chosen = [(engine, case) for engine, case in found if choice.includes(str(file), case)]
        self._found.left.pop((str(file), one), None)
        self._found.expect(str(file), [case for _, case in chosen])
        tasks: list[RobotTask] = []
        for engine, case in chosen:
            if why := absent(engine):
                self._found.add(barred_case(case, str(file), why))
                continue
            model = _model(prepared, engine)
            self._found.models[model.key] = model
            task = prepared.task(engine.name, self._options.resolution)
            tasks.append(task)
            yield Job(
                task=Task(run_robot, task),
                done=partial(self._run, prepared, task),
                failed=partial(self._failed, case, file),
            )

        if tasks and self._options.selection is None:
            yield self._coverage(tasks)

    def _coverage(self, tasks: Sequence[RobotTask]) -> Job[Coverage]:
        """The numbers of a file, counted once for all engines."""

        def done(value: Coverage) -> Jobs:
            for task in tasks:
                key = str(task.file), task.file.name, task.engine
                known = self._found.models[key].coverage or Coverage()
                self._found.amend(key, coverage=structs.replace(value, left_out=known.left_out))
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return Job(task=Task(count_robot, tasks[0]), done=done, failed=failed)

    def _run(self, prepared: PreparedRobot, task: RobotTask, case: Case) -> Iterator[Job[Any]]:
        """A case is done; one that differs is diagnosed, and what it does measured if wanted."""
        self._found.add(case)
        selection = self._options.selection
        if selection is not None and not case.refused:
            accepted = selection.snapshot(task.folder, case.id)
            yield self._measuring(prepared, task, case.id, accepted)
        if self._options.diagnosed and case.outcome is Outcome.DIFFERS:
            yield self._diagnosis(task, case)

    def _measuring(
        self, prepared: PreparedRobot, task: RobotTask, case: CaseId, accepted: Snapshot | None
    ) -> Job[Measurement]:
        def done(value: Measurement | Failure) -> Jobs:
            self._found.measured[task.folder, case] = value
            return ()

        measuring = MeasureTreeTask(task=task, system=prepared.system, accepted=accepted, reads=())
        return Job(task=Task(measure_tree, measuring), done=done, failed=done)

    def _diagnosis(self, task: RobotTask, case: Case) -> Job[Diagnosis]:
        def done(value: Diagnosis) -> Jobs:
            self._found.amend(case.key, diagnosis=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Diagnosis(failure=failure.reason))

        inquiry = RobotDiagnosisTask(task=task)
        return Job(task=Task(diagnose_robot, inquiry), done=done, failed=failed)

    def _done(self, case: Case) -> Jobs:
        self._found.add(case)
        return ()

    def _failed(self, case: CaseId, file: Path, failure: Failure) -> Jobs:
        told = replace(failure, reason=failure.about(file))
        return self._done(failed_case(case, str(file), told))


def _stand_in(file: Path) -> CaseId:
    return CaseId(system=file.stem, model=file.name, scenario="-", engine="-")


def _id(prepared: PreparedRobot, engine: Engine) -> CaseId:
    name = prepared.record.name
    return CaseId(
        system=name, model=prepared.file.name, scenario=prepared.scenario, engine=engine.name
    )


def _model(prepared: PreparedRobot, engine: Engine) -> Model:
    return Model(
        system=prepared.record.name,
        model=prepared.file.name,
        engine=engine.name,
        folder=str(prepared.file),
        text=text_of(prepared.file),
        sidecar="",
        audit=prepared.findings,
        coverage=Coverage(left_out=prepared.left_out),
    )
