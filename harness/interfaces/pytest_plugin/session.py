"""Parts of a pytest session with targets: collection, one runner, a summary."""

import fnmatch
import os
from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.baseline.store import BaselineError
from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept_each
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.text import accepted_lines
from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    is_robot,
    is_system,
    system_folders,
)
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines
from physics_crosscheck.harness.modelfiles.robot_targets import NamedRobots, robot_files
from physics_crosscheck.harness.paths import DEFAULT_FOLDER
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.console import WORDS, terminal
from physics_crosscheck.harness.results.github import in_ci
from physics_crosscheck.harness.results.messages import explain_hint
from physics_crosscheck.harness.results.status import counted
from .collect import RUNNER, RobotFile, SystemFile
from .runner import CaseRunner, code_filter, run_settings

DECLARATION = "system.py"


def targets_under(name: str, unwanted: Sequence[str]) -> list[Path]:
    """Return the system folders at or below a path; without any, the robot files.

    A name that is not a path means the built-in system, as in `crosscheck run`.

    Args:
        name: name of the path; a robot file stands for itself.
        unwanted: patterns of folder names to skip, pytest's `norecursedirs`.

    Raises:
        FolderError: if the path has neither.
    """
    if not name:  # an unset variable, which would mean all targets
        raise FolderError("PATH is empty; name a folder, or . for all that lie here")
    path = Path(os.path.abspath(name))
    if path.name == DECLARATION and path.is_file():
        path = path.parent
    if is_system(path):
        return [path]
    if not path.is_dir():
        return _named(name)
    folders, files = list[Path](), list[Path]()
    for here, inner, names in os.walk(path):
        if is_system(Path(here)):
            folders.append(Path(here))
            inner.clear()
        files += [Path(here, file) for file in names if is_robot(Path(here, file))]
        # Sorted and in place: the walk is then the same in every xdist worker.
        inner[:] = sorted(name for name in inner if _enters(name, unwanted))
    if not (folders or files):
        raise FolderError(f"{name}: no {DECLARATION} and no robot file in it or below it")
    # A file that cannot be read stays, as a failing test.
    read = [(robot_files([str(file)]).files or [file]) for file in sorted(files)]
    return sorted(folders) or list(chain.from_iterable(read))


def _named(name: str) -> list[Path]:
    """Return the robot file or the built-in system of a name."""
    robots = NamedRobots([], [name], {}) if named_model(name) else robot_files([name])
    if robots.faults:
        raise FolderError("; ".join(robots.faults.values()))
    return [Path(os.path.abspath(path)) for path in robots.files or system_folders([name])]


def targets_by_path(config: pytest.Config) -> dict[str, list[Path]]:
    """Return the targets by path, from the command line or else from the ini file.

    Robot files among pytest's own arguments are targets too: a shell writes `--crosscheck *.urdf`
    as one path of --crosscheck and such arguments. Targets in a path of pytest's `--ignore` are
    left out.

    Raises:
        pytest.UsageError: if a path has no target.
    """
    named = config.getoption("crosscheck") or [str(p) for p in config.getini("crosscheck_paths")]
    if config.args_source is config.ArgsSource.ARGS:
        files = [argument.split("::")[0] for argument in config.args]
        named = [*named, *(file for file in files if is_robot(Path(file)))]
    ignored = [Path(os.path.abspath(name)) for name in config.getoption("ignore") or ()]
    try:
        targets = {name: targets_under(name, _unwanted(config)) for name in named}
    except FolderError as error:
        raise pytest.UsageError(f"--crosscheck {error}") from None
    return {
        name: [one for one in paths if not any(map(one.is_relative_to, ignored))]
        for name, paths in targets.items()
    }


