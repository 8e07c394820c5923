"""Changes of a case from one version to the next: each kind is reported, and nothing else."""

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


def only(found: Upgrade) -> Diff:
    (one,) = found.cases
    return one


def versions(*upgrades: Upgrade) -> Versions:
    return Versions(
        created="", engine="e", resolution=1e-9, seconds=0.0, versions=(), upgrades=upgrades
    )


def exit_code(before: VersionRun, after: VersionRun) -> int:
    return code(versions(between(before, after)))


def test_where_nothing_moves_nothing_is_told() -> None:
    one = only(between(V1, run("2.0")))
    assert (one.changed, one.messages) == ((), ())
    assert one.outcomes == (Outcome.AGREES, Outcome.AGREES)
    assert one.moved == 0.0
    assert exit_code(V1, run("2.0")) == 0


def test_a_limit_that_moves_within_the_uncertainty_is_the_same_and_how_far_is_told() -> None:
    found = between(V1, run("2.0", does=measurement(move=4e-13)))
    assert only(found).changed == ()
    assert only(found).moved == pytest.approx(4e-13, rel=1e-3)
    assert only(found).uncertainty == pytest.approx(1e-12 * 2 / 1.5, rel=0.1)
    assert found.same == found.cases


def test_a_limit_that_moves_by_more_is_told_though_both_agree() -> None:
    after = run("2.0", does=measurement(move=1e-10))
    one = only(between(V1, after))
    assert one.changed == ("limit",)
    assert one.messages[0].startswith("the model's motion changed by 1.0e-10 ± ")
    assert one.moved == pytest.approx(1e-10, rel=1e-3)
    assert exit_code(V1, after) == 1


def test_a_verdict_that_changes_comes_before_a_limit_that_moves() -> None:
    differs = case(Outcome.DIFFERS, discrepancy=1e-3, scenario="driven")
    before = run("1.0", case(), case(scenario="driven"))
    after = run("2.0", case(), differs, does=measurement(move=1e-3))
    found = between(before, after)
    assert [one.changed for one in found.cases] == [("verdict", "limit"), ("limit",)]
    assert found.cases[0].messages[0] == "the verdict changed from AGREES to DIFFERS"


def test_a_known_difference_that_stays_is_no_change_and_one_that_is_mended_is() -> None:
    wrong = run("1.0", case(Outcome.DIFFERS, discrepancy=1e-3))
    still = run("2.0", case(Outcome.DIFFERS, discrepancy=1e-3))
    assert only(between(wrong, still)).changed == ()
    assert exit_code(wrong, still) == 0
    mended = run("2.0", does=measurement(move=1e-3))
    assert only(between(wrong, mended)).changed == ("verdict", "limit")
    assert exit_code(wrong, mended) == 1


def test_equations_of_a_file_that_is_compiled_otherwise_are_told() -> None:
    one = only(between(V1, run("2.0", does=measurement(move=1e-5, equations=1e-5))))
    assert one.changed == ("limit", "equations")
    assert "model and equations changed alike, and agree" in one.messages


def test_states_that_are_chosen_anew_are_no_change_where_the_old_ones_are_repeated() -> None:
    does = measurement()
    other = msgspec.structs.replace(does.snapshot, length=(0.2, 0.2, 0.2))
    after = run("2.0", does=msgspec.structs.replace(does, snapshot=other))
    assert only(between(V1, after)).changed == ()


def test_what_the_step_costs_is_told_with_both_errors() -> None:
    one = only(between(V1, run("2.0", case(global_error=0.01))))
    assert one.changed == ("error at dt",)
    assert one.global_errors == (0.005, 0.01)
    assert one.messages == ("error at dt 0.5 % -> 1 %",)


def test_what_each_verdict_says_for_itself_is_told_where_it_changes() -> None:
    before = run("1.0", case(reason="stepped by Euler", global_error=0.01))
    assert only(between(before, V1)).messages[-1] == "under 1.0: stepped by Euler"


def test_the_very_next_state_is_told_where_its_outcome_is_another() -> None:
    before = run("1.0", case(stepping=stepping(Outcome.AGREES)))
    after = run("2.0", case(stepping=stepping(Outcome.DIFFERS)))
    one = only(between(before, after))
    assert one.changed == ("next state",)
    assert one.messages[0].endswith("AGREES -> DIFFERS")


@pytest.mark.parametrize(
    "stand_in", [{}, {"scenario": "-"}, {"scenario": "-", "model": "system.py"}]
)
def test_what_fails_under_one_version_alone_is_a_change(stand_in: dict[str, str]) -> None:
    bad = failed(**stand_in)
    one = only(between(V1, run("2.0", bad)))
    assert (one.status, one.changed) == (Status.CHANGED, ("verdict",))
    assert (one.scenario, one.model) == ("free", "m.xml")
    assert one.messages == ("under 2.0 it is FAILED: m.xml: no such joint",)
    other = only(between(run("1.0", bad), run("2.0")))
    assert (other.status, other.scenario) == (Status.IMPROVED, "free")
    assert exit_code(V1, run("2.0", bad)) == 1


def test_a_failure_of_a_whole_model_stands_for_each_of_its_cases() -> None:
    both = case(), case(scenario="driven")
    found = between(run("1.0", *both), run("2.0", failed(scenario="-", engine="-")))
    assert sorted((one.scenario, one.changed, one.engine) for one in found.cases) == [
        ("driven", ("verdict",), "e"),
        ("free", ("verdict",), "e"),
    ]


def test_what_fails_under_both_is_no_pass() -> None:
    found = between(run("1.0", failed()), run("2.0", failed()))
    assert only(found).status is Status.NOT_RUN
    assert only(found).messages == ("under both it is FAILED: m.xml: no such joint",)
    assert found.not_compared
    assert not found.changed
    assert exit_code(run("1.0", failed()), run("2.0", failed())) == 3


def test_what_could_not_be_measured_is_no_pass() -> None:
    one = only(between(V1, run("2.0", does="it blew up")))
    assert one.status is Status.NOT_RUN
    assert one.messages == ("its motion under 2.0 could not be measured: it blew up",)


def test_where_there_is_no_case_nothing_passes() -> None:
    nothing = VersionRun(version="1.0", cases=(), models=(), measured=())
    assert exit_code(nothing, nothing) == 3


def test_two_folders_of_one_name_are_two() -> None:
    here, there = case(), case(folder="elsewhere/spring")
    found = between(run("1.0", here, there), run("2.0", here, there))
    assert sorted(one.folder for one in found.cases) == ["elsewhere/spring", "models/spring"]


def test_a_case_that_is_there_under_one_version_alone_is_told() -> None:
    more: Case = case(scenario="driven")
    found = between(V1, run("2.0", case(), more))
    assert [(one.scenario, one.status) for one in found.cases] == [
        ("driven", Status.NEW),
        ("free", Status.WITHIN),
    ]
    assert found.cases[0].messages == ("under 1.0 there is no such case",)
