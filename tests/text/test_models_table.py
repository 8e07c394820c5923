"""The table of models in terminals of any width: nothing in it is cut."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.models_table import print_models
from tests.records.made import case, verdict

LONG = "two_drums_on_a_slope", "robot_folded_and_turned.urdf"


def table(width: int) -> str:
    out = StringIO()
    wrong = verdict(
        discrepancy=8.5e-2, uncertainty=4.4e-12, largest_discrepancy=0.3, largest_uncertainty=0.7
    )
    cases = [
        case(),
        case(Outcome.DIFFERS, system=LONG[0], model=LONG[1], verdict=wrong),
        case(Outcome.FAILED, system=LONG[0], model=LONG[1], scenario="driven"),
    ]
    print_models(Console(file=out, width=width), cases)
    return out.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160, 200])
def test_no_name_and_no_number_is_cut_at_any_width(width: int) -> None:
    text = table(width)
    for word in (*LONG, "1 FAILED, 1 DIFFERS", "8.5e-02", "4.4e-12", "3.0e-13", "4.0e-12"):
        assert word in text
    assert "…" not in text


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
def test_no_line_is_longer_than_the_terminal(width: int) -> None:
    assert max(map(len, table(width).splitlines())) <= width


def test_more_columns_are_shown_where_there_is_room() -> None:
    heads = {width: table(width).splitlines()[0].split() for width in (60, 100, 160)}
    assert heads[60] == ["outcome", "discrepancy", "uncertainty"]
    assert "global" in heads[100]
    assert heads[160][:3] == ["system", "model", "engine"]
    assert heads[160][-3:] == ["0.1", "%", "at"]


def test_names_have_lines_of_their_own_where_they_are_too_wide() -> None:
    assert "two_drums_on_a_slope/robot_folded_and_turned.urdf [mujoco]" in table(80).splitlines()


def test_what_differs_is_told_with_the_numbers_that_decide() -> None:
    """The largest U is of another segment, and above the largest E."""
    lines = table(160).splitlines()
    (row,) = (line.split() for line in lines if line.startswith(LONG[0]))
    assert {"8.5e-02", "4.4e-12"} <= set(row)
    assert not {"3.0e-01", "7.0e-01"} & set(row)
    (agreeing,) = (line for line in lines if "1 AGREES" in line)
    assert "3.0e-13" in agreeing
