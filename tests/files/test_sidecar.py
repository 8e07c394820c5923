"""Sidecars are read strictly, and their bindings redraw a model file."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.bindings import (
    UnboundError,
    at_constants,
    bindings,
    parametric_model_file,
    with_literals,
)
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.reference.load import load_system
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


MODELS = ("mujoco.xml", "robot.urdf", "space.py")


@pytest.mark.parametrize("model", MODELS)
def test_parametric_copy_equals_a_single_copy(model: str, tmp_path: Path) -> None:
    folder = builtin() / "simple_pendulum"
    system, sidecar = load_system(folder), read_sidecar(folder / f"{model}.toml")
    prepared = parametric_model_file(system, sidecar, {"m", "l", "g"}, {"m", "l", "g"})
    declared = {c.name: c.value for c in system.constants}
    for number, length in enumerate((0.31, 1.7)):
        constants = {"m": 0.9, "l": length, "g": 9.0}
        actual = prepared.write(declared | constants, tmp_path / f"actual{number}")
        bound = bindings(at_constants(system, constants), sidecar)
        expected = {b.address: b.expected for b in bound if not b.exact}
        reference = with_literals(sidecar, expected, tmp_path / f"reference{number}")
        for ending in ("", ".toml"):
            first, second = (Path(f"{copy.model}{ending}") for copy in (actual, reference))
            assert first.read_bytes() == second.read_bytes()
        assert actual.spec("").settings == reference.spec("").settings
        assert actual.model.read_bytes() != sidecar.model.read_bytes()


def copy_folder(tmp_path: Path, old: str, new: str) -> Path:
    folder = tmp_path / "pendulum"
    shutil.copytree(builtin() / "simple_pendulum", folder)
    for name in ("mujoco.xml", "mujoco.xml.toml"):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace(old, new))
    return folder


def test_constant_without_a_bound_literal_is_reported_with_its_file(tmp_path: Path) -> None:
    folder = copy_folder(tmp_path, '"body[pendulum]/inertial@pos[2]" = "-l"\n', "")
    system, sidecar = load_system(folder), read_sidecar(folder / "mujoco.xml.toml")
    parametric_model_file(system, sidecar, {"m"}, {"m", "l"})
    parametric_model_file(system, sidecar, {"l"}, {"m"})
    with pytest.raises(UnboundError, match=r"mujoco\.xml\.toml: no number .* bound to l.*bind"):
        parametric_model_file(system, sidecar, {"m", "l"}, {"m", "l"})


def test_wrong_literal_is_refused_instead_of_corrected(tmp_path: Path) -> None:
    folder = copy_folder(tmp_path, "-0.75", "-0.76")
    system, sidecar = load_system(folder), read_sidecar(folder / "mujoco.xml.toml")
    parametric_model_file(system, sidecar, {"m"}, {"m"})
    with pytest.raises(UnboundError, match=r"mujoco\.xml:\d+: the file has -0\.76.*audit"):
        parametric_model_file(system, sidecar, {"l"}, {"l"})
