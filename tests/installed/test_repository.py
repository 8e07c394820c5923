"""A repository of two systems, from the wheel alone: run, pytest, accept, gate, break, gate."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from tests.installed.conftest import Installed

REPOSITORY = Path(__file__).parent / "repository"


def test_a_fresh_repository_is_run_tested_accepted_and_gated(
    installed: Installed, tmp_path: Path
) -> None:
    place = tmp_path / "robots"
    shutil.copytree(REPOSITORY, place)

    def does(command: str, code: int = 0, **environment: str) -> str:
        done = installed.shell(command, place, **environment)
        assert done.returncode == code, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout

    assert "12 cases: 12 AGREES" in does("git init --quiet && crosscheck run models")
    assert "18 passed" in does("pytest -q -n 2 --crosscheck models")
    assert does("crosscheck accept --folder models --reason measured").count("accepted ") == 12
    assert "0 run" in does("crosscheck gate")

    model = place / "models" / "cart_pole" / "mujoco.xml"
    text = model.read_text()
    model.write_text(text.replace('mass="0.25"', 'mass="0.2501"'))
    line = text[: text.index('mass="0.25"')].count("\n") + 1
    told = does("crosscheck gate", 1, CI="1", GITHUB_ACTIONS="true")
    noted = re.findall(r"^::error file=(.*?),line=(\d+),", told, re.MULTILINE)
    assert noted == [("models/cart_pole/mujoco.xml", str(line))]
    assert "body[pole]/inertial@mass 0.25 -> 0.2501, bound to m" in told
    # A decision of a person: CI can't take it.
    does("crosscheck accept --reason no", 2, CI="1")

    does("crosscheck accept --reason 'weighed again'")
    assert "the gate passes" in does("crosscheck gate", CI="1", GITHUB_ACTIONS="true")
