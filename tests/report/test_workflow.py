"""The workflow that publishes the report: its steps, run in GitHub's shell."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome
from tests.records.made import case, results, verdict

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")


def steps() -> dict[str, Any]:
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((ROOT / "docs/ci/github-pages.yml").read_text())
    entries = workflow["jobs"]["publish"]["steps"]
    return {step["name"]: step for step in entries if "run" in step and "name" in step}


def shell(script: str, place: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a step's script as GitHub does: bash ends at the first command that fails."""
    path = f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        cwd=place,
        env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "CI": "1", **environment},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Create a repository with a fake `crosscheck run` that exits with a given code.

    Other tests check `run` itself; a test below checks its options.
    """
    (tmp_path / "bin").mkdir()
    stored = tmp_path / "kept.json"
    off = verdict(discrepancy=1e-3, largest_discrepancy=1e-3)
    differing = case(Outcome.DIFFERS, reason="x is off", verdict=off)
    stored.write_text(encoded(results(differing, case(engine="x"))))
    command = tmp_path / "bin" / "crosscheck"
    command.write_text(f"""#!/bin/sh
if [ "$1" = run ]; then
  mkdir -p reports; cp {stored} reports/results.json; exit $RUN_ENDS_WITH
fi
exec "{sys.executable}" -m physics_crosscheck "$@"
""")
    command.chmod(0o755)
    return tmp_path


def test_steps_publish_the_page(place: Path) -> None:
    run = steps()["Run everything"]["run"]
    for code, ends in (("0", 0), ("1", 0), ("3", 0), ("2", 1)):
        assert shell(run, place, RUN_ENDS_WITH=code).returncode == ends, code


def test_commands_and_options_exist(capsys: pytest.CaptureFixture[str]) -> None:
    scripts = " ".join(step["run"] for step in steps().values())
    called = re.findall(r"crosscheck (\w+)((?: [\w./-]+)*)", scripts)
    assert [name for name, _ in called] == ["run"]
    for name, options in called:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        help_text = capsys.readouterr().out
        assert all(option in help_text for option in options.split() if option.startswith("--"))
