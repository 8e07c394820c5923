"""Comparisons that are rejected: one line, with the place and the remedy."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck import CompareError
from physics_crosscheck.harness.commands.compare.candidate import (
    FailureError,
    NotInstalledError,
    candidate,
)
from physics_crosscheck.harness.commands.compare.match import declared, match
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from tests.compare.arm import MJCF, URDF
from tests.compare.asking import changed, compared, model
from tests.models import written

NONE: tuple[dict[str, str], dict[str, str]] = ({}, {})


def test_renamed_joint_is_rejected_with_a_remedy(
    tmp_path: Path,
) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('joint name="theta"', 'joint name="theta_2"'))
    # A Space has no tree to match joints by geometry.
    with pytest.raises(CompareError) as error:
        compared(model("drum_pendulum", "space.py"), other)
    assert "no match for joint" in str(error.value)
    assert "name the pairs, for instance --joints" in str(error.value)
    assert "none was found by name, order or geometry, and none can be held" in str(error.value)


def test_joint_locked_in_the_other_model_is_rejected_if_it_cannot_be_held(
    tmp_path: Path,
) -> None:
    a = written(tmp_path, "arm.xml", MJCF)
    # Coordinates of a sidecar may depend on other joints.
    written(tmp_path, "arm.xml.toml", 'engines = ["mujoco"]\n')
    b = written(
        tmp_path,
        "arm.urdf",
        URDF,
        ('"reach" type="prismatic"', '"reach" type="fixed"'),
        ("<springStiffness>300</springStiffness>", ""),
    )
    with pytest.raises(CompareError, match="joint reach of A moves on its own and has no match"):
        compared(a, b, engine_b="mujoco")


@pytest.mark.parametrize(("joints", "sentence"), [
    ("theta", "'theta' is not a pair such as"),
    ("hip=theta", "the map names 'hip'; the joints of A are x, theta"),
    ("theta=hip", "hip is neither a coordinate nor a constant; the joints of B are x, theta"),
    ("theta=2+", "can't read '2\\+'"),
])  # fmt: skip
def test_unreadable_map_is_rejected(joints: str, sentence: str) -> None:
    with pytest.raises(CompareError, match=sentence):
        match(("x", "theta"), ("x", "theta"), declared(joints, None), NONE)


@pytest.mark.parametrize(("text", "sentence"), [
    ("[joints", "map.toml: can't be read"),
    ("[coordinates]\na = 'b'", "it needs one table, \\[joints\\]"),
])  # fmt: skip
def test_unreadable_map_file_is_rejected(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(CompareError, match=sentence):
        declared("", written(tmp_path, "map.toml", text))


def test_map_may_scale_reverse_and_shift(tmp_path: Path) -> None:
    z, w = [[0.4, 0.7]], [[2.0, 3.0]]
    pairs = declared("a=2*q-1, b=-r", None)
    table = written(tmp_path, "map.toml", '[joints]\nq = "(a + 1) / 2"\nr = "-b"\n')
    for given in (pairs, declared("", table)):
        mapping = match(("a", "b"), ("q", "r"), given, NONE)
        assert mapping.source == "A"
        states = mapping.convert(np.hstack([z, w]))
        assert np.allclose(states, [[0.7, -0.7, 1.0, -3.0]], atol=1e-15)


def test_mapped_joint_is_not_matched_again() -> None:
    with pytest.raises(CompareError, match="no match for joint b of A and joint a of B"):
        match(("a", "b"), ("a", "c"), declared("a=c", None), NONE)


def test_start_of_an_unknown_joint_is_rejected() -> None:
    path = model("simple_pendulum", "mujoco.xml")
    with pytest.raises(CompareError, match=r"--start: 'phi' is not a joint, .* are theta"):
        compared(path, path, starts=({"phi": 1.0},))


@pytest.mark.parametrize(("name", "engine", "sentence"), [
    ("nothing.xml", None, "nothing.xml: there is no such file"),
    ("mujoco.xml", "havok", "no engine 'havok' is known; known are"),
    ("mujoco.xml", "pybullet", "pybullet reads .urdf files alone; choose another with --engine-b"),
    ("system.py.toml", None, "no engine reads it; they read"),
])  # fmt: skip
def test_unusable_path_or_engine_is_rejected(
    tmp_path: Path, name: str, engine: str | None, sentence: str
) -> None:
    changed(tmp_path, model("simple_pendulum", "mujoco.xml"))
    (tmp_path / "system.py.toml").write_text("")
    with pytest.raises(CompareError, match=sentence):
        candidate("B", tmp_path / name, engine)


def test_missing_engine_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from physics_crosscheck.harness.engines.pymunk import PymunkEngine

    monkeypatch.setattr(PymunkEngine, "version", lambda _: None)
    with pytest.raises(
        NotInstalledError,
        match="no engine that reads it is installed: pymunk: not installed; pip install",
    ):
        candidate("A", model("simple_pendulum", "space.py"), None)


def test_urdf_runs_in_the_first_installed_engine_of_its_sidecar(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from physics_crosscheck.harness.engines.pybullet import PybulletEngine

    path = model("simple_pendulum", "robot.urdf")
    other = changed(tmp_path, path, ('["pybullet", "mujoco"]', '["mujoco"]'))
    assert (candidate("A", path, None).engine, candidate("A", other, None).engine) == (
        "pybullet",
        "mujoco",
    )
    monkeypatch.setattr(PybulletEngine, "version", lambda _: None)
    assert candidate("A", path, None).engine == "mujoco"


def test_unreadable_sidecar_is_named(tmp_path: Path) -> None:
    path = changed(tmp_path, model("simple_pendulum", "robot.urdf"), ("[settings]", "[settings"))
    with pytest.raises(SidecarError, match=r"robot.urdf.toml: "):
        candidate("A", path, None)


def test_model_that_fails_to_load_is_named_with_its_engine(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('mass="0.45"', 'mass="-0.45"'))
    with pytest.raises(FailureError, match=r"mujoco.xml:34: MuJoCo can't load it"):
        compared(path, other)
