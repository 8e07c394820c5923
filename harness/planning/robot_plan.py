"""Jobs of robot files: each is read and solved once, and run in every engine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import structs

from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.checks.not_run import absent, barred_case, failed_case
from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.jobs.graph import Job, Task
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.locations.xml import xml_problem
from physics_crosscheck.harness.modelfiles.model_files import chosen_engines
from physics_crosscheck.harness.planning.cache import piece_of_robot, robot_inputs
from physics_crosscheck.harness.planning.model_plan import text_of
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.prepared import RobotFacts, task_function
from physics_crosscheck.harness.planning.result_builder import Collected, Jobs
from physics_crosscheck.harness.planning.target_plan import PlaceWork
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome

MJCF = ".xml"
"""Suffix of files that their engine's own parser reads, less strictly than XML."""

GIVE_XML = "write well-formed XML"


class RobotWork(PlaceWork[RobotFacts]):
    """The plan of a run for one robot file.

    Args:
        file: the model file.
        options: options of the run.
        before: accepted results, if any.
        results: results of the jobs.
    """

    def __init__(
        self, file: Path, options: Options, before: Accepted | None, results: Collected
    ) -> None:
        wanted = results.keeps or options.cache
        self._robot = {**structs.asdict(options.robot(file)), "motion": options.motion}
        key = piece_of_robot(file, self._robot) if wanted else None
        super().__init__(file, options, results, key, before)

    @property
    def stand_in(self) -> CaseId:
        """Placeholder case of the file."""
        return _stand_in(self.place)

    @property
    def reads(self) -> Mapping[str, str]:
        """Empty: the hash of the file covers all files that it names."""
        return {}

    def case_id(self, engine: str) -> CaseId:
        """Return the case of the file in an engine."""
        record = self.facts.record
        (scenario,) = record.scenarios
        return CaseId(
            system=record.name, model=self.place.name, scenario=scenario.name, engine=engine
        )

    def model(self, engine: str) -> Model:
        """Return the record of the file in an engine, with the findings from reading it."""
        return Model(
            system=self.facts.record.name,
            model=self.place.name,
            engine=engine,
            folder=str(self.place),
            text=text_of(self.place),
            sidecar="",
            audit=self.facts.findings,
            coverage=Coverage(left_out=self.facts.left_out),
        )

    def _preparing(self) -> Task[Any, Any]:
        return Task(task_function("robot", **self._robot), self.place)

    def _inputs(self, key: ModelKey) -> str:
        assert self._piece is not None  # only needed with a cache or a journal
        return robot_inputs(self._piece, key[-1], self.options.resolution)


class RobotPlan:
    """The plan of a run for robot files; values go to `results`."""

    def __init__(self, options: Options, before: Accepted | None, results: Collected) -> None:
        self._options, self._before, self._found = options, before, results

    def readable(self, files: Sequence[Path]) -> list[Path]:
        """Return the files that may be XML; the others fail before a worker process starts for
        them.
        """
        files_read = []
        for file in files:
            self._found.expect(str(file), [_stand_in(file)])
        for file in files:
            if why := xml_problem(file, strict=file.suffix != MJCF):
                failure = Failure(f"{why}; {GIVE_XML}", "", kind="file")
                self._found.add(failed_case(_stand_in(file), str(file), failure))
            else:
                files_read.append(file)
        return files_read

    def file(self, file: Path) -> Iterator[Job[Any]]:
        """Prepare a file, then run it."""
        robot_plan = RobotWork(file, self._options, self._before, self._found)
        yield from robot_plan.begun(partial(self._engines, robot_plan))

    def _engines(self, robot_plan: RobotWork) -> Iterator[Job[Any]]:
        """Yield the jobs of a file in every requested engine, or in all that read its format."""
        file, facts = robot_plan.place, robot_plan.facts
        self._found.systems.append(facts.record)
        adapters = engines()
        cases = [(adapters[name], robot_plan.case_id(name)) for name in self._wanted(file)]
        choice = self._options.choice
        chosen = [(engine, case) for engine, case in cases if choice.includes(str(file), case)]
        self._found.left.pop((str(file), robot_plan.stand_in), None)
        self._found.expect(str(file), [case for _, case in chosen])
        started: list[ModelKey] = []
        for engine, case in chosen:
            if why := absent(engine):
                self._found.add(barred_case(case, str(file), why))
                continue
            model = robot_plan.model(engine.name)
            self._found.models[model.key] = model
            started.append(model.key)
            yield from self._case(robot_plan, model.key, case)
        if started and self._options.selection is None:
            yield from self._coverage(robot_plan, started)

    def _wanted(self, file: Path) -> list[str]:
        """Return the engines in which a file must run."""
        selection = self._options.selection
        if selection is None or selection.models is None:
            return chosen_engines(file, self._options.engines)
        names = [engine.name for engine in engines_reading(file.suffix)]
        return [name for name in names if selection.includes((str(file), file.name, name))]

    def _case(self, robot_plan: RobotWork, key: ModelKey, case: CaseId) -> Iterator[Job[Any]]:
        """Run a case, diagnose it if it differs, and measure it if requested."""

        def done(value: Case) -> Iterator[Job[Any]]:
            self._found.add(value)
            if value.outcome is not Outcome.REFUSED:
                yield from robot_plan.measure(case)
            if self._options.diagnosed and value.outcome is Outcome.DIFFERS:
                yield from self._diagnosis(robot_plan, key)

        def failed(failure: Failure) -> Jobs:
            self._found.add(failed_case(case, str(robot_plan.place), failure))
            return ()

        return robot_plan.do("case", key, done, failed, scenario=case.scenario)

    def _diagnosis(self, robot_plan: RobotWork, key: ModelKey) -> Iterator[Job[Any]]:
        def done(value: Diagnosis) -> Jobs:
            self._found.amend(key, diagnosis=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Diagnosis(failure=failure.reason))

        return robot_plan.do("diagnosis", key, done, failed)

    def _coverage(self, robot_plan: RobotWork, keys: Sequence[ModelKey]) -> Iterator[Job[Any]]:
        """Count the tested numbers of a file, once for all engines."""

        def done(value: Coverage) -> Jobs:
            for key in keys:
                coverage = self._found.models[key].coverage or Coverage()
                self._found.amend(key, coverage=structs.replace(value, left_out=coverage.left_out))
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return robot_plan.do("coverage", keys[0], done, failed)


def _stand_in(file: Path) -> CaseId:
    return CaseId(system=file.stem, model=file.name, scenario="-", engine="-")
