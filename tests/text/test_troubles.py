"""What doesn't agree: told once, with its line, and what to do."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import Diagnosis, Explanation
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.text.next_steps import next_steps
from physics_crosscheck.harness.text.table import print_results
from physics_crosscheck.harness.text.troubles import troubles
from tests.records.made import case, finding, model, results, verdict

WRONG = Cause(
    kind="literal",
    subject=("body[rod]/inertial@mass",),
    nominal=3.3,
    estimate=3.6000000000001,
    standard_error=5e-12,
    locations=(SourceLine(file="mujoco.xml", line=21),),
)


def diagnosis(cause: Cause = WRONG, *, explained: bool = True, left: float = 4e-12) -> Diagnosis:
    found = Explanation(causes=(cause,), remaining=left)
    return Diagnosis(explanations=(found,), explained=explained)


def printed(found: Results, width: int = 80) -> str:
    out = StringIO()
    print_results(Console(file=out, width=width), found)
    return out.getvalue()


def differing(*engines: str, scenarios: tuple[str, ...] = ("free", "driven")) -> tuple[Case, ...]:
    return tuple(
        case(
            Outcome.DIFFERS,
            engine=engine,
            scenario=scenario,
            reason=f"x is {i}.5e-02 off",
            verdict=verdict(discrepancy=0.01 * (i + 1)),
        )
        for engine in engines
        for i, scenario in enumerate(scenarios)
    )


def test_a_model_that_differs_is_one_trouble_whatever_the_scenario_and_engine() -> None:
    (found,) = troubles(differing("mujoco", "pybullet"))
    assert found.worst.scenario == "driven"
    assert len(found.others) == 3


def test_one_reason_in_many_cases_is_one_trouble_and_another_reason_another() -> None:
    same = [
        case(Outcome.FAILED, scenario=s, model=m, reason=f"bad at {i} s", kind="not finite")
        for i, (s, m) in enumerate((s, m) for s in ("free", "far") for m in ("a.xml", "b.xml"))
    ]
    other = case(Outcome.FAILED, reason="no memory is left")
    assert [len(one.others) for one in troubles([*same, other])] == [3, 0]


def test_reasons_that_differ_in_the_digit_of_a_name_are_two_troubles() -> None:
    meshes = [
        case(Outcome.FAILED, model=f"arm{i}.urdf", reason=f"arm{i}.stl: no file") for i in (1, 2)
    ]
    assert len(troubles(meshes)) == 2
    coarse = [
        case(Outcome.UNRESOLVED, reason=c, kind="coarse", verdict=verdict(component=c))
        for c in ("x1", "x2")
    ]
    assert len(troubles(coarse)) == 2


def test_what_agrees_or_was_accepted_is_no_trouble() -> None:
    assert troubles([case(), case(Outcome.DIFFERS, accepted="soft")]) == []


def planted() -> Results:
    """One wrong number in one file, seen in two scenarios and two engines."""
    wrong = finding(
        "body[rod]/inertial@mass is 3.3 where m = 3.6",
        location=SourceLine(file="mujoco.xml", line=21),
    )
    models: tuple[Model, ...] = tuple(
        model(wrong, engine=engine, diagnosis=diagnosis(left=left))
        for engine, left in (("mujoco", 4e-12), ("pybullet", 5e-12))
    )
    agreeing = [case(model=f"model_{i}.xml", scenario=s) for i in range(8) for s in ("a", "b")]
    return results(*differing("mujoco", "pybullet"), *agreeing, models=models)


def test_a_cause_is_told_once_for_all_engines() -> None:
    text = printed(planted())
    assert text.count("the motion wants 3.6") == 1
    assert "cause in disc/mujoco.xml [mujoco, pybullet]" in text
    assert text.count("is 3.3 where m = 3.6") == 1
    assert "and 3 more: free [mujoco]; driven, free [pybullet]" in text


@pytest.mark.parametrize("width", [80, 120, 200])
def test_the_last_screen_of_a_terminal_shows_the_line_and_the_value(width: int) -> None:
    """24 lines of so many columns, wrapped as a terminal does."""
    found = planted()
    lines = [*printed(found, width).splitlines(), *next_steps(found, Path("reports"))]
    shown = [line[i : i + width] for line in lines for i in range(0, max(len(line), 1), width)]
    screen = "\n".join(shown[-24:])
    assert "mujoco.xml:21" in screen
    assert "is 3.3, the motion wants 3.6" in screen
    assert "cases: 16 AGREES, 4 DIFFERS" in screen


def test_where_nothing_is_explained_no_change_is_told() -> None:
    vague = model(diagnosis=diagnosis(explained=False, left=0.7))
    lines = next_steps(results(*differing("mujoco"), models=(vague,)), Path("reports"))
    assert lines == ["then  crosscheck run --last-failed"]


def test_the_next_step_names_the_line_the_values_and_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "disc").mkdir(parents=True)
    (tmp_path / "models" / "disc" / "mujoco.xml").write_text("")
    lines = next_steps(planted(), Path("my out"))
    assert lines == [
        "change models/disc/mujoco.xml:21 from 3.3 to 3.6",
        "then  crosscheck run --last-failed --out 'my out'",
    ]
    assert "(models/disc/mujoco.xml:21)" in printed(planted())
    assert next_steps(results(case()), Path("reports")) == []


def test_what_was_accepted_is_not_to_be_changed() -> None:
    kept = case(Outcome.DIFFERS, accepted="soft")
    explained = model(diagnosis=diagnosis())
    assert next_steps(results(kept, models=(explained,)), Path("reports")) == []


def test_findings_that_differ_in_numbers_alone_are_told_once() -> None:
    alike = tuple(
        model(
            finding(f"A is {i}.5e-12 off", subject=("A",), expected=3.0, found=3 + i * 1e-12),
            engine=engine,
        )
        for i, engine in enumerate(("mujoco", "pybullet"))
    )
    other = model(finding("A is off", subject=("A",), expected=3.0, found=4.0), engine="drake")
    text = printed(results(case(), models=(*alike, other)))
    assert "audit of disc/mujoco.xml [mujoco, pybullet]" in text
    assert "audit of disc/mujoco.xml [drake]" in text
    assert text.count("e-12 off") == 1


def test_quiet_counts_what_agrees() -> None:
    out = StringIO()
    print_results(Console(file=out, width=100), planted(), quiet=True)
    text = out.getvalue()
    assert "uncertainty  " not in text
    assert "model_0.xml" not in text
    assert "the motion wants 3.6" in text
    assert "16 AGREES, 4 DIFFERS" in text
