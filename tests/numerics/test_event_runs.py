"""Motions with events: segments around them, and full runs through them."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, Force
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.event_runs import phase_spread, study_events
from physics_crosscheck.harness.numerics.ladder import RUNGS, limits
from physics_crosscheck.harness.numerics.segments import (
    MisplacedEventError,
    check_events,
    extrapolate,
)
from physics_crosscheck.harness.numerics.step_study import StepStudy
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.laws.motion import solve_events
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Motion, Segments
from tests.models import edited

ODD_RUNGS = (3, 5, 7, 11, 17, 29, 49, 81)

BALL = Path(__file__).parents[2] / "models" / "events" / "bouncing_ball"
DT = 0.002


@pytest.fixture(scope="module")
def drop() -> Motion:
    system = load_system(BALL)
    return solve_events(derive(system), system.scenario("drop"))


def studied(motion: Motion, folder: Path = BALL) -> StepStudy:
    """Return the full runs of the ball in pymunk."""
    model, coordinates = load(load_system(BALL), read_sidecar(folder / "space.py.toml"), "pymunk")
    return study_events(model, coordinates, motion, power=None, amplitude=motion.amplitude)


def test_full_runs_have_order_one_and_show_each_impact(drop: Motion) -> None:
    study = studied(drop)
    assert study.full_run_check.converges
    assert study.full_run_check.order == pytest.approx(1, abs=0.25)
    assert [event.change for event in study.events] == ["impact"] * 3
    for event in study.events:
        assert event.in_run is not None
        assert abs(event.in_run - event.time) < 3 * DT
    assert study.checked is not None
    target, _, measured = study.checked
    assert measured < 2 * target
    # Velocities are compared away from impacts, where they are off by a whole jump.
    assert study.velocity_error < 0.1


def test_runs_with_another_restitution_do_not_converge(drop: Motion, tmp_path: Path) -> None:
    copy = tmp_path / "bouncing_ball"
    shutil.copytree(BALL, copy)
    edited(copy / "space.py", "RESTITUTION = 0.8", "RESTITUTION = 0.77")
    study = studied(drop, copy)
    assert not study.full_run_check.converges
    assert study.steps_for == (None, None, None)


@pytest.mark.parametrize(("per_second", "constant"), [(5.0, 0.0), (0.0, 0.01)])
def test_error_that_falls_with_the_step_is_not_a_difference(
    drop: Motion, monkeypatch: pytest.MonkeyPatch, per_second: float, constant: float
) -> None:
    model, coordinates = load(load_system(BALL), read_sidecar(BALL / "space.py.toml"), "pymunk")
    rollout = model.rollout

    def with_error(
        q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        positions, velocities = rollout(q, v, h, n, force, every)
        return positions, velocities + per_second * h + constant

    monkeypatch.setattr(model, "rollout", with_error)
    motion = replace(drop, scale=drop.amplitude)
    spread = phase_spread(model, coordinates, motion, drop.events[0])
    assert spread is not None
    assert spread.shrinks
    assert (spread.off > 0) == (constant > 0)


@pytest.fixture(scope="module")
def fall() -> Segments:
    system = load_system(BALL)
    return solve_events(derive(system), system.scenario("drop"))


def test_solved_segments_are_accepted(fall: Segments) -> None:
    check_events(fall, min(ODD_RUNGS))


@pytest.mark.parametrize("share", [0.37, 0.501, 0.999, 1.2])
def test_event_off_the_middle_of_a_segment_is_rejected(fall: Segments, share: float) -> None:
    row = 7  # free of events
    planted = float(fall.t[row] + share * fall.lengths[row])
    with pytest.raises(MisplacedEventError, match="coarse steps would agree falsely"):
        check_events(replace(fall, events=(planted,)), min(ODD_RUNGS))


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
    fall: Segments, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, coordinates = load(load_system(BALL), read_sidecar(BALL / "space.py.toml"), "pymunk")
    fall = replace(fall, scale=np.abs(fall.end).max(axis=0))
    sound = extrapolate(model, coordinates, fall, resolution=1e-9).limit
    assert np.isfinite(sound.uncertainty).all()
    rollout = model.rollout

    def mode_ends(
        q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        positions, velocities = rollout(q, v, h, n, force, every)
        return positions, velocities + 1e-4 * (n > max(ODD_RUNGS))

    monkeypatch.setattr(model, "rollout", mode_ends)
    limit = extrapolate(model, coordinates, fall, resolution=1e-9).limit
    middle = fall.t + fall.lengths / 2
    centred = np.isclose(middle[:, None], fall.events, rtol=0, atol=1e-9).any(axis=1)
    assert centred.any()
    assert np.array_equal(np.isinf(limit.uncertainty).any(axis=1), centred)
