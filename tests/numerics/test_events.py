"""Segments with events: odd ladders, and events that are misplaced."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, Force
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.ladder import ODD_RUNGS, RUNGS, limits
from physics_crosscheck.harness.numerics.segments import (
    MisplacedEventError,
    check_events,
    extrapolate,
)
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.laws.motion import solve_events
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Segments

BALL = Path(__file__).parents[2] / "models" / "events" / "bouncing_ball"


@pytest.fixture(scope="module")
def drop() -> Segments:
    """Return the segments of a ball that drops."""
    system = load_system(BALL)
    return solve_events(derive(system), system.scenario("drop"))


def test_solved_segments_are_accepted(drop: Segments) -> None:
    check_events(drop, min(ODD_RUNGS))


@pytest.mark.parametrize("share", [0.37, 0.501, 0.999, 1.2])
def test_event_off_the_middle_of_a_segment_is_rejected(drop: Segments, share: float) -> None:
    row = 7  # free of events
    planted = float(drop.t[row] + share * drop.lengths[row])
    with pytest.raises(MisplacedEventError, match="coarse steps would agree falsely"):
        check_events(replace(drop, events=(planted,)), min(ODD_RUNGS))


def test_every_rung_of_event_segments_is_odd() -> None:
    assert all(rung % 2 for rung in ODD_RUNGS)
    assert not all(rung % 2 for rung in RUNGS)
    assert np.all(np.diff(ODD_RUNGS) > 0)


def test_event_off_the_middle_spoils_only_its_segment() -> None:
    apart = np.arange(7) == 3
    rungs, unit = ODD_RUNGS, np.ones(1)
    # A wrong limit of a force: its event is met at another phase of each rung's steps.
    ends = [np.where(apart, n * 0.37 % 1 / n, 1 + 1 / n)[:, None] for n in rungs]
    for mask, resolved in ((apart, 6), (None, 2)):
        limit = limits(ends, rungs, (1, 1), unit, unit, apart=mask)
        assert np.sum(limit.uncertainty < 1e-9) == resolved
        assert limit.uncertainty[3] > 1e-3


def test_mode_change_seen_only_by_fine_steps_leaves_no_limit(
    drop: Segments, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, coordinates = load(load_system(BALL), read_sidecar(BALL / "space.py.toml"), "pymunk")
    drop = replace(drop, scale=np.abs(drop.end).max(axis=0))
    sound = extrapolate(model, coordinates, drop, resolution=1e-9).limit
    assert np.isfinite(sound.uncertainty).all()
    rollout = model.rollout

    def mode_ends(
        q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        positions, velocities = rollout(q, v, h, n, force, every)
        return positions, velocities + 1e-4 * (n > max(ODD_RUNGS))

    monkeypatch.setattr(model, "rollout", mode_ends)
    limit = extrapolate(model, coordinates, drop, resolution=1e-9).limit
    middle = drop.t + drop.lengths / 2
    centred = np.isclose(middle[:, None], drop.events, rtol=0, atol=1e-9).any(axis=1)
    assert centred.any()
    assert np.array_equal(np.isinf(limit.uncertainty).any(axis=1), centred)
