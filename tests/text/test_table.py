"""Output of `crosscheck run`: the header, problems, notes, and the summary line."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.render.terminal.console import STYLES, terminal, wrapped
from physics_crosscheck.harness.render.terminal.table import (
    case_line,
    print_results,
)
from physics_crosscheck.harness.results.status import duration, percent
from physics_crosscheck.records import Case, Outcome
from tests.records.made import (
    case,
    model,
    printed,
    results,
    verdict,
)


def test_record_text_is_not_parsed_as_markup_or_emoji() -> None:
    out = StringIO()
    with redirect_stdout(out):
        name = "arm:cat:[bold].urdf"
        wrong = case(Outcome.FAILED, model=name, reason=f"{name}:12: no mass")
        print_results(terminal(), results(wrong, case(model=name, scenario="[red]far[/red]")))
    assert out.getvalue().count(name) == 2


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
