"""Cases of `docs/cases.md` that need an optional engine."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from tests.engines.extras import need
from tests.faults.known_folder import environment
from tests.installed.documents import ROOT, check_shown, commands

CROSSCHECK = f'crosscheck() {{ {shlex.quote(sys.executable)} -m physics_crosscheck "$@"; }}\n'


def test_constraint_that_drake_ignores_is_reported_as_on_the_page(tmp_path: Path) -> None:
    need("drake")
    shutil.copy(ROOT / "docs" / "cases" / "fingers.urdf", tmp_path)
    _, excepted = commands((ROOT / "docs" / "cases.md").read_text())
    (last,) = (i for i, one in enumerate(excepted) if one.text == "crosscheck run hand")
    for command in excepted[last - 3 : last + 1]:
        done = subprocess.run(
            ["bash", "-c", CROSSCHECK + command.text],
            cwd=tmp_path,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        assert done.returncode == command.code, done.stdout + done.stderr
        check_shown(command, done.stdout)
    assert len(excepted[last].shown) == 4
