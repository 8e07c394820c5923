"""Output of `crosscheck run`: the header, problems, notes, and the summary line."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.interfaces.pytest_plugin.collect import properties
from physics_crosscheck.harness.records.case import EventTime, SkippedCheck, WholeStep
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.results import BaselineChanges
from physics_crosscheck.harness.render.html.cases import CaseView
from physics_crosscheck.harness.render.terminal.console import STYLES, terminal, wrapped
from physics_crosscheck.harness.render.terminal.problems import MAX_PROBLEMS
from physics_crosscheck.harness.render.terminal.table import (
    MAX_CASES,
    case_line,
    deciding_lines,
    event_lines,
    print_results,
    summary,
    whole_step_lines,
)
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT
from physics_crosscheck.harness.results.status import duration, percent
from physics_crosscheck.records import Case, CaseId, Outcome
from tests.records.made import (
    case,
    cause,
    diagnosis,
    finding,
    full_run,
    model,
    printed,
    results,
    stepping,
    verdict,
)

SMALL_BESIDE = verdict(
    component="x",
    discrepancy=2e-13,
    uncertainty=3e-13,
    largest_discrepancy=6e-12,
    largest_uncertainty=4e-11,
)
"""x has the largest share of its uncertainty; another component has a larger uncertainty."""


def test_digits_are_the_fewest_of_all_components() -> None:
    run = results(case(verdict=SMALL_BESIDE), case(scenario="driven"))
    assert summary(run) == "Both cases agree to 10.3 digits (1.5 s)"
    assert "mujoco  2 cases   10.3 digits" in printed(run)
    worse = verdict(largest_discrepancy=7e-11, largest_uncertainty=4e-11)
    assert "to 10.1 digits" in summary(results(case(verdict=worse)))


def test_summary_counts_outcomes_and_accepted_cases() -> None:
    run = results(
        case(),
        case(Outcome.DIFFERS, reason="off", accepted="a soft joint"),
        case(Outcome.FAILED, reason="died"),
        case(Outcome.ABSENT, reason="pymunk is not installed"),
    )
    assert summary(run) == (
        "1 of 3 cases failed, 1 agrees to 11.3 digits, 1 skipped, 1 difference accepted (1.5 s)"
    )
    within = results(
        case(), case(Outcome.DIFFERS, engine="pybullet", accepted="within its own 3e-8")
    )
    assert summary(within) == "1 of 2 cases agrees to 11.3 digits, 1 difference accepted (1.5 s)"
    assert "ok    pybullet  within its own 3e-8" in printed(within)
    assert summary(results()) == "No case was run (1.5 s)"
    assert summary(results(case())) == "1 case agrees to 11.3 digits (1.5 s)"


def test_summary_names_faults_without_effect_on_motions() -> None:
    run = results(case(), case(engine="pymunk"), models=(model(finding("mass is 9")),))
    assert summary(run) == (
        "Both cases agree to 11.3 digits, the audit finds faults in 1 model file (1.5 s)"
    )


def test_missing_engine_is_one_line_with_install_command() -> None:
    why = "pymunk is not installed; pip install 'physics-crosscheck[engines]'"
    absent = [case(Outcome.ABSENT, engine="pymunk", scenario=s, reason=why) for s in ("a", "b")]
    text = printed(results(*absent))
    assert [line for line in text.splitlines() if "pymunk" in line] == [
        f"  skipped 2 cases  XC606 {why}",
    ]
    assert "Nothing was tested, 2 skipped" in text
    assert "digits" not in text  # no table of cases that were not run
    assert "crosscheck explain" not in text


def test_record_text_is_not_parsed_as_markup_or_emoji() -> None:
    out = StringIO()
    with redirect_stdout(out):
        name = "arm:cat:[bold].urdf"
        wrong = case(Outcome.FAILED, model=name, reason=f"{name}:12: no mass")
        print_results(terminal(), results(wrong, case(model=name, scenario="[red]far[/red]")))
    assert out.getvalue().count(name) == 2


def test_problems_come_worst_first_with_engine_output() -> None:
    text = printed(
        results(
            case(Outcome.DIFFERS, reason="x is off"),
            case(Outcome.DIFFERS, scenario="far", verdict=verdict(discrepancy=1.0)),
            case(Outcome.FAILED, scenario="dies", reason="it [b]died[/b]", stdout="one\ntwo"),
            models=(
                model(finding("the mass is wrong"), finding("rounded", severity="note")),
                model(engine="pymunk", linearization_failure="it died too"),
            ),
        )
    )
    order = [
        "  ERROR disc/mujoco.xml/dies [mujoco]  XC612 it [b]died[/b]",
        "        | one",
        "        | two",
        "  ERROR disc/mujoco.xml [pymunk]  XC613 the linearization failed: it died too",
        "  FAIL  disc/mujoco.xml [mujoco]  XC301 x off by up to 100 % (far); 2 of 3 cases differ",
        "  FAIL  disc/mujoco.xml [mujoco]  the audit finds 1 fault in the file",
        "        found: XC101 the mass is wrong",
    ]
    assert [line for line in text.splitlines() if line in order] == order
    assert "rounded" not in text


def test_audit_findings_replace_a_missing_cause() -> None:
    """List all wrong literals of the audit if at most two cannot explain a large fault."""
    best = cause("m", kind="constant", estimate=7.0, standard_error=2.0)
    vague = diagnosis(best, remaining=0.07, explained=False)
    wrong = finding("mass is 9 where m = 0.9"), finding("rounded", severity="note")
    differs = case(Outcome.DIFFERS, verdict=verdict(discrepancy=1.0))
    run = results(differs, models=(model(*wrong, diagnosis=vague),))
    text = printed(run)
    assert text.count("mass is 9 where m = 0.9") == 1
    assert "closest" not in text
    assert BEGIN_WITH_AUDIT in printed(run, details=True)
    bare = printed(results(differs, models=(model(diagnosis=vague),)))
    assert "cause: none found; closest: m is 7 ± 2 in the model, but 1 in the equations" in bare
    far = replace(diagnosis(best, remaining=0.2, explained=False), failure="it died")
    bare = printed(results(differs, models=(model(diagnosis=far),)))
    assert "cause: none found: it died" in bare
    assert "ERROR" not in bare


def test_many_problems_and_changes_are_counted() -> None:
    id_ = CaseId(system="disc", model="m", scenario="s", engine="e")
    change = bare_diff(id_, Status.GONE, ("it is gone",))
    changed = tuple(replace(change, scenario=f"s{i}") for i in range(MAX_PROBLEMS + 1))
    new = replace(change, status=Status.NEW)  # never accepted, so not a change
    text = printed(
        results(
            *(case(Outcome.DIFFERS, model=f"{i}.xml") for i in range(MAX_PROBLEMS + 2)),
            baseline=BaselineChanges(name="reports/baseline", changes=(new, *changed)),
        )
    )
    assert "2 more problems: see the report" in text
    assert "changes since reports/baseline" in text
    assert text.count("  gone  XC502 disc/m  s0 [e], s1 [e], ") == 1
    more = MAX_PROBLEMS + 1 - MAX_CASES
    assert f"s{MAX_CASES - 1} [e] and {more} more: it is gone" in " ".join(text.split())


@pytest.mark.parametrize(
    ("finished", "line"),
    [
        (case(), "[1/2] ok         disc/mujoco.xml/free [mujoco]  11.3 digits"),
        (
            case(Outcome.DIFFERS, verdict=verdict(discrepancy=0.038)),
            "[1/2] FAIL       disc/mujoco.xml/free [mujoco]  off by 3.8 %",
        ),
        (case(Outcome.FAILED), "[1/2] ERROR      disc/mujoco.xml/free [mujoco]"),
    ],
)
def test_log_has_a_line_for_each_case(finished: Case, line: str) -> None:
    assert case_line(1, 2, finished) == line


def test_single_steps_and_coverage_are_details() -> None:
    soft = stepping(Outcome.DIFFERS, besides="equalities")
    run = results(
        case(stepping=stepping(Outcome.AGREES, discrepancy=2e-14)),
        case(model="soft.xml", stepping=soft),
        case(Outcome.DIFFERS, model="wrong.xml", reason="off", stepping=soft),
        models=(model(coverage=Coverage(numbers=31, motion=23)),),
    )
    text = printed(run, details=True)
    assert "single step of 1 case follows the engine's own rule to 2.0e-14" in text
    assert "single step of disc/soft.xml [mujoco] deviates from semi-implicit Euler" in text
    assert "single step of disc/wrong.xml" not in text, "its limit shows the same difference"
    assert "23 of 31 numbers tested (23 by motion)" in text
    short = printed(run)
    assert "single step" not in short
    assert "23 of 31 numbers tested (74 %); --details lists the rest" in short


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("details", [False, True])
def test_no_line_is_longer_than_the_terminal(width: int, details: bool) -> None:
    """Keep words whole that are longer than a line, such as paths."""
    wrong = case(Outcome.FAILED, reason="arm.urdf:12: " + "the joint has no axis and " * 9)
    run = results(case(), wrong, models=(model(coverage=Coverage(numbers=31, motion=23)),))
    out = StringIO()
    report = Path("a/rather/long/path/of/a/report/that/stays/whole/in/one/line/index.html")
    print_results(Console(file=out, width=width), run, details=details, report=report)
    lines = out.getvalue().splitlines()
    assert lines[-1] == "Explain a code: crosscheck explain XC612"
    assert lines[-2] == f"Report: {report}" or width == 120
    assert max(len(line) for line in lines if "Report" not in line) <= width


@pytest.mark.parametrize("models", [1, 3, 27])
def test_passing_run_has_at_most_twelve_lines(models: int) -> None:
    cases = [
        case(folder=f"models/{i % 6}", model=f"{i}.xml", scenario=s, engine=e)
        for i in range(models)
        for e in ("mujoco", "pybullet", "pymunk", "drake")
        for s in ("free", "driven")
    ]
    text = printed(results(*cases), report=Path("reports/index.html"))
    assert len(text.splitlines()) <= 12
    assert text.splitlines()[-1].startswith(f"All {8 * models} cases agree to 11.3 digits (1.5 s)")


@pytest.mark.parametrize(
    ("share", "text"),
    [(2.12, "210 %"), (0.94, "94 %"), (0.0384, "3.8 %"), (0.00497, "0.50 %"), (8.5e-7, "8.5e-07"),
     (0.9999, "100 %"), (0.0, "0 %"), (12.34, "1200 %")],
)  # fmt: skip
def test_shares_are_percentages_of_two_digits(share: float, text: str) -> None:
    assert percent(share) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.002, "2 ms"), (0.00018, "180 µs"), (7.6e-5, "76 µs"), (0.01, "10 ms"), (1.5, "1.5 s"),
     (0.0041666, "4.2 ms")],
)  # fmt: skip
def test_times_have_units_not_powers_of_ten(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_no_percentage_is_divided() -> None:
    for width in range(20, 60):
        lines = wrapped("the motion changed by 0.72 % of its displacement", width)
        assert not any(line.strip().startswith("%") for line in lines)
        assert " ".join(line.strip() for line in lines) == (
            "the motion changed by 0.72 % of its displacement"
        )


def test_colours_are_readable_on_light_and_dark_backgrounds() -> None:
    """Avoid yellow, cyan and white (invisible on white) and blue (on black)."""
    readable = {"green", "red", "magenta", "bold", "dim", "reverse"}
    assert {word for style in STYLES.values() for word in style.split()} <= readable


def test_deciding_checks_are_counted_with_largest_numbers() -> None:
    steps = verdict(decided_by="single steps", largest_discrepancy=2e-14, largest_uncertainty=3e-13)
    skipped = SkippedCheck(check="segments", reason="r")
    cases = [case(verdict=steps, skipped=(skipped,)), case(verdict=verdict())]
    assert deciding_lines(cases) == [
        "single steps decide 1 case: largest difference 2.0e-14, largest uncertainty 3.0e-13",
        "segments decide 1 case: largest difference 3.0e-13, largest uncertainty 4.0e-12",
        "skipped checks are not passed; --thorough runs all of them",
    ]
    assert len(deciding_lines(cases[1:])) == 1
    assert deciding_lines([case(Outcome.ABSENT)]) == []


def test_whole_steps_without_a_verdict_take_one_line_without_details() -> None:
    """Catch a long reason of an engine for each case in the default output."""
    reason = "arm.urdf: PyBullet can't load it: Could not parse collision element"
    cases = [
        case(engine=engine, whole_step=WholeStep(uncovered=(reason,)))
        for engine in ("mujoco", "pybullet")
    ]
    short = whole_step_lines(cases, details=False)
    assert short == [
        "whole steps without a verdict in mujoco, pybullet; --details gives the reason"
    ]
    assert [line.endswith(reason) for line in whole_step_lines(cases, details=True)] == [True, True]


def test_whole_steps_that_differ_or_are_unresolved_are_listed() -> None:
    """Catch a step that is off by 110 % behind a motion, or behind the steps of other engines."""
    numbers: dict[str, Any] = {"component": "knee_ddot", "uncertainty": 2e-9, "states": 19}
    step = WholeStep(outcome=Outcome.UNRESOLVED, discrepancy=1e-9, **numbers)
    wrong = WholeStep(outcome=Outcome.DIFFERS, discrepancy=1.1, **numbers)
    good = WholeStep(
        outcome=Outcome.AGREES, discrepancy=3e-12, next_state=True, **{**numbers, "unresolved": 5}
    )
    cases = [
        case(engine="drake", whole_step=good),
        case(engine="dart", whole_step=step),
        case(Outcome.DIFFERS, engine="pybullet", whole_step=wrong),
    ]
    assert whole_step_lines(cases, details=False) == [
        "whole steps at 19 states, where no limit, contact or drive acts, agree to 3.0e-12; 5 more"
        " unresolved",
        "disc/mujoco.xml/free [dart]: whole steps unresolved at 19 states: uncertainty 2.0e-09 of"
        " knee_ddot",
        "disc/mujoco.xml/free [pybullet]: whole steps differ at 19 states: knee_ddot off by 110 %"
        " of its largest value, uncertainty 2.0e-09",
    ]
    assert properties(cases[2])["whole steps"].startswith("differ at 19 states")
    page = CaseView(id="id", case=cases[1], pack="", scene=None, scenario=None, model=None)
    assert "whole steps are unresolved at 19 states" in str(page.reason)
    repeated = replace(
        cases[0], whole_step=replace(good, contact_counts=("a and b have 4 contacts",))
    )
    assert "whole steps in drake: a and b have 4 contacts" in whole_step_lines(
        [repeated], details=False
    )


def test_worst_event_is_named_and_short_events_are_counted() -> None:
    events = (
        EventTime(part="floor", change="impact", time=0.3, in_run=0.301),
        EventTime(part="stop", change="impact", time=0.7, in_run=0.696),
        EventTime(part="stop", change="free to closed", time=0.9),
    )
    cases = [case(full_run=full_run(events=events)), case(scenario="smooth")]
    name = "disc/mujoco.xml/free [mujoco]"
    assert event_lines(cases) == [
        f"2 events of full runs at most 4 ms off (worst: stop, {name}); 1 not seen at dt"
    ]
    (detailed,) = event_lines(cases, details=True)
    assert detailed.startswith(f"{name}: floor, impact at 0.3 s: 1 ms off; stop, impact")
    assert detailed.endswith("not seen")
