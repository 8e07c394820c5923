"""Terminal output of runs and sweeps: lines, widths, progress, and tables of models."""

import io
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from physics_crosscheck.harness.extras.sweep.main import summary
from physics_crosscheck.harness.records.case import TargetStep
from physics_crosscheck.harness.records.codes import case_code
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.sweep import SweepPlan, SweepRow
from physics_crosscheck.harness.render.terminal.console import STYLES, terminal, wrapped
from physics_crosscheck.harness.render.terminal.models_table import print_models
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.render.terminal.sweep import print_sweep
from physics_crosscheck.harness.render.terminal.table import case_line, print_results
from physics_crosscheck.harness.results.status import duration, percent
from physics_crosscheck.records import Case, Outcome
from tests.records.made import case, full_run, model, printed, results, verdict


def test_record_text_is_not_parsed_as_markup_or_emoji() -> None:
    out = StringIO()
    with redirect_stdout(out):
        name = "arm:cat:[bold].urdf"
        wrong = case(Outcome.FAILED, model=name, reason=f"{name}:12: no mass")
        print_results(terminal(), results(wrong, case(model=name, scenario="[red]far[/red]")))
    assert out.getvalue().count(name) == 3


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


def logged(capsys: pytest.CaptureFixture[str], seconds: float, *, every: bool) -> list[str]:
    """Return the lines of 40 cases that take so many seconds each."""
    now = [0.0]
    with Progress(every=every, clock=lambda: now[0]) as progress:
        for i in range(1, 41):
            now[0] += seconds
            progress(i, 40, case(Outcome.DIFFERS if i == 7 else Outcome.AGREES))
    return capsys.readouterr().err.splitlines()


def test_log_has_a_line_every_few_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    assert logged(capsys, 0.01, every=False) == []
    lines = logged(capsys, 5.0 / 2, every=False)
    assert lines[0] == "running: 2 of 40 cases done (5 %)"
    assert len(lines) == 20
    assert lines[-1].startswith("diagnosing ")


def test_progress_stays_below_100_percent_until_done(capsys: pytest.CaptureFixture[str]) -> None:
    """Leave time for the diagnoses and the report after the last case."""
    assert not [line for line in logged(capsys, 5.0, every=False) if "100 %" in line]


def test_total_appears_once_all_cases_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    """Omit the total until every system's scenarios are derived."""
    now = [0.0]
    with Progress(clock=lambda: now[0]) as progress:
        for i in range(1, 41):
            now[0] += 5.0
            progress(i, 0 if i < 20 else 40, case(Outcome.AGREES))
    lines = capsys.readouterr().err.splitlines()
    assert lines[18] == "deriving and running: 19 cases done"
    assert lines[19] == "running: 20 of 40 cases done (50 %)"
    assert lines[-1] == "checking coverage"


def test_log_has_one_line_per_case_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    lines = logged(capsys, 5.0, every=True)
    assert len(lines) == 41
    assert lines[6].startswith("[7/40] FAIL ")
    assert sum("] ok " in line for line in lines) == 39


WIDTHS = (60, 80, 120)


def row(index: int, **other: Any) -> SweepRow:
    command = f"crosscheck sweep my_pendulum --vary length=0.5:2 --draws 4 --only {index}"
    values: dict[str, Any] = {
        "outcome": Outcome.DIFFERS, "kind": "motion", "reason": "theta_dot is off by 12 %",
        "discrepancy": 0.12, "uncertainty": 1e-12,
    } | other  # fmt: skip
    return SweepRow(
        index=index, draw=index, system="my_pendulum", model="mujoco.xml", engine="mujoco",
        scenario="free", integrator="euler", constants={"length": 0.5 + index}, command=command,
        **values,
    )  # fmt: skip


def printed_sweep(rows: list[SweepRow], width: int) -> str:
    plan = SweepPlan(
        command="crosscheck sweep my_pendulum", options={}, folders={}, versions={},
        cases=len(rows), constants=("length",),
    )  # fmt: skip
    console = Console(file=io.StringIO(), width=width, highlight=False)
    print_sweep(console, summary(plan, rows))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", WIDTHS)
def test_cases_with_the_same_problem_are_one_entry_with_its_code(width: int) -> None:
    text = printed_sweep([row(i, discrepancy=0.12 + i) for i in range(4)], width)
    code = case_code(Outcome.DIFFERS, "motion")
    head = "\n".join(text.splitlines()[:4])
    assert f"{code} theta_dot is off by 12 %" in head
    assert text.count("theta_dot is off") == 1
    assert "also #2, #1, #0" in text
    assert f"crosscheck explain {code}" in text
    assert max(map(len, text.splitlines())) <= width


