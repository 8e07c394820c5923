"""Run the tests of one pytest process in one worker process, with cached results.

A system or robot is prepared once and a model diagnosed once, for all tests that need them. The
fixture `crosscheck` runs models in tests of a project.
"""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pytest
from msgspec import structs

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.baseline.known import (
    Accepted,
    accepted,
    change_of,
    mark_known,
    mark_models,
)
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.checks.declared import Declared, declared
from physics_crosscheck.harness.checks.not_run import (
    CannotRun,
    cannot_run,
    failed_case,
    not_of_a_tree,
)
from physics_crosscheck.harness.commands.gate.gate import file_diffs
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.environment import without_main
from physics_crosscheck.harness.jobs.limits import MEMORY, SECONDS, Limits
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.model_files import chosen_engines, model_path
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.paths import DEFAULT_FOLDER, RESOLUTION
from physics_crosscheck.harness.planning.model_checks import (
    AUDIT,
    CASE,
    DIAGNOSIS,
    MEASUREMENT,
    ModelCheck,
)
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.prepared import Preparation, task_function
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import Audit
from physics_crosscheck.harness.results.ignored import CodeFilter
from ..api import CheckResults, Target, check, target_names
from ..cli import arguments
from ..cli.settings import SettingsError, project_settings


def run_settings(config: pytest.Config) -> Options:
    """Return the options of a run, which pytest's own ones give.

    Raises:
        pytest.UsageError: if one is out of range.
    """
    given = setting_of(config, "resolution")
    try:
        return Options(
            resolution=RESOLUTION if given is None else arguments.resolution(str(given)),
            strict=given is not None,
            limits=Limits(
                seconds=arguments.seconds(str(setting_of(config, "limit") or SECONDS)),
                memory=arguments.memory(str(setting_of(config, "memory") or MEMORY)),
                options="--crosscheck-",
            ),
            baseline=config.rootpath / Path(str(setting_of(config, "baseline") or DEFAULT_FOLDER)),
            thorough=bool(setting_of(config, "thorough")),
            smooth=bool(setting_of(config, "smooth")),
        )
    except (argparse.ArgumentTypeError, ValueError) as error:
        raise pytest.UsageError(f"--crosscheck: {error}") from None


def code_filter(config: pytest.Config) -> CodeFilter:
    """Return the codes that the project's table selects and ignores; errors as of `setting_of`."""
    return CodeFilter(**_of_project(config, "select", "ignore"))


def _of_project(config: pytest.Config, *names: str) -> dict[str, Any]:
    try:
        return project_settings(config.rootpath, names)
    except SettingsError as error:
        raise pytest.UsageError(str(error)) from None


def setting_of(config: pytest.Config, name: str) -> object:
    """Return an option of the command line, else of the ini file, else of `[tool.crosscheck]`.

    Raises:
        pytest.UsageError: for an invalid value.
    """
    if given := config.getoption(f"crosscheck_{name}"):
        return given
    stated = config.getini(f"crosscheck_{name}")
    if stated is None:
        return _of_project(config, name).get(name)
    switch = {"true": True, "1": True, "false": None, "0": None, "": None}
    return switch.get(str(stated).lower(), stated)


Argument = TypeVar("Argument")
Value = TypeVar("Value")


