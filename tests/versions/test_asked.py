"""What `crosscheck versions` may be asked, and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.versions.asked import (
    AskedVersion,
    asked_models,
    asked_versions,
)
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError
from tests.faults.known_folder import SYSTEM


def test_versions_are_read_in_their_order_and_environments_of_ones_own(tmp_path: Path) -> None:
    name, found = asked_versions(["pymunk", "7.0", f"7.1.0={tmp_path}"])
    assert name == "pymunk"
    assert found == (AskedVersion("7.0"), AskedVersion("7.1.0", tmp_path))


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
def test_what_means_nothing_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(FolderError, match=re.escape(message)):
        asked_versions(words)


def folder(place: Path, engine: str) -> Path:
    place.mkdir()
    (place / "system.py").write_text(SYSTEM)
    (place / "robot.urdf").write_text("<robot/>")
    (place / "robot.urdf.toml").write_text(f'engines = ["{engine}"]\n')
    return place


def test_a_folder_and_a_file_that_the_engine_does_not_run_are_told(tmp_path: Path) -> None:
    mine, other = folder(tmp_path / "mine", "pymunk"), folder(tmp_path / "other", "pybullet")
    robot = tmp_path / "arm.urdf"
    found = asked_models("pymunk", [mine, other], [robot])
    assert (found.folders, found.robots) == ((mine,), ())
    assert found.left_out == (
        f"{other}: no model of it names pymunk; left out",
        f"{robot}: pymunk reads no .urdf files; left out",
    )


def test_a_folder_whose_sidecar_cant_be_read_is_run_and_fails_there(tmp_path: Path) -> None:
    mine = folder(tmp_path / "mine", "pymunk")
    (mine / "robot.urdf.toml").write_text("engines =\n")
    assert asked_models("pybullet", [mine], []).folders == (mine,)


def test_where_nothing_is_left_it_is_wrong_usage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = folder(tmp_path / "other", "pybullet")
    assert main(["versions", str(other), "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert "no model of it names pymunk" in capsys.readouterr().err
    assert main(["versions", "nowhere", "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert main(["versions", "nowhere.urdf", "--engine", "pymunk", "7.0", "7.1"]) == 2
