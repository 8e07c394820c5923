"""The command line, asked in this process: one of its own would import everything again.

Where the process itself is tested, its streams, signals or exit, a test starts one.
"""

from __future__ import annotations

import io
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli import compare, derive
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs import chosen
from physics_crosscheck.harness.jobs.executor import InThisProcess
from tests.faults.known_folder import KNOWN_ANSWER


class Here(InThisProcess):
    """Stands for worker processes: each would import, and derive, what this process has."""

    def __init__(self, *_: object, **__: object) -> None:
        super().__init__()

    def begin(self) -> None:
        """Start nothing."""


def crosscheck(
    *arguments: object,
    cwd: Path,
    known: bool = False,
    isolated: bool = True,
    **environment: str | None,
) -> subprocess.CompletedProcess[str]:
    """Run `crosscheck` with arguments in a folder; returns its exit code and what it printed.

    Args:
        cwd: the folder.
        known: whether the known-answer engine is found, by its entry point.
        isolated: whether tasks run in worker processes.
        environment: variables, beside CI and a width; None: not set.
    """
    words, out, err = [*map(str, arguments)], io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        for name, value in ({"CI": "1", "COLUMNS": "300"} | environment).items():
            if value is None:
                patch.delenv(name, raising=False)
            else:
                patch.setenv(name, value)
        if known:
            patch.syspath_prepend(str(KNOWN_ANSWER))
        for module in () if isolated else (chosen, compare, derive):
            patch.setattr(module, "Workers", Here)
        try:
            code = main(words)
        except SystemExit as ended:  # what argparse says itself
            code = ended.code if isinstance(ended.code, int) else 1
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())
