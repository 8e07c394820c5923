"""Snapshots: complete in numbers."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from physics_crosscheck.harness.baseline.file import snapshot_key
from physics_crosscheck.harness.baseline.measure import (
    comparable,
    is_accepted,
    same_motion,
    segments_of,
    snapshot_of,
)
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.write import encoded
from tests.baseline.samples import SNAPSHOT, measurement
from tests.physics import physics


def test_a_snapshot_gives_back_its_scenario_to_rounding() -> None:
    prepared = physics("mass_spring_damper")
    motion = prepared.motions["step"]
    one = snapshot_of(motion, "step", prepared.components, ("f",))
    again = decoded(encoded(one).encode(), Snapshot)
    assert again == one
    assert same_motion(again, one)
    assert snapshot_key(again) == snapshot_key(one)
    segments = segments_of(again)
    times = segments.t[:, None] + segments.lengths[:, None] * np.linspace(0.0, 0.999, 50)
    u = segments.inputs_within(np.arange(len(times)), times)
    assert np.max(np.abs(u.reshape(times.size, -1) - motion.inputs(times.ravel()))) < 1e-12
    # Segments of every span, the short one before the step of force included.
    assert segments.t.min() < 1.3 < segments.t.max()


def moved(one: Snapshot, share: float) -> Snapshot:
    """With its first start moved by a share of the scale."""
    (x, *rest), *others = one.start
    return msgspec.structs.replace(one, start=((x + share * one.scale[0], *rest), *others))


def test_snapshots_are_of_one_motion_to_rounding_alone() -> None:
    assert same_motion(SNAPSHOT, moved(SNAPSHOT, 1e-12))
    assert not same_motion(SNAPSHOT, moved(SNAPSHOT, 1e-6))


def test_states_that_no_motion_joins_are_the_same_without_times() -> None:
    timeless = msgspec.structs.replace(SNAPSHOT, t=(None,) * 3)
    assert decoded(encoded(timeless).encode(), Snapshot) == timeless
    assert same_motion(timeless, timeless)
    assert not same_motion(timeless, SNAPSHOT)
    assert not same_motion(timeless, moved(timeless, 1e-6))
    assert comparable(timeless, timeless)
    assert not comparable(timeless, SNAPSHOT)


@pytest.mark.parametrize(("equations", "same"), [(1e-13, True), (1e-10, False)])
def test_a_snapshot_whose_equations_moved_is_not_kept_though_its_motion_is_the_same(
    equations: float, same: bool
) -> None:
    now = measurement(equations=equations).on_accepted
    assert now is not None
    assert is_accepted(SNAPSHOT, SNAPSHOT, now) is same
    assert not is_accepted(moved(SNAPSHOT, 1e-6), SNAPSHOT, now)