def to_collect(config: pytest.Config, targets: dict[str, list[Path]]) -> list[str]:
    """Return what pytest collects: the command line's arguments, declarations and robot files.

    `--crosscheck PATH` counts as an argument PATH: without others, nothing else is collected. An
    argument inside PATH, such as a test's id, selects from it. The ini file's paths, like
    `testpaths`, apply if the command line names nothing.
    """
    is_requested = bool(config.getoption("crosscheck"))
    named = config.args_source is config.ArgsSource.ARGS
    given = [] if is_requested and not named else list(config.args)
    if named and not is_requested:
        return given
    inside = [Path(argument.split("::")[0]).resolve() for argument in given]
    unwanted = _unwanted(config)
    for name, paths in targets.items():
        roots = [Path(name).resolve(), *(target.resolve() for target in paths)]
        if named and any(path.is_relative_to(root) for path in inside for root in roots):
            continue
        # Skip paths that pytest collects anyway: pytest 8 loses tests if arguments overlap.
        given += [
            str(file)
            for file in (one / DECLARATION if one.is_dir() else one for one in paths)
            if not any(_reached(file.resolve().parent, path, unwanted) for path in inside)
        ]
    return list(dict.fromkeys(given))


def _unwanted(config: pytest.Config) -> list[str]:
    return [*config.getini("norecursedirs"), "__pycache__"]


def _enters(name: str, unwanted: Sequence[str]) -> bool:
    return not any(fnmatch.fnmatch(name, pattern) for pattern in unwanted)


def _reached(folder: Path, start: Path, unwanted: Sequence[str]) -> bool:
    """Return whether pytest, collecting `start`, enters a folder."""
    if not folder.is_relative_to(start):
        return False
    return all(_enters(name, unwanted) for name in folder.relative_to(start).parts)


ABOUT = (
    "crosscheck(system, model, engine, scenario): a case or an audit of --crosscheck; select with"
    " -m 'crosscheck(engine=\"NAME\")', or by the names of its engine and system: -m NAME"
)


class CrosscheckSession:
    """The part of the plugin that is registered if there are targets."""

    def __init__(self, config: pytest.Config) -> None:
        settings = run_settings(config)
        self._codes = code_filter(config)
        targets = targets_by_path(config)
        config.args = to_collect(config, targets)
        config.args_source = config.ArgsSource.ARGS
        paths = {path.resolve() for found in targets.values() for path in found}
        self._folders = {path for path in paths if path.is_dir()}
        self._robots = paths - self._folders
        try:
            self._runner = CaseRunner(settings, self._codes)
        except BaselineError as error:
            raise pytest.UsageError(f"--crosscheck: {error}") from None
        config.stash[RUNNER] = self._runner
        config.addinivalue_line("markers", ABOUT)
        self._accepting = Accepting(config, sorted(self._folders), settings)

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(
        self, file_path: Path, parent: pytest.Collector
    ) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
        """Collect declarations and robot files; model files of a folder are not test modules."""
        collectors = yield
        if file_path.resolve() in self._robots:
            return [RobotFile.from_parent(parent, path=file_path)]
        if file_path.parent.resolve() not in self._folders:
            return collectors
        if file_path.name == DECLARATION:
            return [SystemFile.from_parent(parent, path=file_path)]
        return [] if file_path.with_name(f"{file_path.name}.toml").is_file() else collectors

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """End the worker process; a run whose cases were all skipped tested nothing and fails."""
        self._runner.close()
        if session.exitstatus == pytest.ExitCode.OK and untested(session.config):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        if self._accepting.accept(session.config) is False:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the outcomes, the accepted results, and the skipped tests."""
        summarize(terminalreporter)
        for line in (*self._codes.lines(), *self._accepting.lines):
            terminalreporter.write_line(line)
        for line in absent_engine_lines(sorted(self._folders)):
            terminalreporter.write_line(f"crosscheck: {line}")


class Accepting:
    """Writes the baseline after all tests.

    Args:
        config: configuration of the session.
        folders: tested folders.
        asked: settings for running cases.

    Attributes:
        lines: lines for the end of the run.

    Raises:
        pytest.UsageError: in CI, or without a reason.
    """

    def __init__(self, config: pytest.Config, folders: Sequence[Path], settings: Options) -> None:
        given = config.getoption("crosscheck_accept")
        self._reason = None if given is None else " ".join(given.split())
        self._folders, self._settings = folders, settings
        self.lines: tuple[str, ...] = ()
        if self._reason is not None and in_ci():
            raise pytest.UsageError("--crosscheck-accept needs a person and is refused in CI")
        if self._reason == "":
            raise pytest.UsageError(
                "--crosscheck-accept is empty. State why the results are right."
            )
        if self._reason is not None and not folders:
            raise pytest.UsageError(
                "--crosscheck-accept: takes system folders. Accept a robot file with"
                " `crosscheck accept FILE --reason WHY`."
            )

    def accept(self, config: pytest.Config) -> bool | None:
        """Write passed cases into the baseline; return None if there is nothing to accept.

        Changed cases run once more, so that only results of these tests are accepted, judged by the
        gate.
        """
        if not self._reason or hasattr(config, "workerinput"):  # xdist's workers have no reports
            return None
        passed = set(_passed(config))
        result = gate(
            list(self._folders),
            replace(self._settings, parents=()),
            lambda *_: None,
        )
        chosen = [change.id for change in result.changes if str(change.id) in passed]
        try:
            place = self._settings.baseline or DEFAULT_FOLDER
            done = accept_each(result, dict.fromkeys(chosen, self._reason), (), place)
        except AcceptError as error:
            self.lines = (f"crosscheck: {error}",)
            return False
        width = terminal().width
        self.lines = tuple(accepted_lines(result, done.cases, done.files, width, with_cases=True))
        return True


def _passed(config: pytest.Config) -> list[str]:
    """Return the names of the cases whose tests passed."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = [] if reporter is None else reporter.stats.get("passed", ())
    properties = [dict(r.user_properties) for r in reports if r.when == "call"]
    return [facts["case"] for facts in properties if "case" in facts]


