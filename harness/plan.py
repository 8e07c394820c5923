"""The jobs of a run, what follows from each, and what they bring together.

A folder brings the jobs of its models; a model's last case brings its diagnosis, if one differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import structs

from harness.audit.run import Audit, run_audit
from harness.audit.task import audit_task
from harness.baseline.inputs import inputs, with_elsewhere
from harness.baseline.measure import measure, measure_task
from harness.baseline.measure_tree import MeasureTreeTask, measure_tree
from harness.cases.case import (
    CaseTask,
    case_task,
    linearization_task,
    run_case,
    run_linearizations,
)
from harness.cases.multibody import (
    FileSurvey,
    PreparedTree,
    not_of_a_tree,
    prepare_folder,
    survey_file,
)
from harness.cases.not_run import barred_case, failed_case, hurdle
from harness.cases.prepare import Prepared
from harness.cases.robot import RobotTask, run_robot
from harness.collected import Collected, Jobs, stand_in
from harness.coverage.count import count_numbers
from harness.coverage.robot import count_robot
from harness.diagnosis.robot_task import RobotDiagnosisTask, diagnose_robot
from harness.diagnosis.task import DiagnosisTask, diagnose_model, diagnosis_task
from harness.engines.registry import engines
from harness.files.model_files import UnreadModel, chosen_engines, model_files
from harness.files.reading import read_regular
from harness.files.sidecar import Sidecar
from harness.options import Options
from harness.records.baseline import Measurement, Snapshot
from harness.records.case import Case, CaseId, ModelKey
from harness.records.coverage import Coverage
from harness.records.finding import Diagnosis
from harness.records.journal import Kind, Work
from harness.records.model import EngineLinearization, Model
from harness.records.outcome import Outcome
from harness.schedule.jobs import Job, Task
from harness.schedule.workers import Failure


class Plan:
    """What is to be done for a run; values go to `found`.

    Args:
        options: of the run.
        snapshots: accepted ones of the cases that are to be measured, where no selection says it.
        found: what the jobs bring.
    """

    def __init__(
        self, options: Options, snapshots: Mapping[CaseId, Snapshot], found: Collected
    ) -> None:
        self._options, self._snapshots, self._found = options, snapshots, found
        self._engines = engines()
        self._diagnoses: dict[ModelKey, tuple[DiagnosisTask, int]] = {}
        self._inputs: dict[tuple[str, str, str], str] = {}

    def folder(self, folder: Path) -> Job[Prepared | PreparedTree]:
        """Prepare a folder, then run its models."""
        self._found.expect(str(folder), [stand_in(folder)])
        # As it is before anything of it is run: what changes meanwhile is another folder's.
        if self._found.keeps:
            self._inputs |= inputs(folder, self._options.resolution, self._options.baseline)
        preparing = partial(prepare_folder, described=self._options.described)
        unprepared = partial(self._unprepared, folder)
        return Job(task=Task(preparing, folder), done=self._models, failed=unprepared)

    def _unprepared(self, folder: Path, failure: Failure) -> Jobs:
        self._found.add(failed_case(stand_in(folder), str(folder), failure))
        return ()

    def _models(self, prepared: Prepared | PreparedTree) -> Iterator[Job[Any]]:
        """Every model of a folder in every engine; those that can't be run are told at once."""
        self._found.systems.append(prepared.record)
        name, folder = prepared.system.name, str(prepared.folder)
        files = list(model_files(prepared.folder))
        unread = [
            (CaseId(system=name, model=one.model, scenario="-", engine="-"), one.reason)
            for one in files
            if isinstance(one, UnreadModel)
        ]
        bad = [one for one in unread if self._options.choice.includes(folder, one[0])]
        chosen = [
            (sidecar, engine, cases)
            for sidecar in files
            if isinstance(sidecar, Sidecar)
            for engine in self._chosen(prepared, sidecar)
            if (cases := self._wanted(prepared, sidecar, engine))
        ]
        awaited = [case for *_, cases in chosen for case in cases]
        self._found.expect(folder, [*(case for case, _ in bad), *awaited])
        for case, reason in bad:
            self._found.add(failed_case(case, folder, Failure(reason, "")))
        for sidecar, engine, cases in chosen:
            if isinstance(prepared, PreparedTree):
                yield from self._model_of_tree(prepared, sidecar, engine)
            else:
                names = [case.scenario for case in cases]
                yield from self._model(prepared, sidecar, engine, names)

    def _wanted(
        self, prepared: Prepared | PreparedTree, sidecar: Sidecar, engine: str
    ) -> list[CaseId]:
        """The cases of a model in an engine that are wanted, as scenarios are declared."""
        cases = [
            CaseId(
                system=prepared.system.name,
                model=sidecar.model.name,
                scenario=one.name,
                engine=engine,
            )
            for one in prepared.record.scenarios
        ]
        folder, choice = str(prepared.folder), self._options.choice
        return [case for case in cases if choice.includes(folder, case)]

    def _model_of_tree(
        self, prepared: PreparedTree, sidecar: Sidecar, engine: str
    ) -> Iterator[Job[Any]]:
        """A model of declared bodies in an engine: its states, and what its file says besides."""
        case, folder = prepared.id(sidecar, engine), str(prepared.folder)
        if why := hurdle(self._engines, engine, sidecar):
            self._found.add(barred_case(case, folder, why))
            return
        if reason := not_of_a_tree(sidecar):
            self._found.add(failed_case(case, folder, Failure(reason, "")))
            return
        key = self._begun(prepared, sidecar, engine)
        task = prepared.task(sidecar, engine, self._options.resolution)

        def done(value: Case) -> Jobs:
            self._found.add(value)
            asked = self._options.diagnosed
            return self._named(key, task) if asked and value.outcome is Outcome.DIFFERS else ()

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(case, folder, failure))

        job = Job(task=Task(run_robot, task), done=done, failed=failed)
        yield from self._found.once(self._work("case", key, case.scenario), job)
        if self._is_measured(case):
            measuring = MeasureTreeTask(
                task=task,
                system=prepared.system.tree_system,
                accepted=self._snapshot(folder, case),
                reads=prepared.reads,
            )
            yield self._measuring(folder, case, Task(measure_tree, measuring))
        yield self._survey(key, sidecar)
        if self._options.selection is None:
            yield from self._found.once(self._work("coverage", key), self._count(key, task))

    def _named(self, key: ModelKey, task: RobotTask) -> Iterator[Job[Diagnosis]]:
        """The numbers of a file that are not those of the declared bodies."""

        def done(value: Diagnosis) -> Jobs:
            self._found.amend(key, diagnosis=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Diagnosis(failure=failure.reason))

        inquiry = RobotDiagnosisTask(task=task, own=False)
        job = Job(task=Task(diagnose_robot, inquiry), done=done, failed=failed)
        yield from self._found.once(self._work("diagnosis", key), job)

    def _count(self, key: ModelKey, task: RobotTask) -> Job[Coverage]:
        def done(value: Coverage) -> Jobs:
            known = self._found.models[key].coverage or Coverage()
            self._found.amend(key, coverage=structs.replace(value, left_out=known.left_out))
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return Job(task=Task(count_robot, task), done=done, failed=failed)

    def _survey(self, key: ModelKey, sidecar: Sidecar) -> Job[FileSurvey]:
        def done(value: FileSurvey) -> Jobs:
            known = self._found.models[key].coverage or Coverage()
            coverage = structs.replace(known, left_out=value.left_out)
            self._found.amend(key, audit=value.findings, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            self._found.amend(key, audit_failure=failure.reason)
            return ()

        return Job(task=Task(survey_file, sidecar), done=done, failed=failed)

    def _begun(self, prepared: Prepared | PreparedTree, sidecar: Sidecar, engine: str) -> ModelKey:
        """A model that is run: what it depends on, and its record."""
        key = str(prepared.folder), sidecar.model.name, engine
        self._inputs[key] = with_elsewhere(self._inputs.get(key, ""), key, prepared.reads)
        self._found.models[key] = model_record(prepared, sidecar, engine)
        return key

    def _chosen(self, prepared: Prepared | PreparedTree, sidecar: Sidecar) -> list[str]:
        """The engines in which a model is to be run."""
        selection = self._options.selection
        return [
            engine
            for engine in chosen_engines(sidecar, self._options.engines)
            if selection is None
            or selection.includes((str(prepared.folder), sidecar.model.name, engine))
        ]

    def _model(
        self, prepared: Prepared, sidecar: Sidecar, engine: str, names: Sequence[str]
    ) -> Iterator[Job[Any]]:
        """A model in an engine: its cases in some scenarios, and what is found of it beside."""
        why = hurdle(self._engines, engine, sidecar)
        tasks = [
            case_task(prepared, sidecar, engine, name, self._options.resolution) for name in names
        ]
        if why is not None:
            for task in tasks:
                self._found.add(barred_case(task.id, task.folder, why))
            return
        key = self._begun(prepared, sidecar, engine)
        if self._options.diagnosed:
            self._diagnoses[key] = diagnosis_task(prepared, sidecar, engine), len(names)
        for task in tasks:
            yield from self._case(key, task)
            yield from self._measurement(prepared, task)
        if self._options.described:
            yield from self._linearizations(key, prepared, sidecar)
        if self._options.selection is None:
            yield from self._coverage(key, prepared, sidecar)
        yield self._audit(key, prepared, sidecar)

    def _case(self, key: ModelKey, task: CaseTask) -> Iterator[Job[Case]]:
        def done(case: Case) -> Jobs:
            self._found.add(case)
            return self._diagnosis(key)

        def failed(failure: Failure) -> Jobs:
            return done(failed_case(task.id, task.folder, failure))

        job = Job(task=Task(run_case, task), done=done, failed=failed)
        return self._found.once(self._work("case", key, task.scenario), job)

    def _work(self, what: Kind, key: ModelKey, scenario: str = "") -> Work:
        folder, model, engine = key
        known = self._inputs.get(key, "")
        return Work(
            what=what, folder=folder, model=model, engine=engine, scenario=scenario, inputs=known
        )

    def _measurement(self, prepared: Prepared, task: CaseTask) -> Iterator[Job[Measurement]]:
        """What a case's model does, where a snapshot was accepted, or may be."""
        if self._is_measured(task.id):
            measuring = measure_task(task, prepared, self._snapshot(task.folder, task.id))
            yield self._measuring(task.folder, task.id, Task(measure, measuring))

    def _is_measured(self, case: CaseId) -> bool:
        """Whether what a case's model does is wanted."""
        return self._options.selection is not None or case in self._snapshots

    def _snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """The one that was accepted of a case, or is to be repeated."""
        selection = self._options.selection
        if selection is None:
            return self._snapshots.get(case)
        return selection.snapshot(folder, case)

    def _measuring(
        self, folder: str, case: CaseId, task: Task[Any, Measurement]
    ) -> Job[Measurement]:
        def done(value: Measurement | Failure) -> Jobs:
            self._found.measured[folder, case] = value
            return ()

        return Job(task=task, done=done, failed=done)

    def _linearizations(
        self, key: ModelKey, prepared: Prepared, sidecar: Sidecar
    ) -> Iterator[Job[tuple[EngineLinearization, ...]]]:
        def done(value: tuple[EngineLinearization, ...]) -> Jobs:
            self._found.amend(key, linearizations=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            self._found.amend(key, linearization_failure=failure.reason)
            return ()

        task = linearization_task(prepared, sidecar, key[-1], self._options.resolution)
        job = Job(task=Task(run_linearizations, task), done=done, failed=failed)
        return self._found.once(self._work("linearizations", key), job)

    def _audit(self, key: ModelKey, prepared: Prepared, sidecar: Sidecar) -> Job[Audit]:
        def done(value: Audit) -> Jobs:
            self._found.amend(key, audit=value.findings, poses=value.poses)
            return ()

        def failed(failure: Failure) -> Jobs:
            self._found.amend(key, audit_failure=failure.reason)
            return ()

        task = audit_task(prepared, sidecar, key[-1])
        return Job(task=Task(run_audit, task), done=done, failed=failed)

    def _coverage(
        self, key: ModelKey, prepared: Prepared, sidecar: Sidecar
    ) -> Iterator[Job[Coverage]]:
        """Apart from the audit: what moved numbers do to an engine must not lose its findings."""

        def done(value: Coverage) -> Jobs:
            self._found.amend(key, coverage=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        task = audit_task(prepared, sidecar, key[-1])
        job = Job(task=Task(count_numbers, task), done=done, failed=failed)
        return self._found.once(self._work("coverage", key), job)

    def _diagnosis(self, key: ModelKey) -> Iterator[Job[Diagnosis]]:
        """The diagnosis of a model, once its last case is in and one of them differs."""
        task, scenarios = self._diagnoses.get(key, (None, 0))
        mine = [c for c in self._found.cases if c.key == key]
        differs = any(case.outcome is Outcome.DIFFERS for case in mine)
        if task is None or not differs or len(mine) < scenarios:
            return

        def done(value: Diagnosis) -> Jobs:
            self._found.amend(key, diagnosis=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Diagnosis(failure=failure.reason))

        job = Job(task=Task(diagnose_model, task), done=done, failed=failed)
        yield from self._found.once(self._work("diagnosis", key), job)


def model_record(prepared: Prepared | PreparedTree, sidecar: Sidecar, engine: str) -> Model:
    """A model file and its sidecar, as they are run; nothing is found of it yet."""
    beside = sidecar.model.with_name(f"{sidecar.model.name}.toml")
    return Model(
        system=prepared.system.name,
        model=sidecar.model.name,
        engine=engine,
        folder=str(prepared.folder),
        text=text_of(sidecar.model),
        sidecar=text_of(beside),
    )


def text_of(path: Path) -> str:
    """A file's text; of one that has gone meanwhile none, and its cases say so."""
    try:
        return read_regular(path).decode("utf-8", errors="replace")
    except OSError:
        return ""
