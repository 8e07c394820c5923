"""Text of the report's page: cases, systems, diagnoses and the overview."""

import re
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.case import TimeStep
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.results import BaselineChanges
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.render.html import render
from physics_crosscheck.harness.render.html.text import percent, shown, slug
from physics_crosscheck.records import Diagnosis, Outcome, Results, SourceLine
from tests.recorded import changes, recorded
from tests.records.made import finding
from tests.report.page import Page
from tests.report.samples import (
    changed_case,
    changed_model,
    diagnosis,
    judged,
    located,
    mixed,
    planted,
    results,
)

VIEWS = (
    "overview|system-(system_0|unread)|diagnosis-.*|case-system_0/mujoco.xml/mujoco/(free|large)"
    "|case-system_0/robot.urdf/mujoco/driven"
)


def test_page_has_the_recorded_text(troubled_page: Page) -> None:
    text = "\n".join(troubled_page.lines(VIEWS))
    assert text == recorded("page", text)


def diagnosis_of(run: Results, place: int = 0) -> Diagnosis:
    diagnosed = run.models[place].diagnosis
    assert diagnosed is not None
    return diagnosed


def effective_and_declared_number(base: Results) -> Results:
    row = ActingQuantity(subject="floor", quantity="friction", value=0.25)
    rigid = replace(row, value=0.3, declared=True, rule="declared, rigid")
    return changed_model(base, 0, acting=(row, rigid))


def finding_of_an_agreeing_model(base: Results) -> Results:
    where = SourceLine(file="/a/robot.urdf", line=7)
    wrong = finding("m is 2 where 3 belongs", location=where, expected=3.0, actual=2.0)
    return changed_model(base, 1, audit=(wrong,))


def implausible_numbers_alone(base: Results) -> Results:
    where = SourceLine(file="/a/robot.urdf", line=7)
    doubtful = finding(
        "the masses of 'left' and 'right' are 2 and 1",
        kind="left and right", location=where, severity="advice",
    )  # fmt: skip
    other = replace(doubtful, message="'left_arm' is 3 times as heavy")
    return changed_model(base, 1, audit=(doubtful, other))


def time_step_without_a_full_run(base: Results) -> Results:
    step = TimeStep(step=0.002, duration=1.0, error=0.0123, order=1)
    return changed_case(base, 0, full_run=None, series=None, time_step=step)


def finding_about_a_whole_file(base: Results) -> Results:
    """Mark no line."""
    where = SourceLine(file="/a/robot.urdf")
    stated = finding("no time step is stated", kind="default", location=where)
    return changed_model(base, 1, audit=(stated,))


def two_numbers_to_change(base: Results) -> Results:
    text = "<a>\n  <b mass='2' size='0.1 0.2'/>\n  <c mass='4.5'/>\n</a>\n"
    findings = tuple(
        finding(
            f"{name}@mass is wrong", subject=(f"{name}@mass",), actual=old, expected=new,
            location=located(SourceLine(file="robot.urdf", line=line), text, spelled),
            replacement=repr(new),
        )
        for name, line, spelled, old, new in (
            ("b", 2, "2", 2.0, 3.0), ("c", 3, "4.5", 4.5, 0.1 + 0.2),
        )
    )  # fmt: skip
    return changed_model(base, 1, audit=findings, text=text)


def two_numbers_of_an_unexplained_difference(base: Results) -> Results:
    agreeing = two_numbers_to_change(base)
    unexplained = replace(diagnosis(base.cases[3]), explained=False)
    differs = judged(base.cases[3], Outcome.DIFFERS, "off", discrepancy=0.1)
    return changed_case(
        changed_model(agreeing, 1, diagnosis=unexplained),
        3,
        **{name: getattr(differs, name) for name in ("outcome", "reason", "verdict")},
    )


def repeated_notes(base: Results) -> Results:
    """List a note of an engine once; ignore a limit that no motion reaches."""
    note = finding("motors are switched off", kind="default", severity="note")
    audit = (note, replace(note, kind="reach", message="x is limited"))
    return replace(base, models=tuple(replace(model, audit=audit) for model in base.models))


