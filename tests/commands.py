"""The command line, run in this process because a new one would import everything again.

Tests of the process itself, such as its streams, signals or exit, start a new one.
"""

import io
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from tests.faults.known_folder import KNOWN_ANSWER


def crosscheck(
    *arguments: object, cwd: Path, known_engine: bool = False, **environment: str | None
) -> subprocess.CompletedProcess[str]:
    """Run `crosscheck` with arguments in a folder; return its exit code and output."""
    words, out, err = [*map(str, arguments)], io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        for name, value in ({"CI": "1", "COLUMNS": "300"} | environment).items():
            if value is None:
                patch.delenv(name, raising=False)
            else:
                patch.setenv(name, value)
        if known_engine:
            patch.syspath_prepend(str(KNOWN_ANSWER))
        try:
            code = main(words)
        except SystemExit as ended:  # from argparse
            code = ended.code if isinstance(ended.code, int) else 1
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())
