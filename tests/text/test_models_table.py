"""The table of models in terminals of any width, without truncated text."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from physics_crosscheck.harness.records.case import TargetStep
from physics_crosscheck.harness.render.terminal.models_table import MAX_ROWS, print_models
from physics_crosscheck.records import Outcome
from tests.records.made import case, full_run, verdict

LONG = "two_drums_on_a_slope", "robot_folded_and_turned.urdf"

CHAOTIC = full_run(global_error=0.94, steps_for=(TargetStep(target=0.001, step=None),))


def table(width: int, *, details: bool = False) -> str:
    out = StringIO()
    wrong = verdict(
        discrepancy=8.5e-2, uncertainty=4.4e-12, largest_discrepancy=0.3, largest_uncertainty=0.7
    )
    cases = [
        case(),
        case(Outcome.DIFFERS, system=LONG[0], model=LONG[1], verdict=wrong),
        case(Outcome.FAILED, system=LONG[0], model=LONG[1], scenario="driven"),
    ]
    print_models(Console(file=out, width=width), cases, details=details)
    return out.getvalue()


def printed(*cases: object, details: bool = False) -> str:
    out = StringIO()
    print_models(Console(file=out, width=160), cases, details=details)  # type: ignore[arg-type]
    return out.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160, 200])
def test_names_and_numbers_are_never_truncated(width: int) -> None:
    text = table(width)
    for word in (*LONG, "1 ERROR, 1 FAIL", "11.3"):
        assert word in text
    assert "…" not in text


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
@pytest.mark.parametrize("details", [False, True])
def test_no_line_is_longer_than_the_terminal(width: int, details: bool) -> None:
    assert max(map(len, table(width, details=details).splitlines())) <= width


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
def test_omitted_column_is_named_below(width: int) -> None:
    text = table(width)
    for head in ("status", "digits", "off by", "error at dt", "dt", "order", "dt for 0.1 %"):
        assert head in text


def test_wide_names_have_separate_lines() -> None:
    assert "two_drums_on_a_slope/robot_folded_and_turned.urdf [mujoco]" in table(60).splitlines()


def test_errors_and_uncertainties_are_details() -> None:
    """Show both for the deciding component if a case differs."""
    assert "e-" not in table(200)
    lines = table(200, details=True).splitlines()
    (row,) = (line.split() for line in lines if line.startswith(LONG[0]))
    assert {"8.5e-02", "4.4e-12"} <= set(row)
    assert not {"3.0e-01", "7.0e-01"} & set(row)
    (agreeing,) = (line for line in lines if "1 ok" in line)
    assert "3.0e-13" in agreeing


def test_empty_column_is_not_printed() -> None:
    text = printed(case(full_run=None), case(engine="pymunk", full_run=None))
    assert text.splitlines()[0].split() == ["model", "engine", "status", "digits"]


def test_chaotic_motion_is_not_an_error_of_the_model() -> None:
    (row,) = (line for line in printed(case(full_run=CHAOTIC)).splitlines() if "1 ok" in line)
    assert "chaotic" in row
    assert "94 %" not in row
    both = printed(case(), case(scenario="wild", full_run=CHAOTIC))
    assert "0.50 %, chaotic" in both
    assert "400 µs" in both, "the step comes from the motions that have a step"
    assert "chaotic: a motion that no time step follows" in both


def test_agreeing_rows_are_counted_in_long_tables() -> None:
    cases = [case(model=f"m{i}.xml") for i in range(MAX_ROWS + 3)]
    text = printed(*cases, case(Outcome.DIFFERS, model="wrong.xml"))
    assert "wrong.xml" in text
    assert "m1.xml" not in text
    assert f"{MAX_ROWS + 3} more rows: every case ok" in text
    assert "m1.xml" in printed(*cases, details=True)
