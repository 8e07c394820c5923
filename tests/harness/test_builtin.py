"""The built-in models, beside their verdicts: those are `pytest --crosscheck models`."""

import itertools
from pathlib import Path

import pytest

from harness.case import TwinTask, run_twins
from harness.engines import engines
from harness.folders import builtin
from harness.prepare import prepare
from harness.run import model_files

FOLDERS = sorted(path.parent for path in builtin().glob("*/system.py"))


def test_all_six_systems_run_in_all_four_pairings():
    pairings = {("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")}
    seen = {
        (folder.name, engine, sidecar.model.suffix)
        for folder in FOLDERS
        for sidecar in model_files(folder)
        for engine in sidecar.engines
    }
    assert len(FOLDERS) == 6
    assert seen == {(f.name, *pairing) for f, pairing in itertools.product(FOLDERS, pairings)}


def test_make_test_runs_them_as_tests():
    lines = (Path(__file__).parents[2] / "Makefile").read_text().splitlines()
    assert any("--crosscheck models" in line and "--require-engines" in line for line in lines)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_engines_linearizations_are_taylors(folder):
    physics = prepare(folder)
    known = engines()
    for sidecar in model_files(folder):
        for engine in sidecar.engines:
            if known[engine].version() is None:
                pytest.skip(f"{engine} is not installed")
            twins = run_twins(
                TwinTask(
                    physics.system, sidecar, engine, physics.equilibria, physics.amplitude,
                    physics.push,
                )
            )  # fmt: skip
            assert len(twins) == len(physics.equilibria)
            for twin in twins:
                assert twin["A_error"] <= 1e-8
                assert twin["B_error"] <= 1e-8
                assert twin["transfer_error"] <= 1e-6
                assert twin["shapes"] > 1 - 1e-9
