"""Terminal output of runs, compared with the recorded text: problems, causes, summaries, notes."""

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.interfaces.pytest_plugin.collect import properties
from physics_crosscheck.harness.records.case import EventTime, SkippedCheck, WholeStep
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.results import BaselineChanges
from physics_crosscheck.harness.records.scene import Scene, UnreadMesh
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.render.html.cases import CaseView
from physics_crosscheck.harness.render.html.diagnoses import sentence
from physics_crosscheck.harness.results.issues import collect_issues
from physics_crosscheck.records import (
    Case,
    CaseId,
    CauseId,
    Diagnosis,
    Explanation,
    Outcome,
    Results,
    SourceLine,
)
from tests.recorded import recorded
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
from tests.report.samples import system

LINE = SourceLine(file="mujoco.xml", line=21)
WRONG = cause(
    "body[rod]/inertial@mass", nominal=3.3, estimate=3.6000000000001, standard_error=5e-12,
    locations=(LINE,),
)  # fmt: skip
SMALL_BESIDE = verdict(
    component="x",
    discrepancy=2e-13,
    uncertainty=3e-13,
    largest_discrepancy=6e-12,
    largest_uncertainty=4e-11,
)
"""x has the largest share of its uncertainty; another component has a larger uncertainty."""
OFF = case(Outcome.DIFFERS, verdict=verdict(discrepancy=1.0))


def differing(*engines: str) -> tuple[Case, ...]:
    """Return cases of two scenarios that differ in each engine."""
    return tuple(
        case(
            Outcome.DIFFERS,
            engine=engine,
            scenario=scenario,
            reason=f"x is {i}.5e-02 off",
            verdict=verdict(discrepancy=0.01 * (i + 1)),
        )
        for engine in engines
        for i, scenario in enumerate(("free", "driven"))
    )


def planted() -> Results:
    """Return results with one wrong number that two scenarios and two engines show."""
    wrong = finding("body[rod]/inertial@mass is 3.3 where m = 3.6", location=LINE)
    models = tuple(
        model(wrong, engine=engine, diagnosis=diagnosis(WRONG, remaining=remaining))
        for engine, remaining in (("mujoco", 4e-12), ("pybullet", 5e-12))
    )
    agreeing = [case(model=f"model_{i}.xml", scenario=s) for i in range(2) for s in ("a", "b")]
    return results(*differing("mujoco", "pybullet"), *agreeing, models=models)


def mixed_outcomes() -> Results:
    return results(
        case(),
        case(Outcome.DIFFERS, reason="off", accepted="a soft joint"),
        case(Outcome.FAILED, reason="died"),
        case(Outcome.ABSENT, reason="pymunk is not installed"),
    )


def missing_engine() -> Results:
    why = "pymunk is not installed; pip install 'physics-crosscheck[engines]'"
    return results(*(case(Outcome.ABSENT, engine="pymunk", scenario=s, reason=why) for s in "ab"))


def worst_first() -> Results:
    """Print what an engine printed, and no markup."""
    return results(
        case(Outcome.DIFFERS, reason="x is off"),
        case(Outcome.DIFFERS, scenario="far", verdict=verdict(discrepancy=1.0)),
        case(Outcome.FAILED, scenario="dies", reason="it [b]died[/b]:cat:", stdout="one\ntwo"),
        models=(
            model(finding("the mass is wrong"), finding("rounded", severity="note")),
            model(engine="pymunk", linearization_failure="it died too"),
        ),
    )


def vague_cause(remaining: float, failure: str = "", audited: bool = False) -> Results:
    """Return a difference without a cause, and with all wrong literals of the audit."""
    best = cause("m", kind="constant", estimate=7.0, standard_error=2.0)
    vague = replace(diagnosis(best, remaining=remaining, explained=False), failure=failure)
    wrong = finding("mass is 9 where m = 0.9"), finding("rounded", severity="note")
    return results(OFF, models=(model(*wrong * audited, diagnosis=vague),))


def steps_and_coverage() -> Results:
    """Omit a step that deviates where its limit shows the same difference."""
    soft = stepping(Outcome.DIFFERS, besides="equalities")
    return results(
        case(stepping=stepping(Outcome.AGREES, discrepancy=2e-14)),
        case(model="soft.xml", stepping=soft),
        case(Outcome.DIFFERS, model="wrong.xml", reason="off", stepping=soft),
        models=(model(coverage=Coverage(numbers=31, motion=23)),),
    )


def deciding_checks() -> Results:
    steps = verdict(decided_by="single steps", largest_discrepancy=2e-14, largest_uncertainty=3e-13)
    skipped = SkippedCheck(check="segments", reason="r")
    return results(case(verdict=steps, skipped=(skipped,)), case(verdict=verdict()))


