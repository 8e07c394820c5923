"""The validation itself: every built-in model in every engine and scenario, to ten digits."""

import itertools
import json
import subprocess
import sys

import jsonschema
import pytest

from harness.folders import builtin
from harness.results import schema

BAR = 1e-10


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    out = tmp_path_factory.mktemp("matrix")
    done = subprocess.run(
        [sys.executable, "-m", "harness", "run", "--out", str(out), "--require-engines"],
        cwd=builtin().parent, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    return json.loads((out / "results.json").read_text())


def test_results_follow_their_schema(found):
    jsonschema.validate(found, schema())


def test_all_six_systems_run_in_all_four_pairings(found):
    systems = {path.parent.name for path in builtin().glob("*/system.py")}
    pairings = {("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")}
    seen = {(c["system"], c["engine"], "." + c["model"].split(".")[-1]) for c in found["cases"]}
    assert len(systems) == 6
    assert seen == {(s, *pairing) for s, pairing in itertools.product(systems, pairings)}


def test_every_case_agrees_within_the_bar(found):
    for case in found["cases"]:
        assert case["outcome"] == "AGREES", case["reason"]
        assert case["discrepancy"] <= BAR, case
        assert case["uncertainty"] <= BAR, case
        assert case["discrepancy"] <= case["uncertainty"]


def test_plain_runs_bear_out_the_claimed_order(found):
    for case in found["cases"]:
        assert case["raw_order"] > case["claimed_order"] - 0.3, case
        assert case["order"] == pytest.approx(case["claimed_order"], abs=0.3), case


def test_a_step_told_was_run_and_gave_the_error_it_was_told_for(found):
    checked = [case["checked_step"] for case in found["cases"] if case["checked_step"]]
    assert len(checked) > 0.7 * len(found["cases"])
    for check in checked:
        assert 0.3 * check["target"] < check["measured"] < 1.3 * check["target"]


def test_the_engines_linearizations_are_taylors(found):
    assert {model["system"] for model in found["models"]} == {s["name"] for s in found["systems"]}
    for model in found["models"]:
        system = next(s for s in found["systems"] if s["name"] == model["system"])
        assert len(model["linearization"]) == len(system["linearizations"])
        for twin in model["linearization"]:
            assert twin["A_error"] <= 1e-8
            assert twin["B_error"] <= 1e-8
            assert twin["transfer_error"] <= 1e-6
            assert twin["shapes"] > 1 - 1e-9


def test_a_rolling_drum_is_held_by_a_constraint_in_mujoco_and_in_pybullet(found):
    rolling = {
        (case["model"], case["engine"])
        for case in found["cases"]
        if case["system"] == "drum_pendulum" and case["constraint_drift"] > 0
    }
    assert ("mujoco_rolling.xml", "mujoco") in rolling
    assert ("robot.urdf", "pybullet") in rolling


def test_energy_and_constraints_hold_to_the_size_of_the_step(found):
    for case in found["cases"]:
        assert case["energy_error"] < 0.2, case
        assert case["constraint_drift"] < 0.05, case