def summarize(reporter: pytest.TerminalReporter) -> None:
    """Write counts of outcomes, accepted differences and skipped tests, from pytest's reports."""
    reports = _reports(reporter)
    if not reports:
        return
    reporter.ensure_newline()
    reporter.section("crosscheck")
    report_properties = [(report, dict(report.user_properties)) for report in reports]
    counts = Counter(facts["outcome"] for _, facts in report_properties if "outcome" in facts)
    parts = [f"{counts[one]} {WORDS[one]}" for one in Outcome if counts[one]]
    agreeing = [facts for _, facts in report_properties if facts.get("outcome") == Outcome.AGREES]
    worst = max((float(facts["largest"]) for facts in agreeing if "largest" in facts), default=None)
    size = "" if worst is None else f"; largest difference of the ok cases: {worst:.1e}"
    reporter.write_line(", ".join(parts) + size)
    for report, facts in report_properties:
        if report.passed and "accepted" in facts:
            outcome = facts.get("outcome", "audit")
            reporter.write_line(f"accepted: {outcome} {report.nodeid}: {facts['accepted']}")
        if "whole steps" in facts:
            reporter.write_line(f"{report.nodeid}: whole steps {facts['whole steps']}")
    skipped = Counter(report.longrepr[2] for report, _ in report_properties if report.skipped)
    for reason, number in skipped.items():
        reporter.write_line(
            f"skipped: {counted(number, 'test')}: {reason.removeprefix('Skipped: ')}"
        )
    if untested(reporter.config):
        reporter.write_line(
            "nothing was tested: no engine of these models is installed."
            " Run pip install 'physics-crosscheck[engines]'."
        )
    codes = [
        facts["code"] for report, facts in report_properties if report.failed and "code" in facts
    ]
    if hint := explain_hint(codes):
        reporter.write_line(hint, light=True)


def untested(config: pytest.Config) -> bool:
    """Return whether there were cases, and all of them were skipped."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = [] if reporter is None else _reports(reporter)
    return bool(reports) and all(report.skipped for report in reports)


def _reports(reporter: pytest.TerminalReporter) -> list[Any]:
    """Return the reports of cases and audits, in any order."""
    return [
        report
        for kind in ("passed", "failed", "skipped")
        for report in reporter.stats.get(kind, ())
        if report.when == "call" and "crosscheck" in report.keywords
    ]
