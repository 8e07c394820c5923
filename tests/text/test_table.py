"""The table of results, its summary line, and what fails in words."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO

import pytest
from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.records.case import Case, TargetStep
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import Diagnosis, Explanation
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChange, BaselineChanges, Results
from physics_crosscheck.harness.text.causes import BEGIN_WITH_AUDIT
from physics_crosscheck.harness.text.table import case_line, print_results, summary
from physics_crosscheck.harness.text.terminal import terminal
from physics_crosscheck.harness.text.troubles import MOST_TOLD
from tests.records.made import case, finding, full_run, model, results, stepping, verdict


def printed(found: Results) -> str:
    out = StringIO()
    print_results(Console(file=out, width=160), found)
    return out.getvalue()


SMALL_BESIDE = verdict(
    component="x",
    discrepancy=2e-13,
    uncertainty=3e-13,
    largest_discrepancy=6e-12,
    largest_uncertainty=4e-11,
)
"""x has the largest share of its uncertainty; another component moves less, and is known worse."""


def test_the_columns_show_the_largest_of_all_components_not_of_the_one_that_decides() -> None:
    other = verdict(largest_discrepancy=1e-12, largest_uncertainty=9e-12)
    text = printed(results(case(verdict=SMALL_BESIDE), case(scenario="driven", verdict=other)))
    row = next(line for line in text.splitlines() if line.startswith("disc"))
    assert row.split()[3:7] == ["2", "AGREES", "6.0e-12", "4.0e-11"]


def test_all_that_agree_do_so_to_the_largest_of_all_components() -> None:
    found = results(case(verdict=SMALL_BESIDE), case(scenario="driven"))
    assert summary(found) == "2 cases: 2 AGREES; all that agree do so to 4.0e-11; 1.5 s"
    worse = verdict(largest_discrepancy=7e-11, largest_uncertainty=4e-11)
    assert "do so to 7.0e-11;" in summary(results(case(verdict=worse)))


def test_the_summary_counts_outcomes_and_what_is_accepted() -> None:
    found = results(
        case(),
        case(Outcome.DIFFERS, reason="off", accepted="a soft joint"),
        case(Outcome.FAILED, reason="died"),
        case(Outcome.ABSENT, reason="pymunk is not installed"),
    )
    assert summary(found) == (
        "4 cases: 1 AGREES, 1 ABSENT, 1 DIFFERS, 1 FAILED; 1 accepted as known differences;"
        " all that agree do so to 4.0e-12; 1.5 s"
    )
    assert summary(results()) == "0 cases: ; 1.5 s"
    assert summary(results(case())).startswith("1 case: 1 AGREES;")


def test_an_absent_engine_is_one_line_with_the_command_that_installs_it() -> None:
    why = "pymunk is not installed; pip install 'physics-crosscheck[engines]'"
    absent = [case(Outcome.ABSENT, engine="pymunk", scenario=s, reason=why) for s in ("a", "b")]
    text = printed(results(*absent))
    assert [line for line in text.splitlines() if "pymunk" in line] == [
        f"ABSENT 2 cases: {why}",
        f"2 cases: 2 ABSENT; {results(*absent).untested}; 1.5 s",
    ]
    assert "'physics-crosscheck[engines]'" in results(*absent).untested
    assert "discrepancy" not in text  # no table of cases that were not run


def test_nothing_that_a_record_has_is_markup_or_an_emoji() -> None:
    out = StringIO()
    with redirect_stdout(out):
        name = "arm:cat:[bold].urdf"
        wrong = case(Outcome.FAILED, model=name, reason=f"{name}:12: no mass")
        print_results(terminal(), results(wrong, case(model=name, scenario="[red]far[/red]")))
    assert out.getvalue().count(name) == 3


def test_what_is_amiss_is_told_worst_first_with_what_was_printed() -> None:
    text = printed(
        results(
            case(Outcome.DIFFERS, reason="x is off"),
            case(
                Outcome.DIFFERS,
                scenario="far",
                verdict=verdict(discrepancy=1.0),
                reason="far [b]off[/b]",
            ),
            case(Outcome.FAILED, scenario="dies", reason="it died", stdout="one\ntwo"),
            models=(
                model(finding("the mass is wrong"), finding("rounded", severity="note")),
                model(engine="pymunk", diagnosis=Diagnosis(failure="it died too")),
            ),
        )
    )
    told = [line for line in text.splitlines() if line][1:]
    order = [
        "FAILED disc/mujoco.xml/dies [mujoco]",
        "  it died",
        "  | one",
        "  | two",
        "DIFFERS disc/mujoco.xml/far [mujoco]",
        "  far [b]off[/b]",
        "  and 1 more: free [mujoco]",
        "audit of disc/mujoco.xml [mujoco]",
        "  finding  literal      the mass is wrong",
        "cause in disc/mujoco.xml [pymunk]",
        "  none found: it died too",
    ]
    assert [line for line in told if line in order] == order
    assert "rounded" not in text


def test_where_no_cause_explains_it_what_the_audit_finds_comes_first() -> None:
    """A large fault in several literals: no one or two of them explain it, reading tells all."""
    best = Cause(kind="constant", subject=("m",), nominal=1.0, estimate=7.0, standard_error=2.0)
    explanation = Explanation(causes=(best,), remaining=0.67)
    diagnosis = Diagnosis(explanations=(explanation,))
    wrong = finding("mass is 9 where m = 0.9"), finding("rounded", severity="note")
    text = printed(
        results(
            case(Outcome.DIFFERS, reason="far off"),
            models=(model(*wrong, diagnosis=diagnosis), model(diagnosis=diagnosis, engine="e2")),
        )
    )
    told = [line for line in text.splitlines() if line][4:]
    assert told[:6] == [
        "audit of disc/mujoco.xml [mujoco]",
        "  finding  literal      mass is 9 where m = 0.9",
        "cause in disc/mujoco.xml [mujoco]",
        f"  {BEGIN_WITH_AUDIT}, above",
        "cause in disc/mujoco.xml [e2]",  # reading finds nothing: the least is all there is
        "  unexplained; what leaves least is",
    ]
    explained = model(*wrong, diagnosis=replace(diagnosis, explained=True))
    told = printed(results(case(Outcome.DIFFERS), models=(explained,))).splitlines()
    assert told.index("cause in disc/mujoco.xml [mujoco]") > told.index(
        "audit of disc/mujoco.xml [mujoco]"
    ), "what explains the motions stands last, where one looks first"


def test_many_cases_and_changes_are_cut_and_counted() -> None:
    change = BaselineChange(
        system="disc", model="m", scenario="s", engine="e", kind="new", message="it is new"
    )
    text = printed(
        results(
            *(case(Outcome.DIFFERS, model=f"{i}.xml") for i in range(MOST_TOLD + 2)),
            baseline=BaselineChanges(name="reports/baseline", changes=(change,) * (MOST_TOLD + 1)),
        )
    )
    assert "and 2 more, in results.json" in text
    assert "since reports/baseline" in text
    assert text.count("  new         disc/m/s [e]: it is new") == MOST_TOLD
    assert "  and 1 more, in results.json" in text


def test_the_error_of_velocities_follows_that_of_positions() -> None:
    both = printed(results(case(full_run=full_run(velocity_error=0.0113))))
    assert " 0.50% / 1.13% " in both
    assert "global error: of positions / of velocities" in both
    before = printed(results(case()))
    assert " 0.50% " in before
    assert "of velocities" not in before


def test_a_step_that_can_not_be_told_has_a_star() -> None:
    without = full_run(steps_for=(TargetStep(target=0.001, step=None),))
    text = printed(results(case(), case(scenario="wild", full_run=without)))
    assert "0.0004 s*" in text
    assert "* one of the motions is too sensitive for a step to be told" in text


@pytest.mark.parametrize(
    ("known", "line"),
    [
        (case(), "[1/2] AGREES     disc/mujoco.xml/free [mujoco]  E 1.0e-13  U 2.0e-12"),
        (
            case(Outcome.UNRESOLVED, verdict=verdict(uncertainty=None)),
            "[1/2] UNRESOLVED disc/mujoco.xml/free [mujoco]  E 1.0e-13  U inf",
        ),
        (case(Outcome.FAILED), "[1/2] FAILED     disc/mujoco.xml/free [mujoco]"),
    ],
)
def test_a_log_has_a_line_for_each_case(known: Case, line: str) -> None:
    assert case_line(1, 2, known) == line


def test_a_next_state_that_is_not_the_rules_is_told_beside_what_agrees() -> None:
    soft = stepping(Outcome.DIFFERS, besides="equalities")
    text = printed(
        results(
            case(stepping=stepping(Outcome.AGREES, discrepancy=2e-14)),
            case(model="soft.xml", stepping=soft),
            case(Outcome.DIFFERS, model="wrong.xml", reason="off", stepping=soft),
        )
    )
    assert "in 1 case, are the equations' by the engines' own rules to 2.0e-14" in text
    assert "The next state of disc/soft.xml [mujoco] is not that of semi-implicit Euler" in text
    assert "3.0e-05 of its movement off, where 1.0e-11 is uncertain; besides act eq" in text
    assert "next state of disc/wrong.xml" not in text, "its limit says so already"
