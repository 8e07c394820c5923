"""Problems in the output: reported once, with the line and the remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.render.html.diagnoses import sentence
from physics_crosscheck.harness.results.issues import collect_issues
from physics_crosscheck.records import (
    Case,
    CauseId,
    Diagnosis,
    Explanation,
    Model,
    Outcome,
    Results,
    SourceLine,
)
from tests.records.made import (
    case,
    cause,
    diagnosis,
    finding,
    model,
    printed,
    results,
    verdict,
)

WRONG = cause(
    "body[rod]/inertial@mass", nominal=3.3, estimate=3.6000000000001, standard_error=5e-12,
    locations=(SourceLine(file="mujoco.xml", line=21),),
)  # fmt: skip


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


def test_differing_model_is_one_issue_for_all_scenarios_and_engines() -> None:
    (issue,) = collect_issues(differing("mujoco", "pybullet"))
    assert issue.worst.scenario == "driven"
    assert len(issue.others) == 3


def test_cases_with_the_same_reason_are_one_issue() -> None:
    same = [
        case(Outcome.FAILED, scenario=s, model=m, reason=f"bad at {i} s", kind="not finite")
        for i, (s, m) in enumerate((s, m) for s in ("free", "far") for m in ("a.xml", "b.xml"))
    ]
    other = case(Outcome.FAILED, reason="no memory is left")
    assert [len(one.others) for one in collect_issues([*same, other])] == [3, 0]


def test_reasons_with_different_names_are_two_issues() -> None:
    meshes = [
        case(Outcome.FAILED, model=f"arm{i}.urdf", reason=f"arm{i}.stl: no file") for i in (1, 2)
    ]
    assert len(collect_issues(meshes)) == 2
    coarse = [
        case(Outcome.UNRESOLVED, reason=c, kind="coarse", verdict=verdict(component=c))
        for c in ("x1", "x2")
    ]
    assert len(collect_issues(coarse)) == 2


def test_agreeing_or_accepted_case_is_not_an_issue() -> None:
    assert collect_issues([case(), case(Outcome.DIFFERS, accepted="soft")]) == []


def planted() -> Results:
    """Return results with one wrong number that two scenarios and two engines show."""
    wrong = finding(
        "body[rod]/inertial@mass is 3.3 where m = 3.6",
        location=SourceLine(file="mujoco.xml", line=21),
    )
    models: tuple[Model, ...] = tuple(
        model(wrong, engine=engine, diagnosis=diagnosis(WRONG, remaining=remaining))
        for engine, remaining in (("mujoco", 4e-12), ("pybullet", 5e-12))
    )
    agreeing = [case(model=f"model_{i}.xml", scenario=s) for i in range(8) for s in ("a", "b")]
    return results(*differing("mujoco", "pybullet"), *agreeing, models=models)


def test_cause_is_reported_once_and_replaces_the_finding() -> None:
    text = printed(planted(), 120)
    assert text.count("the motion implies 3.6") == 1
    assert "FAIL  disc/mujoco.xml [mujoco, pybullet]" in text
    assert "where m = 3.6" not in text, "the audit found the same number"
    assert "x off by up to 2.0 % (driven); 4 of 4 cases differ" in text
    details = printed(planted(), 120, details=True)
    assert "residual 4.0e-12 of the discrepancy" in details
    assert "disc/mujoco.xml/free [pybullet]" in details


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_first_lines_show_the_line_and_the_value(
    width: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "disc").mkdir(parents=True)
    (tmp_path / "models" / "disc" / "mujoco.xml").write_text("")
    lines = printed(planted(), width).splitlines()
    top = " ".join(" ".join(lines[:8]).split())
    assert "body[rod]/inertial@mass is 3.3; the motion implies 3.6" in top
    assert "fix: change models/disc/mujoco.xml:21 from 3.3 to 3.6" in top
    assert lines[-1] == "Explain a code: crosscheck explain XC201"
    assert lines[-2].startswith("4 of 20 cases differ, 16 agree to 11.3 digits")


@pytest.mark.parametrize("width", [60, 80, 120])
def test_numbers_with_the_same_effect_are_listed_unless_the_audit_decides(width: int) -> None:
    others = (
        CauseId(kind="literal", subject=("body[a]@mass",)),
        CauseId(kind="unbound literal", subject=("b@c",)),
        CauseId(kind="constant", subject=("m",)),
    )
    tied = Explanation(causes=(WRONG,), remaining=1e-12, tied_with=others)
    ambiguous = model(diagnosis=Diagnosis(explanations=(tied,), explained=True))
    text = printed(results(*differing("mujoco"), models=(ambiguous,)), width)
    assert "or: body[a]@mass, b@c: the same effect on these motions" in " ".join(text.split())
    wrong = finding("mass is 3.3", location=SourceLine(file="mujoco.xml", line=21))
    decided = model(wrong, diagnosis=ambiguous.diagnosis)
    assert "or:" not in printed(results(*differing("mujoco"), models=(decided,)), width)


def test_cause_of_one_engine_has_a_space_after_its_label() -> None:
    models = tuple(
        model(engine=engine, diagnosis=diagnosis(replace(WRONG, subject=(name,))))
        for engine, name in (("mujoco", "a@mass"), ("pybullet", "b@mass"))
    )
    text = printed(results(*differing("mujoco", "pybullet"), models=models), 120)
    assert "cause [mujoco]: XC201 a@mass is 3.3" in text
    assert "cause [pybullet]: XC201 b@mass is 3.3" in text


def test_fault_besides_the_cause_is_reported() -> None:
    """Report poses too, which no motion can explain because they move nothing."""
    frame = finding("rod is 3 mm off", kind="pose", subject=("rod",))
    term = finding("inertia of x is 2, not 1", kind="inertia", subject=("x",))
    other = finding("height is 2 where h = 1", location=SourceLine(file="mujoco.xml", line=30))
    explained = model(frame, term, other, diagnosis=diagnosis(WRONG))
    text = printed(results(*differing("mujoco"), models=(explained,)), 120)
    assert "height is 2 where h = 1" in text
    assert "1 more finding about computed terms" in text
    assert "inertia of x" not in text, "it follows from the cause"
    details = printed(results(*differing("mujoco"), models=(explained,)), 120, details=True)
    assert "rod is 3 mm off" in details


def test_unexplained_difference_has_no_fix() -> None:
    vague = model(diagnosis=diagnosis(WRONG, explained=False, remaining=0.7))
    assert "fix:" not in printed(results(*differing("mujoco"), models=(vague,)))


def test_accepted_case_is_not_a_problem() -> None:
    accepted = case(Outcome.DIFFERS, accepted="soft")
    explained = model(diagnosis=diagnosis(WRONG), accepted="soft")
    text = printed(results(accepted, models=(explained,)))
    assert "cause" not in text
    assert "1 difference accepted" in text


def test_findings_that_differ_only_in_numbers_are_reported_once() -> None:
    alike = tuple(
        model(
            finding(f"A is {i}.5e-12 off", subject=("A",), expected=3.0, actual=3 + i * 1e-12),
            engine=engine,
        )
        for i, engine in enumerate(("mujoco", "pybullet"))
    )
    text = printed(results(case(), models=alike), 120)
    assert "disc/mujoco.xml [mujoco, pybullet]" in text
    assert text.count("e-12 off") == 1


def test_link_without_mass_has_its_line_and_fix(tmp_path: Path) -> None:
    dropped = cause(
        "moments of link[tool]/inertial/inertia", kind="dropped", nominal=0.0, estimate=0.0,
        standard_error=0.0, locations=(SourceLine(file="arm.urdf", line=22),),
    )  # fmt: skip
    link = finding(
        "link 'tool' has inertia and no mass", kind="inertia", subject=("tool", "massless"),
        location=SourceLine(file="arm.urdf", line=18),
    )  # fmt: skip
    names: dict[str, Any] = {"folder": "arm.urdf", "model": "arm.urdf", "system": "arm"}
    agreeing = case(engine="pybullet", full_run=None, **names)
    differs = case(Outcome.DIFFERS, verdict=verdict(discrepancy=2.1), **names)
    models = tuple(
        model(link, engine=engine, diagnosis=found, **names)
        for engine, found in (("mujoco", diagnosis(dropped)), ("pybullet", None))
    )
    assert printed(results(agreeing, differs, models=models)).splitlines()[:7] == [
        "arm.urdf",
        "  FAIL  mujoco  x off by up to 210 %",
        "        cause: XC205 MuJoCo drops the inertia of massless links",
        "        arm.urdf:18 tool",
        "        fix:   give the link a mass, or remove its inertia",
        "  ok    pybullet  11.3 digits",
        "1 of 2 engines differs, 1 agrees to 11.3 digits (1.5 s)",
    ]
    assert sentence(models[0]) == (
        "The engine drops the inertia of massless links: arm.urdf:18 tool."
        " Give the link a mass, or remove its inertia."
    )


def test_quiet_prints_problems_and_the_summary() -> None:
    text = printed(planted(), 100, quiet=True)
    lines = text.splitlines()
    assert lines[0].startswith("  FAIL  disc/mujoco.xml")
    assert "model_0.xml" not in text
    assert "the motion implies 3.6" in text
    assert lines[-1].startswith("4 of 20 cases differ")
