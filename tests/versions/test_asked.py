"""Arguments of `crosscheck versions`: accepted and rejected ones."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.versions.main import requested_targets, requested_versions
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError
from tests.faults.known_folder import SYSTEM


def test_versions_and_user_environments_are_parsed_in_order(tmp_path: Path) -> None:
    name, versions = requested_versions(["pymunk", "7.0", f"7.1.0={tmp_path}"])
    assert name == "pymunk"
    assert versions == {"7.0": None, "7.1.0": tmp_path}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pymunk", "7.0"], "name two versions of it or more"),
        (["pymunk"], "name two versions of it or more"),
        (["pymunk", "7.0", "7.0"], "7.0 is asked for twice"),
        (["nobody", "1", "2"], "no engine 'nobody' is known"),
        (
            ["pymunk", "7.0", "7.1", "my/folder"],
            "my/folder is not a version; folders and files come",
        ),
        (["pymunk", "7.0", "--pre"], "--pre is not a version"),
        (["pymunk", "7.0", "7.1=nowhere/at/all"], "there is no such environment"),
    ],
)
def test_invalid_arguments_are_rejected(words: list[str], message: str) -> None:
    with pytest.raises(FolderError, match=re.escape(message)):
        requested_versions(words)


def folder(place: Path, engine: str) -> Path:
    place.mkdir()
    (place / "system.py").write_text(SYSTEM)
    (place / "robot.urdf").write_text("<robot/>")
    (place / "robot.urdf.toml").write_text(f'engines = ["{engine}"]\n')
    return place


def test_targets_that_the_engine_does_not_run_are_reported(tmp_path: Path) -> None:
    mine, other = folder(tmp_path / "mine", "pymunk"), folder(tmp_path / "other", "pybullet")
    robot = tmp_path / "arm.urdf"
    robot.write_text("<robot/>")
    targets, left_out = requested_targets("pymunk", [str(mine), str(other), str(robot)])
    assert targets == [mine]
    assert left_out == [
        f"{other}: no model of it names pymunk; left out",
        f"{robot}: pymunk reads no .urdf files; left out",
    ]


def test_folder_with_unreadable_sidecar_is_kept(tmp_path: Path) -> None:
    mine = folder(tmp_path / "mine", "pymunk")
    (mine / "robot.urdf.toml").write_text("engines =\n")
    assert requested_targets("pybullet", [str(mine)]) == ([mine], [])


def test_no_remaining_target_is_a_usage_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = folder(tmp_path / "other", "pybullet")
    assert main(["versions", str(other), "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert "no model of it names pymunk" in capsys.readouterr().err
    assert main(["versions", "nowhere", "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert main(["versions", "nowhere.urdf", "--engine", "pymunk", "7.0", "7.1"]) == 2
