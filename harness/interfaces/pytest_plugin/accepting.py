"""`--crosscheck-accept REASON`: write the current results of the selected cases to the baseline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from physics_crosscheck.harness.gate.accept import AcceptError, accept_each
from physics_crosscheck.harness.gate.gate import gate
from physics_crosscheck.harness.gate.options import GateOptions
from physics_crosscheck.harness.gate.text import accepted_lines
from physics_crosscheck.harness.interfaces.pytest_plugin.terms import RunSettings
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.results.github import in_ci


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

    def __init__(
        self, config: pytest.Config, folders: Sequence[Path], settings: RunSettings
    ) -> None:
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
                "--crosscheck-accept: the baseline has no robot files. Create a system folder with"
                " `crosscheck new NAME --from FILE`."
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
            GateOptions(
                baseline=self._settings.baseline,
                resolution=self._settings.resolution,
                limits=self._settings.limits,
                parents=(),
            ),
            lambda *_: None,
        )
        chosen = [change.id for change in result.changes if str(change.id) in passed]
        try:
            done = accept_each(
                result, dict.fromkeys(chosen, self._reason), (), self._settings.baseline
            )
        except AcceptError as error:
            self.lines = (f"crosscheck: {error}",)
            return False
        self.lines = tuple(
            accepted_lines(done.cases, done.files, terminal().width, with_cases=True)
        )
        return True


def _passed(config: pytest.Config) -> list[str]:
    """Return the names of the cases whose tests passed."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = [] if reporter is None else reporter.stats.get("passed", ())
    properties = [dict(r.user_properties) for r in reports if r.when == "call"]
    return [facts["case"] for facts in properties if "case" in facts]
