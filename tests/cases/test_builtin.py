"""The built-in models, beside their verdicts: those are `pytest --crosscheck models`."""

import itertools
from pathlib import Path

import pytest

from harness.cases.case import LinearizationTask, run_linearizations
from harness.cases.prepare import prepare
from harness.engines.registry import engines
from harness.files.folders import builtin
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
            twins = run_linearizations(
                LinearizationTask(
                    physics.system,
                    sidecar,
                    engine,
                    physics.equilibria,
                    physics.amplitude,
                    physics.push,
                )
            )
            assert len(twins) == len(physics.equilibria)
            for twin in twins:
                assert twin["A_error"] <= 1e-8
                assert twin["B_error"] <= 1e-8
                assert twin["transfer_error"] <= 1e-6
                assert twin["shapes"] > 1 - 1e-9


SOUND = {
    "system": "torsional_disc", "model": "mujoco.xml", "engine": "mujoco", "scenario": "free",
    "discrepancy": 1e-13, "uncertainty": 1e-12, "claimed_order": 1, "order": 1.0, "raw_order": 1.0,
    "checked_step": {"target": 0.001, "step": 1e-4, "measured": 0.001}, "energy_error": 0.01,
    "constraint_drift": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(("fault", "count"), [
    ({}, 0), ({"discrepancy": 2e-10}, 1), ({"uncertainty": 2e-10}, 1), ({"order": 1.4}, 1),
    ({"order": float("nan")}, 1), ({"raw_order": 0.6}, 1), ({"checked_step": None}, 1),
    ({"checked_step": {"target": 0.001, "step": 1e-4, "measured": 0.002}}, 1),
    ({"energy_error": 0.3}, 1), ({"constraint_drift": 0.1}, 1),
    ({"system": "drum_pendulum", "model": "mujoco_rolling.xml"}, 1),
])  # fmt: skip
def test_more_than_agreement_is_demanded_of_them(pytestconfig, fault, count):
    (demands,) = pytestconfig.hook.pytest_crosscheck_case(record=SOUND | fault)
    assert len(demands) == count
