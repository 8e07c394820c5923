"""Motions with events in a baseline: unchanged, a changed model, and changed equations."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from physics_crosscheck.harness.commands.gate.accept import accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.survey import GateOptions
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.diff import Status
from tests.standing import shorten_scenarios, without


def gated(root: Path) -> GateResult:
    """Gate the folder, also where nothing changed."""
    wanted = GateOptions(baseline=root / "baseline", jobs=1, every=True, diagnose=False)
    return gate([root / "ball"], wanted, lambda *_: None)


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Accept a bouncing ball in one engine."""
    root = tmp_path_factory.mktemp("accepted")
    hidden = shutil.ignore_patterns("__pycache__", "mujoco*", "robot*")
    shutil.copytree(builtin() / "events" / "bouncing_ball", root / "ball", ignore=hidden)
    without(root / "ball", "thrown")
    shorten_scenarios(root / "ball", 2)
    accept(gated(root), (), "first baseline", root / "baseline")
    return root


def edited(accepted: Path, root: Path, name: str, old: str, new: str) -> GateResult:
    """Gate a copy with an edited file."""
    shutil.copytree(accepted, root, dirs_exist_ok=True)
    text = (root / "ball" / name).read_text()
    assert text.count(old) == 1
    (root / "ball" / name).write_text(text.replace(old, new))
    return gated(root)


def test_repeated_motion_with_events_is_unchanged(accepted: Path) -> None:
    again = gated(accepted)
    assert {change.status for change in again.changes} == {Status.SAME}


def test_restitution_off_by_a_millionth_changes_the_model(accepted: Path, tmp_path: Path) -> None:
    result = edited(accepted, tmp_path, "space.py", "RESTITUTION = 0.8", "RESTITUTION = 0.8000008")
    assert {change.status for change in result.changes} == {Status.CHANGED}
    assert {kind for change in result.changes for kind in change.kinds} == {"model"}


def test_declared_restitution_changes_the_equations(accepted: Path, tmp_path: Path) -> None:
    result = edited(accepted, tmp_path, "system.py", '"e", 0.8,', '"e", 0.81,')
    assert {kind for change in result.changes for kind in change.kinds} == {"equations"}
