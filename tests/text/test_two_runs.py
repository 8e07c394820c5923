"""Comparison of two runs: the changes and their size."""

from __future__ import annotations

from io import StringIO
from typing import Any

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.baseline.diff import diff_runs
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.harness.records.finding import Diagnosis, Explanation
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.two_runs import headline, print_two_runs
from tests.records.made import case, full_run, model, results, verdict


def change_of(**fields: Any) -> Diff:
    """Return the change of a case that agreed to 11.3 digits."""
    (change,) = diff_runs(results(case()), results(case(**fields))).cases
    return change


def test_same_run_has_no_changes() -> None:
    diff = diff_runs(results(case()), results(case(folder="elsewhere/disc", seconds=9.0)))
    assert (diff.changed, diff.versions, diff.fixed, diff.broken) == ((), (), (), ())
    assert headline(diff) == "1 case: nothing changed"


def test_changed_verdict_is_better_or_worse() -> None:
    worse = change_of(outcome=Outcome.DIFFERS, reason="x is 3e-02 off")
    assert (worse.changed, *worse.outcomes, worse.is_worse) == (
        ("verdict",), Outcome.AGREES, Outcome.DIFFERS, True,
    )  # fmt: skip
    better = diff_runs(results(case(Outcome.FAILED)), results(case())).cases[0]
    assert (better.changed[0], better.is_worse) == ("verdict", False)


def test_digits_change_by_half_a_digit_and_not_by_rounding() -> None:
    less = change_of(verdict=verdict(largest_uncertainty=4e-10))
    assert (less.changed, less.digits, less.is_worse) == (("digits",), (11.3, 9.3), True)
    assert change_of(verdict=verdict(largest_uncertainty=8e-12)).changed == ()
    more = change_of(verdict=verdict(largest_uncertainty=4e-14, largest_discrepancy=1e-15))
    assert (more.changed, more.is_worse) == (("digits",), False)


def test_larger_change_comes_first() -> None:
    names = ("a", "b")
    now = [
        case(scenario=name, verdict=verdict(largest_uncertainty=size))
        for name, size in zip(names, (4e-11, 4e-9), strict=True)
    ]
    diff = diff_runs(results(*(case(scenario=name) for name in names)), results(*now))
    assert [change.id.scenario for change in diff.cases] == ["b", "a"]


def test_global_error_changes_by_one_percent() -> None:
    assert change_of(full_run=full_run(global_error=0.00504)).changed == ()
    assert change_of(full_run=full_run(global_error=0.0051)).changed == ("error at dt",)
    assert change_of(full_run=full_run(global_error=None)).changed == ("error at dt",)
    assert change_of(full_run=full_run(time_step=0.001)).changed == ("dt",)


def test_new_and_gone_cases_are_listed_and_equal_names_distinguished() -> None:
    diff = diff_runs(
        results(case(), case(folder="b"), case(scenario="far")), results(case(), case(engine="x"))
    )
    assert [(str(one.id), one.status) for one in diff.changed] == [
        ("disc/mujoco.xml/free [mujoco]", Status.GONE),
        ("disc/mujoco.xml/far [mujoco]", Status.GONE),
        ("disc/mujoco.xml/free [x]", Status.NEW),
    ]
    assert headline(diff) == "4 cases: 2 gone, 1 new"


def test_gone_and_new_cases_have_one_line_per_model() -> None:
    out = StringIO()
    gone = case(model="a.xml"), case(model="a.xml", scenario="far")
    print_two_runs(Console(file=out), diff_runs(results(*gone), results(case(engine="x"))))
    assert out.getvalue().splitlines() == [
        "FAIL  3 cases: 2 gone, 1 new",
        "gone  disc/a.xml [mujoco]: far, free",
        "new  disc/mujoco.xml [x]: free",
    ]


def test_fixed_and_broken_numbers_are_listed_with_their_line() -> None:
    cause = Cause(
        kind="literal", subject=("body@mass",), nominal=3.3, estimate=3.6, standard_error=1e-12,
        locations=(SourceLine(file="mujoco.xml", line=21),),
    )  # fmt: skip
    diagnosis = Diagnosis(
        explanations=(Explanation(causes=(cause,), remaining=0.0),), explained=True
    )
    wrong = results(
        case(Outcome.DIFFERS), models=(model(diagnosis=diagnosis),), versions={"a": "1"}
    )
    right = results(case(), models=(model(),), versions={"a": "2", "b": None})
    line = "disc/mujoco.xml:21 from 3.3 to 3.6"
    assert diff_runs(wrong, right).fixed == (line,)
    elsewhere = replace(cause, locations=(SourceLine(file="/b/disc/mujoco.xml", line=21),))
    again = replace(diagnosis, explanations=(Explanation(causes=(elsewhere,), remaining=0.0),))
    other = replace(wrong, models=(model(diagnosis=again, folder="/b/disc"),))
    assert diff_runs(wrong, other).fixed == diff_runs(wrong, other).broken == ()
    assert diff_runs(right, wrong).broken == (line,)
    out = StringIO()
    print_two_runs(Console(file=out, width=80), diff_runs(wrong, right))
    text = out.getvalue()
    begin = f"FAIL  1 case: 1 with another verdict\nfixed  {line}\na 1 -> 2\n"
    assert text.startswith(begin)
    assert "DIFFERS -> AGREES" in text
    out = StringIO()
    print_two_runs(Console(file=out, width=80), diff_runs(right, wrong))
    assert out.getvalue().splitlines()[1] == f"Fix: change {line}"


def test_worse_cases_come_first_and_long_names_stay_whole() -> None:
    long = "a_scenario_with_a_name_that_is_longer_than_the_terminal_is_wide"
    better, worse = case(Outcome.DIFFERS), case(scenario=long)
    diff = diff_runs(
        results(better, worse),
        results(case(), replace(worse, verdict=verdict(largest_uncertainty=4e-9))),
    )
    assert [change.is_worse for change in diff.cases] == [True, False]
    out = StringIO()
    print_two_runs(Console(file=out, width=60), diff)
    assert long in out.getvalue()
    assert "11.3 -> 8.3" in out.getvalue()
    assert headline(diff).endswith("; 1 worse")
