"""Changes of a case between two versions: each kind is reported, and nothing else."""

from __future__ import annotations

import msgspec
import pytest

from physics_crosscheck.harness.extras.versions.main import code
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.versions import Upgrade, VersionRun, Versions
from tests.baseline.samples import case, measurement
from tests.versions.samples import between, failed, run, stepping

V1 = run("1.0")


def only_diff(upgrade: Upgrade) -> Diff:
    (diff,) = upgrade.cases
    return diff


def versions(*upgrades: Upgrade) -> Versions:
    return Versions(
        created="", engine="e", resolution=1e-9, seconds=0.0, versions=(), upgrades=upgrades
    )


def exit_code(before: VersionRun, after: VersionRun) -> int:
    return code(versions(between(before, after)))


def test_identical_results_report_no_change() -> None:
    diff = only_diff(between(V1, run("2.0")))
    assert (diff.changed, diff.messages) == ((), ())
    assert diff.outcomes == (Outcome.AGREES, Outcome.AGREES)
    assert diff.moved == 0.0
    assert exit_code(V1, run("2.0")) == 0


def test_move_within_uncertainty_is_no_change_but_is_measured() -> None:
    upgrade = between(V1, run("2.0", motion=measurement(move=4e-13)))
    assert only_diff(upgrade).changed == ()
    assert only_diff(upgrade).moved == pytest.approx(4e-13, rel=1e-3)
    assert only_diff(upgrade).uncertainty == pytest.approx(1e-12 * 2 / 1.5, rel=0.1)
    assert upgrade.same == upgrade.cases


def test_move_beyond_uncertainty_is_reported_though_both_agree() -> None:
    after = run("2.0", motion=measurement(move=1e-10))
    diff = only_diff(between(V1, after))
    assert diff.changed == ("limit",)
    assert diff.messages[0].startswith("the model's motion changed by 1.0e-10 ± ")
    assert diff.moved == pytest.approx(1e-10, rel=1e-3)
    assert exit_code(V1, after) == 1


def test_changed_verdict_comes_before_moved_limit() -> None:
    differs = case(Outcome.DIFFERS, discrepancy=1e-3, scenario="driven")
    before = run("1.0", case(), case(scenario="driven"))
    after = run("2.0", case(), differs, motion=measurement(move=1e-3))
    upgrade = between(before, after)
    assert [diff.changed for diff in upgrade.cases] == [("verdict", "limit"), ("limit",)]
    assert upgrade.cases[0].messages[0] == "the verdict changed from AGREES to DIFFERS"


def test_fixed_difference_is_a_change_and_unchanged_one_is_not() -> None:
    wrong = run("1.0", case(Outcome.DIFFERS, discrepancy=1e-3))
    still = run("2.0", case(Outcome.DIFFERS, discrepancy=1e-3))
    assert only_diff(between(wrong, still)).changed == ()
    assert exit_code(wrong, still) == 0
    fixed = run("2.0", motion=measurement(move=1e-3))
    assert only_diff(between(wrong, fixed)).changed == ("verdict", "limit")
    assert exit_code(wrong, fixed) == 1


def test_changed_equations_are_reported() -> None:
    diff = only_diff(between(V1, run("2.0", motion=measurement(move=1e-5, equations=1e-5))))
    assert diff.changed == ("limit", "equations")
    assert "model and equations changed alike, and agree" in diff.messages


def test_new_start_states_are_no_change_if_the_old_ones_are_repeated() -> None:
    motion = measurement()
    other = msgspec.structs.replace(motion.snapshot, length=(0.2, 0.2, 0.2))
    after = run("2.0", motion=msgspec.structs.replace(motion, snapshot=other))
    assert only_diff(between(V1, after)).changed == ()


def test_changed_error_at_dt_is_reported_with_both_errors() -> None:
    diff = only_diff(between(V1, run("2.0", case(global_error=0.01))))
    assert diff.changed == ("error at dt",)
    assert diff.global_errors == (0.005, 0.01)
    assert diff.messages == ("error at dt 0.5 % -> 1 %",)


def test_changed_reason_of_a_verdict_is_reported() -> None:
    before = run("1.0", case(reason="stepped by Euler", global_error=0.01))
    assert only_diff(between(before, V1)).messages[-1] == "under 1.0: stepped by Euler"


def test_changed_outcome_of_the_next_state_is_reported() -> None:
    before = run("1.0", case(stepping=stepping(Outcome.AGREES)))
    after = run("2.0", case(stepping=stepping(Outcome.DIFFERS)))
    diff = only_diff(between(before, after))
    assert diff.changed == ("next state",)
    assert diff.messages[0].endswith("AGREES -> DIFFERS")


@pytest.mark.parametrize(
    "placeholder", [{}, {"scenario": "-"}, {"scenario": "-", "model": "system.py"}]
)
def test_failure_under_one_version_is_a_change(placeholder: dict[str, str]) -> None:
    bad = failed(**placeholder)
    diff = only_diff(between(V1, run("2.0", bad)))
    assert (diff.status, diff.changed) == (Status.CHANGED, ("verdict",))
    assert (diff.scenario, diff.model) == ("free", "m.xml")
    assert diff.messages == ("under 2.0 it is FAILED: m.xml: no such joint",)
    other = only_diff(between(run("1.0", bad), run("2.0")))
    assert (other.status, other.scenario) == (Status.IMPROVED, "free")
    assert exit_code(V1, run("2.0", bad)) == 1


def test_failed_model_counts_for_each_of_its_cases() -> None:
    both = case(), case(scenario="driven")
    upgrade = between(run("1.0", *both), run("2.0", failed(scenario="-", engine="-")))
    assert sorted((diff.scenario, diff.changed, diff.engine) for diff in upgrade.cases) == [
        ("driven", ("verdict",), "e"),
        ("free", ("verdict",), "e"),
    ]


def test_failure_under_both_versions_is_not_a_pass() -> None:
    upgrade = between(run("1.0", failed()), run("2.0", failed()))
    assert only_diff(upgrade).status is Status.NOT_RUN
    assert only_diff(upgrade).messages == ("under both it is FAILED: m.xml: no such joint",)
    assert upgrade.not_compared
    assert not upgrade.changed
    assert exit_code(run("1.0", failed()), run("2.0", failed())) == 3


def test_unmeasured_motion_is_not_a_pass() -> None:
    diff = only_diff(between(V1, run("2.0", motion="it blew up")))
    assert diff.status is Status.NOT_RUN
    assert diff.messages == ("its motion under 2.0 could not be measured: it blew up",)


def test_no_cases_is_not_a_pass() -> None:
    nothing = VersionRun(version="1.0", cases=(), models=(), measured=())
    assert exit_code(nothing, nothing) == 3


def test_folders_of_the_same_name_are_kept_apart() -> None:
    here, there = case(), case(folder="elsewhere/spring")
    upgrade = between(run("1.0", here, there), run("2.0", here, there))
    assert sorted(diff.folder for diff in upgrade.cases) == ["elsewhere/spring", "models/spring"]


def test_case_of_only_one_version_is_reported() -> None:
    more: Case = case(scenario="driven")
    upgrade = between(V1, run("2.0", case(), more))
    assert [(diff.scenario, diff.status) for diff in upgrade.cases] == [
        ("driven", Status.NEW),
        ("free", Status.WITHIN),
    ]
    assert upgrade.cases[0].messages == ("under 1.0 there is no such case",)
