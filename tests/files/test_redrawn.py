"""Parametric copies at other constants equal copies that are written one by one."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.bindings import at_constants, bindings, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.parametric_file import (
    UnboundError,
    parametric_model_file,
)
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.load import load_system

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
