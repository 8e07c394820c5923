"""The workflow that publishes the report: its steps, run as a shell of GitHub's runs them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.write import encoded
from tests.records.made import case, results, verdict

ROOT = Path(__file__).parents[2]
OWN = ("Run everything", "Badge", "What moved since the last run")

pytestmark = pytest.mark.skipif(
    shutil.which("bash") is None or shutil.which("curl") is None, reason="no bash, or no curl"
)


def steps() -> dict[str, Any]:
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((ROOT / "docs/ci/github-pages.yml").read_text())
    found = workflow["jobs"]["publish"]["steps"]
    return {step["name"]: step for step in found if "run" in step and "name" in step}


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
    """A repository, and `crosscheck` as a command whose `run` takes no time: it ends with a code.

    What `run` itself does is tested elsewhere; that it has these options, below.
    """
    (tmp_path / "bin").mkdir()
    kept = tmp_path / "kept.json"
    off = verdict(discrepancy=1e-3, largest_discrepancy=1e-3)
    differing = case(Outcome.DIFFERS, reason="x is off", verdict=off)
    kept.write_text(encoded(results(differing, case(engine="x"))))
    command = tmp_path / "bin" / "crosscheck"
    command.write_text(f"""#!/bin/sh
if [ "$1" = run ]; then
  mkdir -p reports/history; cp {kept} reports/results.json; exit $RUN_ENDS_WITH
fi
exec "{sys.executable}" -m physics_crosscheck "$@"
""")
    command.chmod(0o755)
    return tmp_path


def test_its_steps_publish_a_page_with_badge_and_what_moved(place: Path) -> None:
    found = steps()
    run, badge, moved = (found[name]["run"] for name in OWN)
    for code, ends in (("0", 0), ("1", 0), ("3", 0), ("2", 1)):
        assert shell(run, place, RUN_ENDS_WITH=code).returncode == ends, code
    assert shell(badge, place).returncode == 0
    published = place / "published"
    nothing = shell(moved, place, LAST=published.as_uri())
    assert nothing.returncode == 0, "nothing is published yet"
    assert nothing.stdout == ""
    published.mkdir()
    (published / "results.json").write_text(encoded(results(case())))
    told = shell(moved, place, LAST=published.as_uri())
    assert told.returncode == 0, told.stderr
    assert "2 cases: 1 with another verdict, 1 new; 1 worse" in told.stdout
    names = {path.name for path in (place / "reports").iterdir()}
    assert {"index.html", "results.json", "badge.svg", "changes.html", "history"} <= names


def test_its_commands_and_their_options_are_there(capsys: pytest.CaptureFixture[str]) -> None:
    scripts = " ".join(step["run"] for step in steps().values())
    called = re.findall(r"crosscheck (\w+)((?: [\w./-]+)*)", scripts)
    assert [name for name, _ in called] == ["run", "report", "report"]
    for name, options in called:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        told = capsys.readouterr().out
        assert all(one in told for one in options.split() if one.startswith("--"))
