"""A sweep in the terminal: one entry per problem, with its code, at every width."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from physics_crosscheck.harness.extras.sweep.main import summary
from physics_crosscheck.harness.records.codes import case_code
from physics_crosscheck.harness.records.sweep import SweepPlan, SweepRow
from physics_crosscheck.harness.render.terminal.sweep import print_sweep
from physics_crosscheck.records import Outcome

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


def printed(rows: list[SweepRow], width: int) -> str:
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
    text = printed([row(i, discrepancy=0.12 + i) for i in range(4)], width)
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
    text = printed([row(i, **values) for i in range(3)], width)
    assert text.startswith("ok  3 cases agree\n")
    assert "XC" not in text
    assert "error at dt" not in text


def test_problems_with_different_codes_are_separate() -> None:
    failed: dict[str, Any] = {"outcome": Outcome.FAILED, "discrepancy": None, "uncertainty": None}
    long = row(1, kind="long step", reason="dt = 1.5 s is too long", **failed)
    text = printed([row(0), long], 80)
    assert text.index("ERROR  #1") < text.index("FAIL  #0")
    assert f"{long.code} dt = 1.5 s is too long" in text