@pytest.mark.parametrize("width", WIDTHS)
def test_agreeing_sweep_has_no_code_and_no_empty_column(width: int) -> None:
    values: dict[str, Any] = {
        "outcome": Outcome.AGREES, "kind": "", "reason": "", "discrepancy": 1e-13, "digits": 12.0
    }  # fmt: skip
    text = printed_sweep([row(i, **values) for i in range(3)], width)
    assert text.startswith("ok  3 cases agree\n")
    assert "XC" not in text
    assert "error at dt" not in text


def test_problems_with_different_codes_are_separate() -> None:
    failed: dict[str, Any] = {"outcome": Outcome.FAILED, "discrepancy": None, "uncertainty": None}
    long = row(1, kind="long step", reason="dt = 1.5 s is too long", **failed)
    text = printed_sweep([row(0), long], 80)
    assert text.index("ERROR  #1") < text.index("FAIL  #0")
    assert f"{long.code} dt = 1.5 s is too long" in text


LONG = "two_drums_on_a_slope", "robot_folded_and_turned.urdf"

CHAOTIC = full_run(global_error=0.94, steps_for=(TargetStep(target=0.001, step=None),))


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


def model_rows(*cases: object) -> str:
    out = StringIO()
    print_models(Console(file=out, width=160), cases)  # type: ignore[arg-type]
    return out.getvalue()


def test_matrix_has_the_worst_target_first() -> None:
    """Print a cell for each engine, and no row for a scene without a moving part."""
    first = verdict(discrepancy=0.31, largest_discrepancy=0.31)
    cases = [
        *(case(folder=f"s{i}") for i in range(40)),
        case(Outcome.DIFFERS, folder="wrong", engine="pymunk", verdict=first),
        case(folder="wrong"),
        case(Outcome.ABSENT, folder="prop", engine="-", kind="no joint"),
    ]
    out = StringIO()
    print_results(Console(file=out, width=80), results(*cases))
    lines = out.getvalue().splitlines()
    head, row, *others, more = lines[2 : 2 + 1 + 40 + 1]
    assert head.split() == ["mujoco", "pymunk"]
    assert row.split() == ["wrong", "11.3", "FAIL", "31", "%"]
    assert others[-1].split() == ["s38", "11.3"]
    assert more.strip() == "1 more row; --details shows every model"


@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160, 200])
def test_names_and_numbers_are_never_truncated(width: int) -> None:
    text = table(width)
    for word in (*LONG, "1 ERROR, 1 FAIL", "11.3"):
        assert word in text
    assert "…" not in text


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
def test_no_row_is_longer_than_the_terminal(width: int) -> None:
    assert max(map(len, table(width).splitlines())) <= width


@pytest.mark.parametrize("width", [60, 80, 100, 120, 160])
def test_omitted_column_is_named_below(width: int) -> None:
    text = " ".join(table(width).split())
    for head in ("status", "digits", "off by", "error at dt", "dt", "order", "dt for 0.1 %"):
        assert head in text


def test_wide_names_have_separate_lines() -> None:
    assert "two_drums_on_a_slope/robot_folded_and_turned.urdf [mujoco]" in table(60).splitlines()


def test_errors_and_uncertainties_are_details() -> None:
    """Show both for the deciding component if a case differs."""
    lines = table(200).splitlines()
    (row,) = (line.split() for line in lines if line.startswith(LONG[0]))
    assert {"8.5e-02", "4.4e-12"} <= set(row)
    assert not {"3.0e-01", "7.0e-01"} & set(row)
    (agreeing,) = (line for line in lines if "1 ok" in line)
    assert "3.0e-13" in agreeing


def test_empty_column_is_not_printed() -> None:
    text = model_rows(case(full_run=None), case(engine="pymunk", full_run=None))
    heads = ["model", "engine", "status", "digits", "error", "uncertainty"]
    assert text.splitlines()[0].split() == heads


def test_chaotic_motion_is_not_an_error_of_the_model() -> None:
    (row,) = (line for line in model_rows(case(full_run=CHAOTIC)).splitlines() if "1 ok" in line)
    assert "chaotic" in row
    assert "94 %" not in row
    both = model_rows(case(), case(scenario="wild", full_run=CHAOTIC))
    assert "0.50 %, chaotic" in both
    assert "400 µs" in both, "the step comes from the motions that have a step"
    assert "chaotic: a motion that no time step follows" in both
