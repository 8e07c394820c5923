"""The command line, asked in this process: one of its own would import everything again.

Where the process itself is tested, its streams, signals or exit, a test starts one.
"""

from __future__ import annotations

import io
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from tests.faults.known_folder import KNOWN_ANSWER


def crosscheck(
    *arguments: object, cwd: Path, known: bool = False, **environment: str | None
) -> subprocess.CompletedProcess[str]:
    """Run `crosscheck` with arguments in a folder; returns its exit code and what it printed.

    Args:
        cwd: the folder.
        known: whether the known-answer engine is found, by its entry point.
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
        try:
            code = main(words)
        except SystemExit as ended:  # what argparse says itself
            code = ended.code if isinstance(ended.code, int) else 1
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())
