"""Missing names on a command line: suggestions of similar existing names."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    similar_path,
    system_folders,
)
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").mkdir()
    for name in ("robot.xml", "robot.urdf", "robots/panda.urdf", ".robotx.urdf", "b.urdf"):
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(("missing", "similar"), [
    ("robo.urdf", "robot.urdf"),
    ("robo.xml", "robot.xml"),
    ("robot.sdf", "robot.urdf"),
    ("robts/pnda.urdf", "robots/panda.urdf"),
    ("robts/panda.urdf", "robots/panda.urdf"),
])  # fmt: skip
def test_missing_file_suggests_a_similar_name(place: Path, missing: str, similar: str) -> None:
    fault = f"{missing}: there is no such file; did you mean {similar}?"
    assert robot_files([missing]).faults == {missing: fault}


@pytest.mark.parametrize("missing", ["a.urdf", "nothing/robot.urdf", "/nowhere/at/all.urdf"])
def test_equal_suffix_alone_makes_no_suggestion(place: Path, missing: str) -> None:
    assert similar_path(Path(missing)) == ""


def test_misspelled_system_suggests_a_similar_name(place: Path) -> None:
    for name, similar in (("simple_pendlum", "simple_pendulum"), ("robts", "robots")):
        with pytest.raises(FolderError, match=f"^{name}: no such folder; did you mean {similar}"):
            system_folders([name])
