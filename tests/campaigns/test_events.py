"""The census of motions with events: the truth of a few draws is within their uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from campaigns.events import EVENTS, Tally, compare, drawn
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
