"""Two runs side by side: what moved, and by how much."""

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


def moved(**fields: Any) -> Diff:
    """A case that agreed to 11.3 digits, in another run."""
    (found,) = diff_runs(results(case()), results(case(**fields))).cases
    return found


def test_the_same_run_has_not_moved() -> None:
    found = diff_runs(results(case()), results(case(folder="elsewhere/disc", seconds=9.0)))
    assert (found.changed, found.versions, found.fixed, found.broken) == ((), (), (), ())
    assert headline(found) == "1 case: nothing changed"


def test_a_verdict_that_changed_is_told_and_whether_it_is_worse() -> None:
    worse = moved(outcome=Outcome.DIFFERS, reason="x is 3e-02 off")
    assert (worse.changed, *worse.outcomes, worse.is_worse) == (
        ("verdict",), Outcome.AGREES, Outcome.DIFFERS, True,
    )  # fmt: skip
    better = diff_runs(results(case(Outcome.FAILED)), results(case())).cases[0]
    assert (better.changed[0], better.is_worse) == ("verdict", False)


def test_digits_have_moved_by_half_a_digit_and_not_by_rounding() -> None:
    less = moved(verdict=verdict(largest_uncertainty=4e-10))
    assert (less.changed, less.digits, less.is_worse) == (("digits",), (11.3, 9.3), True)
    assert moved(verdict=verdict(largest_uncertainty=8e-12)).changed == ()
    more = moved(verdict=verdict(largest_uncertainty=4e-14, largest_discrepancy=1e-15))
    assert (more.changed, more.is_worse) == (("digits",), False)


def test_of_two_that_moved_alike_the_one_that_moved_further_comes_first() -> None:
    names = ("a", "b")
    now = [
        case(scenario=name, verdict=verdict(largest_uncertainty=size))
        for name, size in zip(names, (4e-11, 4e-9), strict=True)
    ]
    found = diff_runs(results(*(case(scenario=name) for name in names)), results(*now))
    assert [one.id.scenario for one in found.cases] == ["b", "a"]


def test_a_global_error_has_moved_by_a_hundredth_of_itself() -> None:
    assert moved(full_run=full_run(global_error=0.00504)).changed == ()
    assert moved(full_run=full_run(global_error=0.0051)).changed == ("error at dt",)
    assert moved(full_run=full_run(global_error=None)).changed == ("error at dt",)
    assert moved(full_run=full_run(time_step=0.001)).changed == ("dt",)


def test_cases_that_are_new_and_gone_are_told_and_those_of_one_name_kept_apart() -> None:
    found = diff_runs(
        results(case(), case(folder="b"), case(scenario="far")), results(case(), case(engine="x"))
    )
    assert [(str(one.id), one.status) for one in found.changed] == [
        ("disc/mujoco.xml/free [mujoco]", Status.GONE),
        ("disc/mujoco.xml/far [mujoco]", Status.GONE),
        ("disc/mujoco.xml/free [x]", Status.NEW),
    ]
    assert headline(found) == "4 cases: 2 gone, 1 new"


def test_cases_that_are_gone_and_new_are_a_line_a_model() -> None:
    out = StringIO()
    gone = case(model="a.xml"), case(model="a.xml", scenario="far")
    print_two_runs(Console(file=out), diff_runs(results(*gone), results(case(engine="x"))))
    assert out.getvalue().splitlines() == [
        "FAIL  3 cases: 2 gone, 1 new",
        "gone  disc/a.xml [mujoco]: far, free",
        "new  disc/mujoco.xml [x]: free",
    ]


def test_what_was_mended_and_what_is_wrong_now_is_told_with_its_line() -> None:
    cause = Cause(
        kind="literal", subject=("body@mass",), nominal=3.3, estimate=3.6, standard_error=1e-12,
        locations=(SourceLine(file="mujoco.xml", line=21),),
    )  # fmt: skip
    told = Diagnosis(explanations=(Explanation(causes=(cause,), remaining=0.0),), explained=True)
    wrong = results(case(Outcome.DIFFERS), models=(model(diagnosis=told),), versions={"a": "1"})
    right = results(case(), models=(model(),), versions={"a": "2", "b": None})
    line = "disc/mujoco.xml:21 from 3.3 to 3.6"
    assert diff_runs(wrong, right).fixed == (line,)
    elsewhere = replace(cause, locations=(SourceLine(file="/b/disc/mujoco.xml", line=21),))
    again = replace(told, explanations=(Explanation(causes=(elsewhere,), remaining=0.0),))
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


def test_what_is_worse_comes_first_and_nothing_is_cut_in_a_narrow_terminal() -> None:
    long = "a_scenario_with_a_name_that_is_longer_than_the_terminal_is_wide"
    better, worse = case(Outcome.DIFFERS), case(scenario=long)
    found = diff_runs(
        results(better, worse),
        results(case(), replace(worse, verdict=verdict(largest_uncertainty=4e-9))),
    )
    assert [one.is_worse for one in found.cases] == [True, False]
    out = StringIO()
    print_two_runs(Console(file=out, width=60), found)
    assert long in out.getvalue()
    assert "11.3 -> 8.3" in out.getvalue()
    assert headline(found).endswith("; 1 worse")