def long_reasons() -> Results:
    """Print a long reason of an engine for each case in the details only."""
    reason = "arm.urdf: PyBullet can't load it: Could not parse collision element"
    step = WholeStep(uncovered=(reason,))
    return results(*(case(engine=engine, whole_step=step) for engine in ("mujoco", "pybullet")))


def whole_steps() -> Results:
    """List a step that is off by 110 % beside a motion, and the steps of other engines."""
    numbers: dict[str, Any] = {"component": "knee_ddot", "uncertainty": 2e-9, "states": 19}
    open_ = WholeStep(outcome=Outcome.UNRESOLVED, discrepancy=1e-9, **numbers)
    wrong = WholeStep(outcome=Outcome.DIFFERS, discrepancy=1.1, **numbers)
    good = WholeStep(
        outcome=Outcome.AGREES, discrepancy=3e-12, next_state=True, **numbers, unresolved=5
    )
    counted = replace(good, contact_counts=("a and b have 4 contacts",))
    return results(
        case(engine="drake", whole_step=counted),
        case(engine="dart", whole_step=open_),
        case(Outcome.DIFFERS, engine="pybullet", whole_step=wrong),
    )


def events() -> Results:
    shown = (
        EventTime(part="floor", change="impact", time=0.3, in_run=0.301),
        EventTime(part="stop", change="impact", time=0.7, in_run=0.696),
        EventTime(part="stop", change="free to closed", time=0.9),
    )
    return results(case(full_run=full_run(events=shown)), case(scenario="smooth"))


def tied_cause(*wrong: Any) -> Results:
    others = (
        CauseId(kind="literal", subject=("body[a]@mass",)),
        CauseId(kind="unbound literal", subject=("b@c",)),
        CauseId(kind="constant", subject=("m",)),
    )
    tied = Explanation(causes=(WRONG,), remaining=1e-12, tied_with=others)
    ambiguous = Diagnosis(explanations=(tied,), explained=True)
    return results(*differing("mujoco"), models=(model(*wrong, diagnosis=ambiguous),))


def cause_of_each_engine() -> Results:
    models = tuple(
        model(engine=engine, diagnosis=diagnosis(replace(WRONG, subject=(name,))))
        for engine, name in (("mujoco", "a@mass"), ("pybullet", "b@mass"))
    )
    return results(*differing("mujoco", "pybullet"), models=models)


def fault_besides_the_cause() -> Results:
    """Report poses too, which no motion can explain because they move nothing."""
    frame = finding("rod is 3 mm off", kind="pose", subject=("rod",))
    term = finding("inertia of x is 2, not 1", kind="inertia", subject=("x",))
    other = finding("height is 2 where h = 1", location=replace(LINE, line=30))
    explained = model(frame, term, other, diagnosis=diagnosis(WRONG))
    return results(*differing("mujoco"), models=(explained,))


def accepted_cause() -> Results:
    explained = model(diagnosis=diagnosis(WRONG), accepted="soft")
    return results(case(Outcome.DIFFERS, accepted="soft"), models=(explained,))


def findings_that_differ_in_numbers() -> Results:
    alike = tuple(
        model(
            finding(f"A is {i}.5e-12 off", subject=("A",), expected=3.0, actual=3 + i * 1e-12),
            engine=engine,
        )
        for i, engine in enumerate(("mujoco", "pybullet"))
    )
    return results(case(), models=alike)


def link_without_mass() -> Results:
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
        model(link, engine=engine, diagnosis=cause_, **names)
        for engine, cause_ in (("mujoco", diagnosis(dropped)), ("pybullet", None))
    )
    return results(agreeing, differs, models=models)


def doubtful_robot() -> Results:
    """Return an agreeing robot with advice, unread names, creep and a mesh without a reader."""
    advice = finding(
        "the masses of 'left' and 'right' are 2 and 1", kind="left and right",
        subject=("left", "right"), severity="advice", location=SourceLine(file="in/b.urdf", line=7),
    )  # fmt: skip
    unread = finding(
        kind="unread", subject=("<motorInertia> of <joint>",), severity="note",
        location=SourceLine(file="a.urdf", line=9),
    )  # fmt: skip
    creep = ActingQuantity(
        subject="floor with foot", quantity="creep", value=0.0457, rule="on a slope"
    )
    scene = Scene(
        bodies=(), joints=(), placements=(), velocities=(), accelerations=(), length=1.0,
        unread=(UnreadMesh(name="hull.dae", problem="without a reader"),),
    )  # fmt: skip
    place: dict[str, Any] = {"folder": "a.urdf", "model": "a.urdf"}
    return results(
        case(**place),
        models=(
            model(
                advice, unread, coverage=Coverage(numbers=31, motion=23), acting=(creep,), **place
            ),
        ),
        systems=(replace(system("a", 1), folder="a.urdf", scene=scene),),
    )


