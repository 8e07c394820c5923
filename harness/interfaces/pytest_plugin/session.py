"""Parts of a pytest session with targets: collection, one runner, a summary."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest

from physics_crosscheck.harness.baseline.store import BaselineError
from physics_crosscheck.harness.interfaces.pytest_plugin.accepting import Accepting
from physics_crosscheck.harness.interfaces.pytest_plugin.collect import RobotFile, SystemFile
from physics_crosscheck.harness.interfaces.pytest_plugin.keys import RUNNER
from physics_crosscheck.harness.interfaces.pytest_plugin.paths import DECLARATION, meant, to_collect
from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner
from physics_crosscheck.harness.interfaces.pytest_plugin.summary import summarize, untested
from physics_crosscheck.harness.interfaces.pytest_plugin.terms import run_settings
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines

ABOUT = (
    "crosscheck(system, model, engine, scenario): a case or an audit of --crosscheck; select with"
    " -m 'crosscheck(engine=\"NAME\")', or by the names of its engine and system: -m NAME"
)


class CrosscheckSession:
    """The part of the plugin that is registered if there are targets."""

    def __init__(self, config: pytest.Config) -> None:
        settings = run_settings(config)
        targets = meant(config)
        config.args = to_collect(config, targets)
        config.args_source = config.ArgsSource.ARGS
        paths = {path.resolve() for found in targets.values() for path in found}
        self._folders = {path for path in paths if path.is_dir()}
        self._robots = paths - self._folders
        try:
            self._runner = CaseRunner(settings.resolution, settings.limits, settings.baseline)
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
        for line in self._accepting.lines:
            terminalreporter.write_line(line)
        for line in absent_engine_lines(sorted(self._folders)):
            terminalreporter.write_line(f"crosscheck: {line}")
