"""Sidecars: their contents, and the refusal of wrong ones."""

from collections.abc import Callable
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from tests.models import written

GOOD = """
engines = ["pybullet", "mujoco"]
[settings]
step = 0.002
gravity = [0, 0, -9.81]
[settings.mujoco]
integrator = "Euler"
[coordinates]
phi = "x / r"
[readback]
x = "x"
[[spring]]
joints = {x1 = 1, x2 = -1}
stiffness = 38.0
damping = 0.35
rest = 0
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def make(text: str) -> Path:
        (tmp_path / "robot.urdf").write_text("<robot/>")
        path = written(tmp_path, "robot.urdf.toml", text)
        return path

    return make


def test_all_keys_are_read(write: Callable[[str], Path]) -> None:
    sidecar = read_sidecar(write(GOOD))
    assert sidecar.engines == ("pybullet", "mujoco")
    assert sidecar.coordinates == {"phi": "x / r"}
    assert sidecar.springs[0].joints == {"x1": 1, "x2": -1}
    assert sidecar.springs[0].stiffness == 38.0


def test_engine_gets_only_its_own_settings(write: Callable[[str], Path]) -> None:
    sidecar = read_sidecar(write(GOOD))
    assert sidecar.spec("mujoco").settings["integrator"] == "Euler"
    assert "integrator" not in sidecar.spec("pybullet").settings
    assert sidecar.spec("pybullet").settings["step"] == 0.002


@pytest.mark.parametrize(("change", "sentence"), [
    (('engines = ["pybullet", "mujoco"]', ""), "engines must list engine names"),
    (('engines = ["pybullet", "mujoco"]', "engines = []"), "engines must list engine names"),
    (("step = 0.002", "step = 0"), "step is 0; expected a positive number"),
    (("step = 0.002", "step = '2 ms'"), "step is '2 ms'"),
    (("[0, 0, -9.81]", "-9.81"), "gravity is -9.81; expected three numbers"),
    (("[settings.mujoco]", "[settings.drake]"), "that `engines` does not list"),
    (("[readback]", "[read_back]"), "unknown key 'read_back'; known keys"),
    (('phi = "x / r"', "phi = true"), "'phi' must be an expression"),
    (("stiffness = 38.0\n", ""), "must have each of damping, joints, rest, stiffness"),
    (("stiffness = 38.0", "stiffness = nan"), "stiffness is nan"),
    (("{x1 = 1, x2 = -1}", "['x1', 'x2']"), "joints must map joint names"),
    (("step = 0.002", "step = = 1"), "not TOML"),
])  # fmt: skip
def test_wrong_sidecar_is_refused_with_its_file_and_place(
    write: Callable[[str], Path], change: tuple[str, str], sentence: str
) -> None:
    assert change[0] in GOOD
    path = write(GOOD.replace(*change))
    with pytest.raises(SidecarError, match=sentence) as refused:
        read_sidecar(path)
    assert str(path) in str(refused.value)


def test_sidecar_without_its_model_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "gone.urdf.toml", 'engines = ["mujoco"]')
    with pytest.raises(SidecarError, match=r"there is no model file gone\.urdf"):
        read_sidecar(path)