class CaseRunner:
    """Runs one case or audit at a time outside pytest, so that a crash is only an outcome."""

    def __init__(self, settings: Options, codes: CodeFilter | None = None) -> None:
        self._settings, self._codes = settings, codes or CodeFilter()
        # An untrusted one ends the session at its start.
        read_baseline(settings.baseline or DEFAULT_FOLDER)
        self._accepted: dict[Path, Accepted | None] = {}
        self._workers: Workers | None = None
        self._engines = engines()
        self._prepared: dict[Path, Preparation | Failure] = {}
        self._robot_cases: dict[tuple[Path, CaseId], Case] = {}
        self._edits: dict[tuple[Path, CaseId], str] = {}
        self._diagnoses: dict[tuple[Path, str], Diagnosis] = {}

    def precondition(self, model: Sidecar | Path, engine: str) -> CannotRun | None:
        """Return why a model can't run at all; None if it can."""
        return cannot_run(self._engines, engine, model)

    def declared(self, target: Path) -> Declared | Failure:
        """Return the names of a declaration or robot file."""
        return self._ask(partial(declared, **self._options(target)), target)

    def prepared(self, target: Path) -> Preparation | Failure:
        """Prepare a system folder or a robot file, once."""
        if target not in self._prepared:
            smooth = self._settings.smooth and target.is_file()
            reading = task_function("target", smooth=smooth, **self._options(target))
            self._prepared[target] = self._ask(reading, target)
        return self._prepared[target]

    def case(self, case_id: CaseId, target: Path, model: Sidecar | Path) -> Case:
        """Run a case; if the baseline accepts it, add the reason.

        A case of a robot file runs once for all tests that need it.
        """
        if isinstance(model, Sidecar):
            return self._filtered(self._run(case_id, target, model), target, model)
        if (target, case_id) not in self._robot_cases:
            case = self._filtered(self._run(case_id, target, model), target, model)
            self._robot_cases[target, case_id] = case
        return self._robot_cases[target, case_id]

    def _filtered(self, case: Case, target: Path, model: Sidecar | Path) -> Case:
        """Return a case, marked as accepted if the project ignores its codes."""
        codes, diagnosis = self._codes, None
        if case.outcome is Outcome.DIFFERS and (codes.select or codes.ignore):
            diagnosis = self.diagnosis(target, model, case.engine)
        return codes.case(case, diagnosis)

    def _options(self, target: Path) -> dict[str, Any]:
        """Return the options with which a robot file was accepted; empty for a folder."""
        before = self._before(target) if target.is_file() else None
        robot = None if before is None else before.folders[str(target)][0].robot
        return {} if robot is None else structs.asdict(robot)

    def edit_of(self, case_id: CaseId, target: Path) -> str:
        """Return how a case of a robot file changed since it was accepted, as for the gate."""
        return self._edits.get((target, case_id), "")

    def judged_by(self, case_id: CaseId, file: Path) -> list[str]:
        """Return the other engines that have a verdict on a robot file; none if it must load it."""
        if not self._engines[case_id.engine].extra:
            return []
        others = [
            structs.replace(case_id, engine=engine)
            for engine in chosen_engines(file, ())
            if engine != case_id.engine and self.precondition(file, engine) is None
        ]
        return [case.engine for case in others if self.case(case, file, file).verdict is not None]

    def _run(self, case_id: CaseId, target: Path, model: Sidecar | Path) -> Case:
        prepared = self.prepared(target)
        if isinstance(prepared, Failure):
            return failed_case(case_id, str(target), prepared)
        bodies = prepared.facts.declares == "bodies"
        if bodies and isinstance(model, Sidecar) and (why := not_of_a_tree(model)):
            return failed_case(case_id, str(target), Failure(why, "", kind="sidecar"))
        do = partial(self._do, prepared, model, case_id.engine, scenario=case_id.scenario)

        def measured(accepted: Snapshot) -> Measurement | Failure:
            measurement: Measurement | Failure = do(MEASUREMENT, snapshot=accepted)
            return measurement

        return self._judged(do(CASE), case_id, target, measured)

    def _do(
        self,
        prepared: Preparation,
        model: Sidecar | Path,
        engine: str,
        check: ModelCheck,
        **given: Any,
    ) -> Any:
        """Return the value of a model's check, or its failure."""
        function = check.task(
            prepared.facts,
            engine=engine,
            resolution=self._settings.resolution,
            sidecar=model if isinstance(model, Sidecar) else None,
            thorough=self._settings.thorough,
            **given,
        )
        return self._ask(function, prepared.solved)

    def _judged(
        self,
        case: Case | Failure,
        case_id: CaseId,
        target: Path,
        measured: Callable[[Snapshot], Measurement | Failure],
    ) -> Case:
        """Return a case with its outcome, and with the reason of its acceptance if there is one."""
        if isinstance(case, Failure):
            return failed_case(case_id, str(target), case)
        if self._settings.strict:
            case = structs.replace(case, accepted="")
        if target.is_dir() and case.outcome not in (Outcome.DIFFERS, Outcome.UNRESOLVED):
            return case
        before = None if target.is_file() and self._settings.smooth else self._before(target)
        snapshot = None if before is None else before.snapshot(case.folder, case.id)
        if before is None or (snapshot is None and case.outcome.is_run):
            return case
        seen = {} if snapshot is None else {(case.folder, case.id): measured(snapshot)}
        (case,) = mark_known((case,), seen, before)
        if target.is_file():
            change = change_of(case, seen.get((case.folder, case.id)), before)
            if change is not None and not change.status.passes:
                self._edits[target, case_id] = self._described(change, before, target)
        return case

    def _described(self, change: Change, before: Accepted, target: Path) -> str:
        """Return a change of a robot file in words, with the edited lines."""
        scans = {change.id.system: before.folders[str(target)][0]}
        lines = [
            f"{Path(diff.path).name}:{line.line}: {line.edit or line.message}"
            for diff in file_diffs([change], scans, before.place)
            for line in diff.changes
        ]
        remedy = f"undo it, or crosscheck accept {target.name} --reason WHY"
        return "; ".join([f"{change.status} since the baseline", *lines, *change.messages, remedy])

    def _before(self, target: Path) -> Accepted | None:
        """Return the accepted results of a target, read once."""
        if target not in self._accepted:
            self._accepted[target] = accepted(
                self._settings.baseline, (target,), self._settings.resolution, robot=None
            )
        return self._accepted[target]

    def marked(self, model: Model, target: Path) -> Model:
        """Return a model with the reason for accepting its audit findings, if there is one."""
        model = self._codes.model(model)
        before = self._before(target) if model.findings else None
        return mark_models((model,), before)[0]

    def audit(self, target: Path, model: Sidecar | Path, engine: str) -> Audit | Failure:
        """Audit a model, or return why it can't be audited."""
        preparation = self.prepared(target)
        if isinstance(preparation, Failure):
            return preparation
        if preparation.facts.declares == "robot file":
            return Audit(findings=preparation.facts.findings)
        audit: Audit | Failure = self._do(preparation, model, engine, AUDIT)
        return audit

    def diagnosis(self, target: Path, model: Sidecar | Path, engine: str) -> Diagnosis:
        """Diagnose a model once from its motions in every scenario."""
        key = model_path(model), engine
        if key not in self._diagnoses:
            value: Any = self.prepared(target)
            if isinstance(value, Preparation):
                value = self._do(value, model, engine, DIAGNOSIS)
            if isinstance(value, Failure):
                value = Diagnosis(failure=value.reason)
            self._diagnoses[key] = value
        return self._diagnoses[key]

    def close(self) -> None:
        """End the worker process, if there is one, and its task."""
        if self._workers is not None:
            self._workers.close()
            self._workers = None

    def _ask(self, function: Callable[[Argument], Value], argument: Argument) -> Value | Failure:
        with without_main():
            if self._workers is None:
                self._workers = Workers(1, self._settings.limits)
            return self._workers.outcome(self._workers.submit(function, argument))