def failed_audit(base: Results) -> Results:
    return changed_model(base, 0, audit=None, audit_failure="the engine died")


def equal_changes(base: Results) -> Results:
    """Group new cases, which would otherwise repeat one sentence each."""
    same = tuple(bare_diff(case.id, Status.NEW, ("not in it",)) for case in base.cases[:2])
    return replace(base, baseline=BaselineChanges(name="main", changes=same))


def largest_uncertainty_of_another_component(base: Results) -> Results:
    verdict = base.cases[0].verdict
    assert verdict is not None
    wide = replace(verdict, largest_discrepancy=2e-11, largest_uncertainty=4e-10)
    return changed_case(base, 0, verdict=wide)


def no_derivation(base: Results) -> Results:
    return replace(base, systems=(replace(base.systems[0], derivation=None),))


def no_constants(base: Results) -> Results:
    return replace(base, systems=(replace(base.systems[0], constants=()),))


def chaotic_motion(base: Results) -> Results:
    """Show no fault of the model."""
    full_run = base.cases[0].full_run
    assert full_run is not None
    lost = replace(full_run, global_error=0.944, decomposition=None, resolved_until=3.5)
    return changed_case(base, 0, full_run=lost)


def chaotic_motion_that_differs(base: Results) -> Results:
    return changed_case(chaotic_motion(base), 0, outcome=Outcome.DIFFERS)


def accepted_difference(base: Results) -> Results:
    fields = {"outcome": Outcome.DIFFERS, "reason": "off", "accepted": "within its own 3e-08"}
    return changed_case(base, 0, **fields)


def unexplained(base: Results) -> Results:
    """Blame no line."""
    return changed_model(base, 0, audit=(), diagnosis=replace(diagnosis_of(base), explained=False))


def unexplained_with_findings(base: Results) -> Results:
    where = SourceLine(file="mujoco.xml", line=21)
    wrong = finding("mass is 9 where m = 0.9", location=where, expected=0.9, actual=9.0)
    vague = replace(diagnosis_of(base), explained=False)
    return changed_model(base, 0, diagnosis=vague, audit=(wrong, wrong))


def cause_in_the_sidecar(base: Results) -> Results:
    first, *others = diagnosis_of(base).explanations
    cause = replace(first.causes[0], locations=(SourceLine(file="mujoco.xml.toml", line=2),))
    changed = replace(diagnosis_of(base), explanations=(replace(first, causes=(cause,)), *others))
    sidecar = "[[spring]]\nstiffness = 38.0\n"
    return changed_model(base, 0, audit=(), sidecar=sidecar, diagnosis=changed)


def cause_with_and_in_its_name(base: Results) -> Results:
    """Count the two causes as two."""
    first = diagnosis_of(base).explanations[0]
    body = replace(first.causes[0], subject=("body[nut and bolt]@mass",), locations=())
    pair = (body, replace(first.causes[0], estimate=2.5))
    shown = replace(first, causes=pair, tied_with=(body.id,))
    return changed_model(base, 0, diagnosis=replace(diagnosis_of(base), explanations=(shown,)))


def axis_besides_the_number(base: Results) -> Results:
    """Report a reversed axis too, which no number expresses, without a patch."""
    first = diagnosis_of(base, 1).explanations[0]
    turned = replace(first.causes[0], kind="axis", subject=("x",), locations=())
    both = replace(first, causes=(*first.causes, turned))
    return changed_model(base, 1, diagnosis=replace(diagnosis_of(base, 1), explanations=(both,)))


