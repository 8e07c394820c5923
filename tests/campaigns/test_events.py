"""The census of motions with events: the truth of a few draws is within their uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaigns.events import (
    EVENTS,
    PEER_TESTS,
    RESOLUTION,
    Tally,
    compare,
    drawn,
    judged,
    peer_row,
    planted_edits,
)
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.mutation.mistakes import Edit
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.load import load_system


def test_the_truth_of_drawn_balls_is_within_the_uncertainty() -> None:
    folder: Path = EVENTS / "bouncing_ball"
    sidecar, tally = read_sidecar(folder / "space.py.toml"), Tally()
    random = np.random.default_rng(3)
    lines = [*compare(drawn(load_system(folder), random), sidecar, "pymunk", tally)]
    assert not any(line.startswith("OUTSIDE") for line in lines)
    assert tally.segments > 10
    assert tally.resolved > 0.9 * tally.segments
    assert tally.outside == 0


def test_a_stop_distance_of_another_project_is_measured_finer_than_its_tolerance() -> None:
    test = next(one for one in PEER_TESTS if one.peer == "Newton, stop distance, mu 0.7")
    *_, error, uncertainty = peer_row(test).strip("| ").split(" | ")
    assert float(error) < float(uncertainty) < 1e-8


@pytest.mark.parametrize(
    ("model", "numbers"),
    [
        ("bouncing_ball/space.py", {"RESTITUTION"}),
        ("bouncing_ball/mujoco.xml", {"geom[ball]@solref[0]"}),
        ("pendulum_stop/mujoco.xml", {"joint[theta]@range[1]", "joint[theta]@solreflimit[0]"}),
    ],
)
def test_numbers_of_contacts_and_laws_are_planted_and_masses_are_not(
    model: str, numbers: set[str]
) -> None:
    sidecar = read_sidecar(EVENTS / f"{model}.toml")
    edits = planted_edits(load_system(sidecar.model.parent), sidecar)
    assert {address for address, _, _ in edits} == numbers


@pytest.mark.slow
def test_a_drive_that_leaves_its_limit_some_steps_early_is_resolved() -> None:
    # The ladder's coarsest rung has one step before the event; finer ones leave two steps early.
    folder = EVENTS / "saturated_servo"
    constants = {"m": 0.74384823821388705, "kp": 65.07412584242924, "kd": 5.618584911875705,
                 "F": 8.6691978778863561, "target": 0.4592167831077551}  # fmt: skip
    system = at_constants(load_system(folder), constants)
    sidecar = read_sidecar(folder / "space.py.toml")
    _, error, total = judged(system, sidecar, "pymunk", system.scenarios[0])
    assert np.all(error < total)
    assert total.max() < RESOLUTION


@pytest.mark.slow
def test_a_number_that_leaves_an_event_without_a_limit_is_named(tmp_path: Path) -> None:
    sidecar = read_sidecar(EVENTS / "pendulum_stop" / "space.py.toml")
    task = model_task(prepare_system(sidecar.model.parent, described=False), "pymunk", sidecar)
    wrong = Edit({"LIMIT": 0.404}).apply(sidecar, "pymunk", tmp_path)
    (cause,) = diagnose_model(task.with_sidecar(wrong)).explanations[0].causes
    assert cause.subject == ("LIMIT",)