def signed(component: str, excess: float | None) -> Results:
    off = verdict(discrepancy=0.02, component=component, excess=excess)
    return results(case(Outcome.DIFFERS, verdict=off))


LARGER = verdict(largest_discrepancy=7e-11, largest_uncertainty=4e-11)
WITHIN = case(Outcome.DIFFERS, engine="pybullet", accepted="within its own 3e-8")
FAULTY = model(finding("mass is 9"))
BOTH = (case(), case(engine="pymunk"))
OUTPUTS = {
    "no case": results(),
    "one case": results(case()),
    "digits are the fewest of all components": results(case(verdict=SMALL_BESIDE), case()),
    "a difference is larger than its uncertainty": results(case(verdict=LARGER)),
    "every outcome": mixed_outcomes(),
    "within the engine's own": results(case(), WITHIN),
    "a fault without effect on motions": results(*BOTH, models=(FAULTY,)),
    "a fault in one of several files": results(*BOTH, case(model="b.xml"), models=(FAULTY,)),
    "a missing engine": missing_engine(),
    "problems come worst first": worst_first(),
    "no cause, but findings": vague_cause(0.07, audited=True),
    "no cause, and no finding": vague_cause(0.07),
    "no cause after a failure": vague_cause(0.2, "it died"),
    "single steps and coverage": steps_and_coverage(),
    "deciding checks": deciding_checks(),
    "whole steps with a long reason": long_reasons(),
    "whole steps": whole_steps(),
    "events": events(),
    "a planted number": planted(),
    "numbers with the same effect": tied_cause(),
    "the audit decides between numbers": tied_cause(finding("mass is 3.3", location=LINE)),
    "a cause of each engine": cause_of_each_engine(),
    "a fault besides the cause": fault_besides_the_cause(),
    "an accepted cause": accepted_cause(),
    "findings that differ in numbers": findings_that_differ_in_numbers(),
    "a link without mass": link_without_mass(),
    "implausible numbers": doubtful_robot(),
    "too fast": signed("knee_dot", 2.12),
    "too slow": signed("knee_ddot", -0.5),
    "a sign that changes": signed("knee_dot", None),
}


DETAILED = {
    "every outcome", "problems come worst first", "no cause, but findings", "whole steps", "events",
    "single steps and coverage", "deciding checks", "a planted number", "a fault besides the cause",
}  # fmt: skip


def test_output_is_the_recorded_text() -> None:
    text = ""
    for name, run in OUTPUTS.items():
        lines = printed(run, 100).splitlines()
        if name in DETAILED:
            lines += ["## --details", *printed(run, 100, details=True).splitlines()]
        text += "\n".join([f"# {name}", *lines, "", ""])
    assert text == recorded("outputs", text)


def test_many_problems_and_changes_are_counted() -> None:
    id_ = CaseId(system="disc", model="m", scenario="s", engine="e")
    change = bare_diff(id_, Status.GONE, ("it is gone",))
    changed = tuple(replace(change, scenario=f"s{i}") for i in range(40 + 1))
    new = replace(change, status=Status.NEW)  # never accepted, so not a change
    text = printed(
        results(
            *(case(Outcome.DIFFERS, model=f"{i}.xml") for i in range(40 + 2)),
            baseline=BaselineChanges(name="reports/baseline", changes=(new, *changed)),
        )
    )
    assert "2 more problems: see the report" in text
    assert "changes since reports/baseline" in text
    assert text.count("  gone  XC502 disc/m  s0 [e], s1 [e], ") == 1
    more = 40 + 1 - 12
    assert f"s{12 - 1} [e] and {more} more: it is gone" in " ".join(text.split())


def test_whole_steps_are_in_pytest_and_on_the_page() -> None:
    _, open_, wrong = whole_steps().cases
    assert properties(wrong)["whole steps"].startswith("differ at 19 states")
    page = CaseView(id="id", case=open_, pack="", scene=None, scenario=None, model=None)
    assert "whole steps are unresolved at 19 states" in str(page.reason)


def test_page_names_the_link_without_mass() -> None:
    assert sentence(link_without_mass().models[0]) == (
        "The engine drops the inertia of massless links: arm.urdf:18 tool."
        " Give the link a mass, or remove its inertia."
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
    assert lines[-2].startswith("4 of 8 cases differ, 4 agree to 11.3 digits")


def test_quiet_prints_problems_and_the_summary() -> None:
    text = printed(planted(), 100, quiet=True)
    lines = text.splitlines()
    assert lines[0].startswith("  FAIL  disc/mujoco.xml")
    assert "model_0.xml" not in text
    assert "the motion implies 3.6" in text
    assert lines[-1].startswith("4 of 8 cases differ")
