"""The census of motions with events: a few draws are within their uncertainty of the truth."""

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


def test_drawn_balls_are_within_their_uncertainty() -> None:
    folder: Path = EVENTS / "bouncing_ball"
    sidecar, tally = read_sidecar(folder / "space.py.toml"), Tally()
    random = np.random.default_rng(3)
    lines = [*compare(drawn(load_system(folder), random), sidecar, "pymunk", tally)]
    assert not any(line.startswith("OUTSIDE") for line in lines)
    assert tally.segments > 10
    assert tally.resolved > 0.9 * tally.segments
    assert tally.outside == 0


def test_peer_stop_distance_is_measured_below_its_tolerance() -> None:
    test = next(each for each in PEER_TESTS if each.peer == "Newton, stop distance, mu 0.7")
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
def test_faults_are_planted_in_contacts_but_not_in_masses(model: str, numbers: set[str]) -> None:
    sidecar = read_sidecar(EVENTS / f"{model}.toml")
    edits = planted_edits(load_system(sidecar.model.parent), sidecar)
    assert {address for address, _, _ in edits} == numbers


@pytest.mark.slow
def test_drive_that_leaves_its_limit_early_is_resolved() -> None:
    # The coarsest time step has one step before the event; with finer ones it is two steps early.
    folder = EVENTS / "saturated_servo"
    constants = {"m": 0.74384823821388705, "kp": 65.07412584242924, "kd": 5.618584911875705,
                 "F": 8.6691978778863561, "target": 0.4592167831077551}  # fmt: skip
    system = at_constants(load_system(folder), constants)
    sidecar = read_sidecar(folder / "space.py.toml")
    _, error, total = judged(system, sidecar, "pymunk", system.scenarios[0])
    assert np.all(error < total)
    assert total.max() < RESOLUTION


@pytest.mark.slow
def test_wrong_event_limit_is_named(tmp_path: Path) -> None:
    sidecar = read_sidecar(EVENTS / "pendulum_stop" / "space.py.toml")
    task = model_task(prepare_system(sidecar.model.parent, described=False), "pymunk", sidecar)
    wrong = Edit({"LIMIT": 0.404}).apply(sidecar, "pymunk", tmp_path)
    (cause,) = diagnose_model(task.with_sidecar(wrong)).explanations[0].causes
    assert cause.subject == ("LIMIT",)