class Checker:
    """Runs models as `check` does, with the settings of the command line; each model once."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._settings = config, run_settings(config)
        self._results: dict[tuple[object, ...], CheckResults] = {}

    def __call__(
        self,
        *paths: Target | Sequence[Target],
        engines: Sequence[str] = (),
        resolution: float | None = None,
        floating: bool | None = None,
        model: str = "",
        smooth: bool = False,
    ) -> CheckResults:
        """Run models as `check` does; the results are true if all of them agree.

        Args:
            paths: as for `check`, relative to the root folder.
            engines, floating, model: as for `check`.
            smooth: as for `check`; also with --crosscheck-smooth.
            resolution: smallest relative discrepancy to detect; None: that of the command line.

        Raises:
            FolderError: for a path without a target, or an unknown engine.
        """
        root, settings = self._config.rootpath, self._settings
        names = target_names(paths)
        # As for `check`, a name without a path is a built-in system.
        named = [str(root / name) if (root / name).exists() else name for name in names]
        stated = settings.resolution if settings.strict else None
        wanted = stated if resolution is None else resolution
        smooth = smooth or settings.smooth
        key = tuple(named), tuple(engines), wanted, floating, model, smooth
        if key not in self._results:
            self._results[key] = check(
                *named,
                engines=engines,
                resolution=wanted,
                limit=settings.limits.seconds,
                memory=settings.limits.memory,
                baseline=settings.baseline or DEFAULT_FOLDER,
                thorough=settings.thorough,
                floating=floating,
                model=model,
                smooth=smooth,
            )
        results = self._results[key]
        if results.untested and not setting_of(self._config, "require_engines"):
            pytest.skip(results.untested)
        return results
