"""`crosscheck audit` of folders, of single models and of unreadable targets."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.folders import builtin
from tests.commands import crosscheck
from tests.models import edited
from tests.standing import keep_default_engines, shorten_scenarios


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Create a folder `pendulum` whose models have the wrong gravity; return its parent."""
    folder = tmp_path_factory.mktemp("audited") / "pendulum"
    shutil.copytree(builtin() / "simple_pendulum", folder)
    keep_default_engines(folder)
    shorten_scenarios(folder)
    edited(folder / "system.py", "9.81", "9.8")
    return folder.parent


@pytest.mark.parametrize(("name", "audited"), [
    ("pendulum/mujoco.xml", ["pendulum/mujoco.xml [mujoco]"]),
    ("pendulum/robot.urdf/free [pybullet]", ["pendulum/robot.urdf [pybullet]"]),  # a case's name
])  # fmt: skip
def test_name_of_a_model_audits_only_that_model(place: Path, name: str, audited: list[str]) -> None:
    ran = crosscheck("audit", name, cwd=place)
    assert ran.returncode == 1, ran.stderr
    *printed, hint = ran.stdout.splitlines()
    assert hint == "Explain a code: crosscheck explain XC101"
    assert [line.replace("simple_pendulum", "pendulum") for line in printed if line[0] != " "] == (
        audited
    )
    lines = [line for line in printed if line.startswith("  finding  XC101 ")]
    assert lines
    file = audited[0].partition(" ")[0]
    assert all(
        re.search(rf" {re.escape(file)}(\.toml)?:\d+: .* -g = -9\.8 ", line) for line in lines
    )


@pytest.fixture
def _without_xacro(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the package of the extra `ros`."""
    monkeypatch.setitem(sys.modules, "xacro", None)


@pytest.mark.usefixtures("_without_xacro")
@pytest.mark.parametrize(("name", "message"), [
    ("pendulum/mujoco.xml [pymunk]", "no model matches these names and engines; run `cross"),
    ("pendulum/other.xml", "pendulum/other.xml: there is no such file"),
    ("arm.xacro", "arm.xacro: it is source for xacro, which no engine reads; expand it"),
])  # fmt: skip
def test_invalid_target_is_reported_with_a_remedy(place: Path, name: str, message: str) -> None:
    (place / "arm.xacro").write_text("<robot name='arm'/>")
    ran = crosscheck("audit", name, cwd=place)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert message in ran.stderr
    assert ran.stderr.count("\n") == 1


@pytest.mark.usefixtures("_without_xacro")
def test_invalid_targets_do_not_stop_the_audit_of_a_model(place: Path) -> None:
    (place / "arm.xacro").write_text("<robot name='arm'/>")
    ran = crosscheck("audit", "pendulum/mujoco.xml", "pendulums", "arm.xacro", cwd=place)
    assert "mujoco.xml [mujoco]" in ran.stdout
    assert "pendulums: no such folder" in ran.stderr
    assert "arm.xacro: it is source for" in ran.stderr
    assert ran.returncode == 2


def test_unreadable_sidecar_is_an_error_of_its_model(place: Path, tmp_path: Path) -> None:
    shutil.copytree(place / "pendulum", tmp_path / "pendulum")
    (tmp_path / "pendulum" / "mujoco.xml.toml").write_text("engines = 3\n")
    ran = crosscheck("audit", "pendulum/mujoco.xml [mujoco]", cwd=tmp_path)
    assert ran.returncode == 3
    assert "  ERROR    " in ran.stdout
    assert "mujoco.xml.toml" in ran.stdout
