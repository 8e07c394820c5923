"""Snapshots that hold a motion completely in numbers."""

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


def test_snapshot_reproduces_its_scenario_to_rounding() -> None:
    prepared = physics("mass_spring_damper")
    motion = prepared.motions["step"]
    original = snapshot_of(motion, "step", prepared.components, ("f",))
    again = decoded(encoded(original).encode(), Snapshot)
    assert again == original
    assert same_motion(again, original)
    assert snapshot_key(again) == snapshot_key(original)
    segments = segments_of(again)
    times = segments.t[:, None] + segments.lengths[:, None] * np.linspace(0.0, 0.999, 50)
    u = segments.inputs_within(np.arange(len(times)), times)
    assert np.max(np.abs(u.reshape(times.size, -1) - motion.inputs(times.ravel()))) < 1e-12
    # Segments cover every span, including the short one before the step of force.
    assert segments.t.min() < 1.3 < segments.t.max()


def moved(snapshot: Snapshot, share: float) -> Snapshot:
    """Return the snapshot with its first start moved by a share of the scale."""
    (x, *rest), *others = snapshot.start
    start = ((x + share * snapshot.scale[0], *rest), *others)
    return msgspec.structs.replace(snapshot, start=start)


def test_same_motion_allows_rounding_only() -> None:
    assert same_motion(SNAPSHOT, moved(SNAPSHOT, 1e-12))
    assert not same_motion(SNAPSHOT, moved(SNAPSHOT, 1e-6))


def test_isolated_states_are_compared_without_times() -> None:
    timeless = msgspec.structs.replace(SNAPSHOT, t=(None,) * 3)
    assert decoded(encoded(timeless).encode(), Snapshot) == timeless
    assert same_motion(timeless, timeless)
    assert not same_motion(timeless, SNAPSHOT)
    assert not same_motion(timeless, moved(timeless, 1e-6))
    assert comparable(timeless, timeless)
    assert not comparable(timeless, SNAPSHOT)


@pytest.mark.parametrize(("equations", "same"), [(1e-13, True), (1e-10, False)])
def test_snapshot_with_moved_equations_is_not_accepted(equations: float, same: bool) -> None:
    now = measurement(equations=equations).on_accepted
    assert now is not None
    assert is_accepted(SNAPSHOT, SNAPSHOT, now) is same
    assert not is_accepted(moved(SNAPSHOT, 1e-6), SNAPSHOT, now)