Variant = Callable[[Results], Results]
VARIANTS: dict[Callable[[], Results], dict[Variant, str]] = {
    lambda: results(1): {
        effective_and_declared_number: "case-.*",
        finding_of_an_agreeing_model: "overview|diagnosis-.*",
        implausible_numbers_alone: "overview",
        time_step_without_a_full_run: "overview",
        finding_about_a_whole_file: "diagnosis-.*",
        two_numbers_to_change: "overview",
        two_numbers_of_an_unexplained_difference: "overview",
        repeated_notes: "overview",
        failed_audit: "system-.*",
        equal_changes: "overview",
        largest_uncertainty_of_another_component: "overview|case-.*",
        no_derivation: "system-.*",
        no_constants: "system-.*",
        chaotic_motion: "overview|case-.*",
        chaotic_motion_that_differs: "overview",
        accepted_difference: "overview",
    },
    mixed: {
        unexplained: "diagnosis-.*",
        unexplained_with_findings: "overview|diagnosis-.*",
        cause_in_the_sidecar: "diagnosis-.*",
        cause_with_and_in_its_name: "diagnosis-.*",
    },
    lambda: planted(("mujoco",)): {axis_besides_the_number: "overview"},
}
"""Changes of results, and the views that show them."""


def test_changed_results_change_the_recorded_lines() -> None:
    text = ""
    for base, variants in VARIANTS.items():
        sample = base()
        before = Page(render(sample))
        for variant, views in variants.items():
            after = Page(render(variant(sample)))
            lines = changes(before.lines(views), after.lines(views))
            text += "\n".join([f"# {variant.__name__.replace('_', ' ')}", *lines, "", ""])
    assert text == recorded("page_changes", text)


def test_folders_with_equal_names_are_distinguished() -> None:
    sample = results(1)
    sample = replace(
        sample,
        systems=sample.systems
        + tuple(replace(entry, folder="/elsewhere") for entry in sample.systems),
        models=sample.models
        + tuple(replace(entry, folder="/elsewhere") for entry in sample.models),
        cases=sample.cases + tuple(replace(entry, folder="/elsewhere") for entry in sample.cases),
    )
    page = Page(render(sample))
    assert len(page.ids()) == len(set(page.ids()))
    links = re.findall(r'<a href="#(system.*?)">(.*?)</a>', page.source.split("<main")[0])
    assert [name for _, name in links] == ["system_0 in /models/system_0", "system_0 in /elsewhere"]
    assert len({identity for identity, _ in links}) == 2


def test_case_recorded_twice_is_shown_twice() -> None:
    sample = results(1)
    sample = replace(sample, cases=(*sample.cases, sample.cases[0]))
    cases = [one for one in Page(render(sample)).ids() if one.startswith("case-")]
    assert len(cases) == len(set(cases)) == len(sample.cases)


def test_cases_are_sorted_by_exact_numbers() -> None:
    page = render(largest_uncertainty_of_another_component(results(1)))
    row = page.split('id="cases"')[1].split("<tbody>")[1].split("</tr>")[0]
    assert re.findall(r'data-v="(.*?)"', row)[1:4] == ["4e-10", "7.1e-14", "1.02e-12"]
    assert 'style="--digits: 9.3"' in page


def test_small_shares_are_written_with_an_exponent() -> None:
    assert percent(0.00911) == "0.911\u00a0%"
    assert percent(3e-9) == "3.0e-09"
    assert percent(1.5e19) == "1.5e+19"


@pytest.mark.parametrize(
    ("text", "visible"),
    [
        ("a\x1b[31mb\x00", "a␛[31mb␀"),
        ("a\u202eb", "a⟨U+202E⟩b"),
        ("\ud800", "⟨U+D800⟩"),
        ("θ ± שלום\n", "θ ± שלום\n"),
    ],
)
def test_invisible_characters_are_made_visible(text: str, visible: str) -> None:
    assert shown(text) == visible


def test_different_names_have_different_harmless_slugs() -> None:
    names = ["a/b", "a b", "a~2f~b", "a<b", "ab", "a\u202eb", "a=b", "a~~b"]
    slugs = [slug(name) for name in names]
    assert len(set(slugs)) == len(names)
    assert all(set(s) <= set("abcdef0123456789~") for s in slugs)
    assert slug("a", "b") != slug("a/b")
    assert (
        slug("drum_pendulum", "mujoco.xml", "mujoco", "free")
        == "drum_pendulum/mujoco.xml/mujoco/free"
    )
