"""Comparison with accepted entries: of one case, of segments, and of the committed baseline."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from physics_crosscheck.harness.baseline.classify import Change, classify
from physics_crosscheck.harness.baseline.diff import (
    ERROR_SHARE,
    diff_accepted,
    diff_cases,
    motion_of,
)
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

DIFFERS = Outcome.DIFFERS


def difference(
    move: float = 0.0, equations: float = 0.0, then: AcceptedCase = ENTRY, **now: Any
) -> Diff:
    """Compare a case whose motion moved and whose quantities changed."""
    return diff_accepted(then, entry(**now), SNAPSHOT, measurement(move, equations))


def test_repeated_case_is_unchanged() -> None:
    change = difference()
    assert (change.status, change.kinds, change.messages) == (Status.SAME, (), ())


def test_rounding_of_another_machine_is_no_change() -> None:
    assert difference(move=1e-14).status is Status.SAME


def test_moved_motion_without_a_cause_is_unexplained() -> None:
    change = difference(move=1e-9)
    assert (change.status, change.kinds) == (Status.CHANGED, ("unexplained",))
    assert change.messages == (
        "the model's motion changed by 1.0e-09 ± 8e-13 of its displacement, in x near t = 0 s",
    )


def test_change_of_isolated_states_names_the_state() -> None:
    snapshot = msgspec.structs.replace(SNAPSHOT, t=(None,) * 3)
    end = (ENDS[0], (ENDS[1][0] + 1e-9, ENDS[1][1]), ENDS[2])
    now = OnAccepted(end=end, uncertainty=UNCERTAIN, equations=ENDS)
    motion = motion_of(ENTRY, snapshot, msgspec.structs.replace(measurement(), on_accepted=now))
    assert str(motion.model).endswith("of its displacement, in x near state 2")


def test_motion_moved_with_the_engine_only_is_attributed_to_it() -> None:
    change = difference(move=1e-6, engine_version="e 99.0")
    assert (change.status, change.kinds) == (Status.CHANGED, ("engine",))
    assert change.moved == pytest.approx(1e-6, rel=1e-3)


def test_motion_moved_with_files_and_engine_lists_both() -> None:
    change = difference(move=1e-6, engine_version="e 99.0", files={"space.py": "other"})
    assert change.kinds == ("model", "engine")


def test_motion_moved_with_the_declaration_is_attributed_to_equations() -> None:
    files = FILES | {"system.py": "another"}
    assert difference(move=1e-6, files=files).kinds == ("equations",)
    assert difference(move=1e-6, resolution=1e-6).kinds == ("numbers",)


def test_moved_equations_and_model_are_both_reported() -> None:
    change = difference(move=1e-6, equations=1e-6, files=FILES | {"m.xml": "another"})
    assert change.kinds == ("model", "equations")
    assert change.messages[1:] == (
        "the equations' motion changed by 1.0e-06 ± 2e-11 of its displacement, in x near t = 1 s",
        "model and equations changed alike, and agree",
    )
    equations_only = difference(equations=1e-6)
    assert (equations_only.status, equations_only.kinds) == (Status.CHANGED, ("equations",))


def test_new_numerics_version_passes_if_nothing_moved() -> None:
    change = difference(numerics=NUMERICS + 1)
    assert (change.status, change.kinds) == (Status.WITHIN, ("tool",))
    assert difference(numerics=NUMERICS + 1, move=1e-6).kinds == ("tool",)


def test_unknown_limit_is_not_compared() -> None:
    unknown = entry(end_uncertainty=((None, None),) * 3)
    assert difference(move=1.0, then=unknown).moved == 0.0


@pytest.mark.parametrize(("share", "status"), [
    (1.0005, Status.SAME), (1.05, Status.CHANGED), (0.9, Status.IMPROVED),
])  # fmt: skip
def test_global_error_changes_beyond_one_percent_of_itself(share: float, status: Status) -> None:
    assert ERROR_SHARE == 0.01
    assert ENTRY.global_error is not None
    assert difference(global_error=share * ENTRY.global_error).status is status


def test_tolerance_of_a_large_global_error_grows_with_it() -> None:
    large = entry(global_error=0.9)
    assert difference(then=large, global_error=1.5).status is Status.SAME
    assert difference(then=large, global_error=2.0).status is Status.CHANGED
    change = difference(global_error=None)
    assert (change.status, change.messages) == (Status.CHANGED, ("the error at dt is not finite",))
    again = difference(then=entry(global_error=None))
    assert (again.status, again.messages) == (Status.IMPROVED, ("the error at dt is finite now",))


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
    was = CaseNumbers(
        outcome=DIFFERS, discrepancy=3.0e-2, uncertainty=1e-10, component="x", digits=1.5
    )
    return diff_cases(ENTRY.id, was, msgspec.structs.replace(was, **numbers)).changed


def test_discrepancy_change_below_half_a_digit_is_reported() -> None:
    assert other(discrepancy=3.2e-2, digits=1.4) == ("discrepancy",)
    assert other(discrepancy=3.0e-2 + 1.5e-10) == ()


def test_different_components_are_compared_by_digits_only() -> None:
    assert other(discrepancy=4e-2, component="y") == ()
    assert other(discrepancy=4e-1, component="y", digits=0.3) == ("digits",)


def test_step_integrator_and_orders_are_numbers() -> None:
    change = difference(time_step=0.004, integrator="RK4", claimed_order=4, order=3.9)
    assert change.kinds == ("numbers",)
    assert change.status is Status.IMPROVED
    assert change.messages == (
        "step 0.002 s -> 0.004 s",
        "integrator euler -> RK4",
        "claimed order 1 -> 4",
        "order on the segments 1 -> 3.9",
    )


def test_higher_order_with_higher_error_is_no_improvement() -> None:
    assert difference(global_error=0.05, claimed_order=4).status is Status.CHANGED
    assert difference(global_error=0.001, claimed_order=0).status is Status.IMPROVED


def test_size_of_a_known_difference_matters() -> None:
    was = entry(outcome=DIFFERS, discrepancy=1e-3)
    assert difference(then=was, outcome=DIFFERS, discrepancy=1e-3 + 1e-14).status is Status.EXPECTED
    assert difference(then=was, outcome=DIFFERS, discrepancy=1.1e-3).status is Status.CHANGED


def test_unresolved_difference_is_expected_until_it_gets_a_size() -> None:
    was = entry(outcome=Outcome.UNRESOLVED, discrepancy=None, uncertainty=None)
    same = difference(then=was, outcome=Outcome.UNRESOLVED, discrepancy=None, uncertainty=None)
    assert same.status is Status.EXPECTED
    other = difference(then=was, outcome=Outcome.UNRESOLVED, discrepancy=1e-3, uncertainty=1e-4)
    assert other.status is Status.CHANGED
    assert "from unknown ± unknown to 1.000e-03" in other.messages[0]


def test_fixed_difference_is_an_improvement() -> None:
    was = entry(outcome=DIFFERS, discrepancy=1e-3)
    change = difference(then=was, move=1e-6, files=FILES | {"m.xml": "fixed"})
    assert (change.status, change.kinds) == (Status.IMPROVED, ("model",))


def test_lost_digit_is_reported() -> None:
    change = difference(outcome=Outcome.UNRESOLVED, uncertainty=1e-6)
    assert change.status is Status.CHANGED
    assert change.messages[0] == "the verdict changed from AGREES to UNRESOLVED"


def test_outcome_that_changes_with_the_method_is_reported() -> None:
    change = difference(outcome=Outcome.UNRESOLVED, integrator="RK4")
    assert change.kinds == ("outcome", "numbers")


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


def test_moved_identified_constants_are_reported() -> None:
    now = {"k": Identified(value=47.05, standard_error=1e-6), "c": ENTRY.constants["k"]}
    assert difference(constants=now).messages == ("the motion implies k 47 -> 47.05",)


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
