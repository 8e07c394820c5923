"""Comparison with accepted entries: of one case, of segments, and of the committed baseline."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from physics_crosscheck.harness.baseline.classify import Change, classify
from physics_crosscheck.harness.baseline.diff import diff_accepted, diff_cases, motion_of
from physics_crosscheck.harness.baseline.file import SystemBaseline, snapshot_key
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles, ModelFiles, folder_files
from physics_crosscheck.harness.baseline.measure import (
    comparable,
    is_accepted,
    same_motion,
    segments_of,
    snapshot_of,
)
from physics_crosscheck.harness.baseline.stale import location
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.records.baseline import (
    AcceptedCase,
    Identified,
    Measurement,
    OnAccepted,
    Snapshot,
)
from physics_crosscheck.harness.records.diff import CaseNumbers, Changed, Diff, Status
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Case, CaseId, Outcome
from tests.baseline.samples import (
    ENDS,
    ENTRY,
    FILES,
    NUMERICS,
    SNAPSHOT,
    SYSTEM,
    UNCERTAIN,
    baseline,
    case,
    entry,
    measurement,
)
from tests.physics import physics
from tests.recorded import recorded

DIFFERS = Outcome.DIFFERS


def difference(
    move: float = 0.0, equations: float = 0.0, then: AcceptedCase = ENTRY, **now: Any
) -> Diff:
    """Compare a case whose motion moved and whose quantities changed."""
    return diff_accepted(then, entry(**now), SNAPSHOT, measurement(move, equations))


DIFFERING = entry(outcome=DIFFERS, discrepancy=1e-3)
OPEN = entry(outcome=Outcome.UNRESOLVED, discrepancy=None, uncertainty=None)
LARGE = entry(global_error=0.9)
NEWER = {"engine_version": "e 99.0"}
HIGHER = {"time_step": 0.004, "integrator": "RK4", "claimed_order": 4, "order": 3.9}
MOVED = {"k": Identified(value=47.05, standard_error=1e-6), "c": ENTRY.constants["k"]}
CHANGES: dict[str, dict[str, Any]] = {
    "repeated": {},
    "rounding of another machine": {"move": 1e-14},
    "a motion without a cause": {"move": 1e-9},
    "a motion with the engine": {"move": 1e-6, **NEWER},
    "a motion with files and engine": {"move": 1e-6, **NEWER, "files": {"space.py": "other"}},
    "a motion with the declaration": {"move": 1e-6, "files": FILES | {"system.py": "another"}},
    "a motion with the resolution": {"move": 1e-6, "resolution": 1e-6},
    "model and equations": {"move": 1e-6, "equations": 1e-6, "files": FILES | {"m.xml": "another"}},
    "equations only": {"equations": 1e-6},
    "new numerics": {"numerics": NUMERICS + 1},
    "a motion with new numerics": {"numerics": NUMERICS + 1, "move": 1e-6},
    "a limit that was unknown": {"move": 1.0, "then": entry(end_uncertainty=((None, None),) * 3)},
    "less than 1 % of the error": {"global_error": 1.0005 * 0.005},
    "more than 1 % of the error": {"global_error": 1.05 * 0.005},
    "a smaller error": {"global_error": 0.9 * 0.005},
    "less than a large error": {"then": LARGE, "global_error": 1.5},
    "more than a large error": {"then": LARGE, "global_error": 2.0},
    "an error that is not finite": {"global_error": None},
    "an error that is finite again": {"then": entry(global_error=None)},
    "step, integrator and orders": HIGHER,
    "a higher order with a higher error": {"global_error": 0.05, "claimed_order": 4},
    "a lower order with a lower error": {"global_error": 0.001, "claimed_order": 0},
    "a known difference": {"then": DIFFERING, "outcome": DIFFERS, "discrepancy": 1e-3 + 1e-14},
    "a known difference that grew": {"then": DIFFERING, "outcome": DIFFERS, "discrepancy": 1.1e-3},
    "a known difference that is fixed": {
        "then": DIFFERING, "move": 1e-6, "files": FILES | {"m.xml": "fixed"},
    },
    "unresolved as before": {
        "then": OPEN, "outcome": Outcome.UNRESOLVED, "discrepancy": None, "uncertainty": None,
    },
    "unresolved with a size": {
        "then": OPEN, "outcome": Outcome.UNRESOLVED, "discrepancy": 1e-3, "uncertainty": 1e-4,
    },
    "a lost digit": {"outcome": Outcome.UNRESOLVED, "uncertainty": 1e-6},
    "an outcome with the method": {"outcome": Outcome.UNRESOLVED, "integrator": "RK4"},
    "identified constants": {"constants": MOVED},
}  # fmt: skip


def test_changes_have_the_recorded_status_kinds_and_messages() -> None:
    text = ""
    for name, fields in CHANGES.items():
        change = difference(**fields)
        head = f"# {name}: {change.status}" + (f" ({', '.join(change.kinds)})" * bool(change.kinds))
        text += "\n".join([head, *change.messages, ""])
    assert text == recorded("accepted_changes", text)


def test_change_of_isolated_states_names_the_state() -> None:
    snapshot = msgspec.structs.replace(SNAPSHOT, t=(None,) * 3)
    end = (ENDS[0], (ENDS[1][0] + 1e-9, ENDS[1][1]), ENDS[2])
    now = OnAccepted(end=end, uncertainty=UNCERTAIN, equations=ENDS)
    motion = motion_of(ENTRY, snapshot, msgspec.structs.replace(measurement(), on_accepted=now))
    assert str(motion.model).endswith("of its displacement, in x near state 2")


ERRORS: list[tuple[str, float | None, float | None, tuple[Changed, ...]]] = [
    ("relative to the accepted one, this fall would be covered", 0.9, 0.4, ("error at dt",)),
    ("to the error's own share, this rise would be covered", 0.05, 0.052, ("error at dt",)),
    ("without a share of an earlier one, this rise would be lost", 0.0, 0.02, ("error at dt",)),
    ("a run that lost its end would be lost", 0.02, None, ("error at dt",)),
    ("to a flat 1 %, the rounding of a chaotic motion would count", 1.31, 1.42, ()),
    ("less than 1 % of a usual error", 0.05, 0.0504, ()),
]


@pytest.mark.parametrize(("fault", "then", "now", "changed"), ERRORS)
@pytest.mark.parametrize("is_measured", [True, False])
def test_every_comparison_uses_the_same_rule_for_errors(
    fault: str,
    then: float | None,
    now: float | None,
    changed: tuple[Changed, ...],
    is_measured: bool,
) -> None:
    was = entry(global_error=then)
    if is_measured:
        forward = difference(then=was, global_error=now)
        back = difference(then=entry(global_error=now), global_error=then)
    else:
        numbers = was.numbers, entry(global_error=now).numbers
        forward = diff_cases(was.id, *numbers)
        back = diff_cases(was.id, *reversed(numbers))
    assert forward.changed == back.changed == changed, fault


def other(**numbers: Any) -> tuple[Changed, ...]:
    """Return what changed between two results without measured motions."""
    was = CaseNumbers(outcome=DIFFERS, discrepancy=3.0e-2, uncertainty=1e-10, component="x")
    return diff_cases(ENTRY.id, was, msgspec.structs.replace(was, **numbers)).changed


def test_discrepancy_change_below_half_a_digit_is_reported() -> None:
    assert other(discrepancy=3.2e-2) == ("discrepancy",)
    assert other(discrepancy=3.0e-2 + 1.5e-10) == ()


def test_discrepancies_of_different_components_are_not_compared() -> None:
    assert other(discrepancy=4e-1, component="y") == ()


def test_changed_scenario_is_reported_as_such() -> None:
    measured = measurement()
    other = msgspec.structs.replace(SNAPSHOT, duration=5.0, inputs=("f = 1",))
    change = diff_accepted(
        ENTRY, ENTRY, SNAPSHOT, msgspec.structs.replace(measured, snapshot=other)
    )
    assert (change.status, change.kinds) == (Status.CHANGED, ("scenario",))
    assert change.messages == ("the scenario changed: duration 4 s -> 5 s; input f = 0 -> f = 1",)


def test_changed_coordinates_cannot_be_compared() -> None:
    measured = msgspec.structs.replace(measurement(), on_accepted=None)
    change = diff_accepted(ENTRY, ENTRY, SNAPSHOT, measured)
    assert (change.status, change.kinds) == (Status.CHANGED, ("equations",))
    assert change.moved is None


def classified(
    measured: Measurement | Failure | None,
    this: Case | None = None,
    accepted: SystemBaseline | None = None,
    stale: bool = False,
) -> Change:
    folder = Path("models/spring")
    scan = FolderFiles(folder, "0", (ModelFiles(folder, "m.xml", ("e",), FILES, ()),), ())
    return classify(SYSTEM, this or case(), measured, scan, accepted, {"e": "1.0"}, 1e-9, stale)


def test_incomparable_cases_count_as_not_run() -> None:
    whole = baseline()
    for change, message in (
        (classified(None, case(Outcome.FAILED, reason="no XML"), whole), "FAILED: no XML"),
        (classified(None, case(Outcome.ABSENT, reason="no e"), whole), "ABSENT: no e"),
        (classified(measurement(), accepted=whole, stale=True), "its files changed during the run"),
        (classified(Failure("it blew up", ""), accepted=whole), "not be measured: it blew up"),
        (classified(None, accepted=whole), "its motion could not be measured"),
    ):
        assert change.status is Status.NOT_RUN
        assert message in change.messages[0]
        assert change.now is None


def test_case_missing_from_the_baseline_is_new() -> None:
    change = classified(measurement())
    assert change.status is Status.NEW
    assert change.messages == ("AGREES, not in the baseline yet",)
    assert change.now is not None
    assert change.now.engine_version == "e 1.0"
    assert change.now.summary == ENTRY.summary
    assert change.now.id == ENTRY.id


def test_numerics_version_comes_from_the_fingerprint_module(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", NUMERICS)
    assert classified(measurement(), accepted=baseline()).status is Status.SAME
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", NUMERICS + 1)
    assert classified(measurement(), accepted=baseline()).kinds == ("tool",)


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


ROOT = Path(__file__).parents[2]


def test_committed_baseline_matches_the_models() -> None:
    place = ROOT / "reports" / "baseline"
    baseline = read_baseline(place)
    folders = system_folders([])
    assert set(baseline) == {folder.name for folder in folders}
    for folder in folders:
        accepted, scan = baseline[folder.name], folder_files(folder)
        assert accepted.declared.folder == location(folder, place)
        assert accepted.declared.declared == scan.system
        wanted = {
            CaseId(system=folder.name, model=model.model, scenario=scenario, engine=engine): (
                model.hashes
            )
            for model in scan.models
            for engine in model.engines
            for scenario in accepted.declared.scenarios
        }
        present = {
            case: entry.files
            for case, entry in accepted.cases.items()
            if engines()[case.engine].version() is not None  # only installed extras
        }
        assert present == wanted
        assert {entry.outcome for entry in accepted.cases.values()} == {"AGREES"}
