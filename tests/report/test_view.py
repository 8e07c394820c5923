"""Content of the report before it is rendered."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.render.html import render
from physics_crosscheck.harness.render.html.cases import CaseView
from physics_crosscheck.harness.render.html.diagnoses import DiagnosisView
from physics_crosscheck.harness.render.html.text import agreeing_digits, percent, shown, slug
from physics_crosscheck.harness.render.html.view import Report, report
from tests.report.samples import changed_case, changed_model, results


@pytest.fixture(scope="module")
def seen(troubled: Results) -> Report:
    return report(troubled)


def case_view(seen: Report, identity: str) -> CaseView:
    return next(case for case in seen.cases if case.id == identity)


def diagnosis_of(run: Results) -> Diagnosis:
    diagnosis = run.models[0].diagnosis
    assert diagnosis is not None
    return diagnosis


def marked(view: DiagnosisView) -> list[tuple[str, int]]:
    return [
        (file, line.number) for file, lines in view.files for line in lines if line and line.marked
    ]


def facts(view: CaseView) -> dict[str, str]:
    return {what: value for _, rows in view.facts for what, value in rows}


def test_every_case_is_shown_once_with_a_unique_id(seen: Report, troubled: Results) -> None:
    ids = [case.id for case in seen.cases]
    assert len(ids) == len(set(ids)) == len(troubled.cases)


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
    seen = report(sample)
    assert len({case.id for case in seen.cases}) == len(sample.cases)
    assert [group.name for group in seen.groups] == [
        "system_0 in /models/system_0",
        "system_0 in /elsewhere",
    ]
    assert len({group.id for group in seen.groups}) == 2


def test_case_recorded_twice_is_shown_twice() -> None:
    sample = results(1)
    sample = replace(sample, cases=(*sample.cases, sample.cases[0]))
    assert len({case.id for case in report(sample).cases}) == len(sample.cases)


def test_agreeing_digits_are_rounded_down_from_the_larger_bound() -> None:
    assert agreeing_digits(7.1e-14, 1.02e-12) == "11.9"
    assert agreeing_digits(1e-3, 1e-12) == "3.0"
    assert agreeing_digits(5.0, 1e-12) == "0.0"
    assert agreeing_digits(0.0, 0.0) == "all"
    assert agreeing_digits(1e-3, None) == "–"


def test_facts_of_case_equal_its_record(seen: Report) -> None:
    view = case_view(seen, "case-system_1/robot.urdf/pybullet/driven")
    assert (view.digits, view.discrepancy, view.uncertainty) == ("11.9", "7.1e-14", "1.0e-12")
    of_it = {what: value.replace("\u00a0", " ") for what, value in facts(view).items()}
    assert of_it["error at dt"] == "0.911 %"
    assert of_it["order"] == "1.002 measured, 1 claimed"
    assert of_it["checked by a run"] == "0.957 % at 0.0021 s, 1 % predicted"
    assert of_it["phase, at the end"] == "-0.068 rad"
    assert of_it["constraint drift"] == "0 (engine units)"
    assert of_it["engine steps for the verdict"] == "48\u202f185"
    assert of_it["integrator"] == "euler"
    assert of_it["f"] == "sin(t)"


def test_case_shows_effective_and_declared_numbers() -> None:
    sample, row = results(1), ActingQuantity(subject="floor", quantity="friction", value=0.25)
    rigid = replace(row, value=0.3, declared=True, rule="declared, rigid")
    for acting, shown_rows in (((row,), []), ((row, rigid), ["0.25", "0.3 (declared, rigid)"])):
        view = report(changed_model(sample, 0, acting=acting)).cases[0]
        rows = dict(view.facts).get("Acts as", ())
        assert [value for _, value in rows] == shown_rows


def test_cases_come_worst_first(seen: Report) -> None:
    outcomes = [case.outcome for case in seen.cases]
    worst = ["FAILED", "FAILED", "FAILED", "DIFFERS", "UNRESOLVED", "REFUSED", "ABSENT"]
    assert outcomes[:7] == worst
    assert set(outcomes[7:]) == {"AGREES"}
    assert seen.absent == ("pybullet",)


def test_case_without_numbers_shows_none(seen: Report) -> None:
    absent = case_view(seen, "case-system_0/mujoco.xml/mujoco/large")
    assert (absent.outcome, absent.digits, absent.discrepancy, absent.global_error) == (
        "ABSENT",
        *"–––",
    )
    assert not absent.judged
    assert absent.pack == ""


def test_failed_case_with_agreeing_segments_has_no_digits(seen: Report) -> None:
    blown_up = case_view(seen, "case-system_0/robot.urdf/mujoco/driven")
    assert blown_up.discrepancy == "7.1e-14"
    assert blown_up.digits == "–"
    assert not blown_up.judged


def test_unreadable_folder_is_a_separate_group(seen: Report) -> None:
    group = seen.groups[-1]
    assert group.name == "unread"
    assert group.about is None
    assert [case.reason for model in group.models for case, _ in model.cases] == [
        "/models/unread/system.py: line 3: no unit"
    ]


def test_poles_of_engine_and_taylor_are_listed_once_per_pair(seen: Report) -> None:
    about = seen.groups[0].about
    assert about is not None
    linear = about.linearizations[0]
    assert linear.poles == (("-0.1 ± 3i", "3.0017 rad/s, damping ratio 0.03331"),)
    assert linear.engines[0].errors == ("2.5e-14", "3.5e-15", "–", "0", "2.0e-13", "0.999000")
    assert linear.engines[0].poles == (("-0.1 ± 3.0003i", "1.0e-04"),)
    # The second model has none: its linearization failed.
    assert len(linear.engines) == 2
    assert [file.failures for file in about.files] == [
        (),
        ("robot.urdf was not linearized. mujoco: it diverges",),
    ]


def test_results_without_any_case_make_a_report() -> None:
    nothing = results(0)
    assert report(nothing).cases == ()


def test_small_shares_are_written_with_an_exponent() -> None:
    assert percent(0.00911) == "0.911\u00a0%"
    assert percent(3e-9) == "3.0e-09"
    assert percent(1.5e19) == "1.5e+19"


def test_invisible_characters_are_made_visible() -> None:
    assert shown("a\x1b[31mb\x00") == "a␛[31mb␀"
    assert shown("a\u202eb") == "a⟨U+202E⟩b"
    assert shown("\ud800") == "⟨U+D800⟩"
    assert shown("θ ± שלום\n") == "θ ± שלום\n"


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


def test_matrix_shows_worst_case_of_each_model_in_order(seen: Report) -> None:
    assert seen.matrix.engines[:2] == ("mujoco", "pybullet")
    names = list(dict.fromkeys(row.name for row in seen.matrix.rows))
    assert names == ["unread", "system_0", "system_1"] or names[-1] == "system_1"
    row = next(row for row in seen.matrix.rows if row.name == "system_0")
    assert row.model == "mujoco.xml"
    assert row.first
    assert sum(one.first for one in seen.matrix.rows) == len(names)
    first = row.cells[0]
    assert first is not None
    assert (first.outcome, first.counts, first.digits) == ("DIFFERS", "1 of 3", "5.5")
    assert first.global_error == "0.911\u00a0%"
    assert first.id == "case-system_0/mujoco.xml/mujoco/free"
    assert row.cells[-1] is None, "the unread folder's column has no case here"


def test_matrix_shows_costs_and_misread_numbers() -> None:
    """Ignore a limit that no motion reaches when comparing readings."""
    sample = results(2)
    note = AuditFinding(
        kind="default", subject=("motors",), message="motors are switched off", location=None,
        expected=None, actual=None, severity="note",
    )  # fmt: skip
    audit = (note, replace(note, kind="reach", message="x is limited"))
    models = tuple(replace(model, audit=audit) for model in sample.models)
    seen = report(replace(sample, models=models)).matrix
    assert {reading.notes for reading in seen.readings} == {("motors are switched off",)}
    cell = seen.rows[0].cells[0]
    assert cell is not None
    assert cell.tint == cell.digits
    took = []
    for case in sample.cases:
        if case.key == sample.cases[0].key and case.series is not None:
            seconds, until = case.series.full_runs.seconds[0], case.series.t[-1]
            assert seconds is not None
            assert until is not None
            took.append(1e3 * seconds / until)
    assert cell.cost == f"{max(took):.2g} ms/s"


def test_issue_names_the_cause_and_links_to_the_diagnosis(seen: Report) -> None:
    differs = next(one for one in seen.troubles if one.outcome == "DIFFERS")
    assert differs.sentence == (
        "joint[x]@stiffness (mujoco.xml:21) is 38.25; the motion implies 39.5 ± 1e-09."
    )
    assert differs.id == "diagnosis-system_0/mujoco.xml/mujoco"
    absent = [one for one in seen.troubles if one.outcome == "ABSENT"]
    assert [(one.cases, one.sentence) for one in absent] == [
        ("1 case", "pybullet is not installed")
    ]


def test_audit_finding_is_shown_even_if_every_case_agrees() -> None:
    finding = AuditFinding(
        kind="literal",
        subject=("m",),
        message="m is 2 where 3 belongs",
        location=SourceLine(file="/a/robot.urdf", line=7),
        expected=3.0,
        actual=2.0,
        severity="finding",
    )
    seen = report(changed_model(results(1), 1, audit=(finding,)))
    assert [(one.outcome, one.sentence) for one in seen.troubles] == [
        ("AUDIT", "m is 2 where 3 belongs")
    ]
    view = seen.groups[0].models[1].diagnosis
    assert view is not None
    assert marked(view) == [("robot.urdf", 7)]


def test_finding_about_a_whole_file_marks_no_line() -> None:
    finding = AuditFinding(
        kind="default",
        subject=("time step",),
        message="no time step is told",
        location=SourceLine(file="/a/robot.urdf"),
        expected=None,
        actual=None,
        severity="finding",
    )
    view = report(changed_model(results(1), 1, audit=(finding,))).groups[0].models[1].diagnosis
    assert view is not None
    assert view.audit == (("default", "no time step is told", "robot.urdf"),)
    assert view.files == ()


def test_unexplained_difference_has_no_cause(troubled: Results) -> None:
    unexplained = replace(diagnosis_of(troubled), explained=False)
    sample = changed_model(troubled, 0, diagnosis=unexplained, audit=())
    view = report(sample).groups[0].models[0].diagnosis
    assert view is not None
    assert view.sentence.startswith("Unexplained: the best single cause, joint[x]@stiffness,")
    assert view.files == (), "no line is blamed"


def test_unexplained_difference_starts_with_audit_findings(troubled: Results) -> None:
    unexplained = replace(diagnosis_of(troubled), explained=False)
    finding = AuditFinding(
        kind="literal",
        subject=("mass",),
        message="mass is 9 where m = 0.9",
        location=SourceLine(file="mujoco.xml", line=21),
        expected=0.9,
        actual=9.0,
        severity="finding",
    )
    sample = changed_model(troubled, 0, diagnosis=unexplained, audit=(finding, finding))
    seen = report(sample)
    view = seen.groups[0].models[0].diagnosis
    assert view is not None
    assert view.audit_first
    assert view.sentence == (
        "No single cause or pair of causes explains the motions; start with the audit findings:"
        " mass is 9 where m = 0.9, and 1 more."
    )
    assert marked(view) == [("mujoco.xml", 21)]
    assert view.sentence in {trouble.sentence for trouble in seen.troubles}
    page = render(sample)
    section = page[page.index(f'id="{view.id}"') :]
    assert section.index("Audit findings") < section.index("Possible causes")


def test_line_of_cause_is_marked_in_context(seen: Report) -> None:
    view = seen.groups[0].models[0].diagnosis
    assert view is not None
    ((file, lines),) = view.files
    assert file == "mujoco.xml"
    assert [line and line.number for line in lines] == [*range(17, 26), None]
    assert [line.text.strip() for line in lines if line and line.marked] == ["<line n='21'/>"]


def test_cause_in_the_sidecar_is_marked_there(troubled: Results) -> None:
    diagnosis = diagnosis_of(troubled)
    best = diagnosis.explanations[0]
    cause = replace(best.causes[0], locations=(SourceLine(file="mujoco.xml.toml", line=2),))
    explanations = (replace(best, causes=(cause,)), *diagnosis.explanations[1:])
    sample = changed_model(
        troubled,
        0,
        audit=(),
        sidecar="[[spring]]\nstiffness = 38.0\n",
        diagnosis=replace(diagnosis, explanations=explanations),
    )
    view = report(sample).groups[0].models[0].diagnosis
    assert view is not None
    assert marked(view) == [("mujoco.xml.toml", 2)]


def test_changes_since_the_baseline_link_to_their_cases(seen: Report) -> None:
    assert seen.changes is not None
    (change,) = seen.changes
    assert (change.kind, change.message) == ("changed", "it agreed to 11.9 digits")
    assert [id_ for id_, _ in change.cases] == ["case-system_0/mujoco.xml/mujoco/free"]
    assert report(results(1)).changes is None


def test_equal_changes_of_several_cases_are_grouped(seen: Report) -> None:
    """Group new cases, which would otherwise repeat one sentence each."""
    sample = results(1)
    same = tuple(bare_diff(case.id, Status.NEW, ("not in it",)) for case in sample.cases[:2])
    sample = replace(sample, baseline=BaselineChanges(name="main", changes=same))
    (change,) = report(sample).changes or ()
    assert [name for _, name in change.cases] == [str(case.id) for case in sample.cases[:2]]


def test_cost_of_the_step_is_one_sentence(seen: Report) -> None:
    view = case_view(seen, "case-system_1/robot.urdf/mujoco/free")
    assert view.cost == (
        "At dt = 0.002\u00a0s, the error is 0.911\u00a0% of the amplitude over the whole motion:"
        " by the end the amplitude is -2.9\u00a0% off and the phase 0.068\u00a0rad early."
    )
    assert view.steps == (("1\u00a0%", "0.0021\u00a0s"),), "an unknown step is not shown"


def test_digits_use_worst_and_discrepancies_use_deciding_component() -> None:
    sample = results(1)
    verdict = sample.cases[0].verdict
    assert verdict is not None
    wide = replace(verdict, largest_discrepancy=2e-11, largest_uncertainty=4e-10)
    seen = report(changed_case(sample, 0, verdict=wide))
    view = case_view(seen, "case-system_0/mujoco.xml/mujoco/free")
    assert (view.digits, view.discrepancy, view.uncertainty) == ("9.3", "7.1e-14", "1.0e-12")
    assert view.sorts[:3] == ("4e-10", "7.1e-14", "1.02e-12")
    of_it = facts(view)
    assert of_it["agreeing digits"] == "9.3"
    assert of_it["worst component"] == "q0"
    assert (of_it["largest E"], of_it["largest U"]) == ("2.0e-11", "4.0e-10")
    cell = seen.matrix.rows[0].cells[0]
    assert cell is not None
    assert cell.digits == "9.3"


def test_cause_with_and_in_its_name_is_one_cause(troubled: Results) -> None:
    diagnosis = diagnosis_of(troubled)
    best = diagnosis.explanations[0]
    body = replace(best.causes[0], subject=("body[nut and bolt]@mass",), locations=())
    pair = (body, replace(best.causes[0], estimate=2.5))
    for causes in ((body,), pair):
        first = replace(best, causes=causes, tied_with=(body.id,))
        sample = changed_model(troubled, 0, diagnosis=replace(diagnosis, explanations=(first,)))
        view = report(sample).groups[0].models[0].diagnosis
        assert view is not None
        (shown_first,) = view.explanations
        names = ["body[nut and bolt]@mass", "joint[x]@stiffness"][: len(causes)]
        assert [one.name for one in shown_first.causes] == names
        assert [one.kind for one in shown_first.causes] == ["literal"] * len(causes)
        assert shown_first.tied == "body[nut and bolt]@mass"
        assert view.sentence.count("the motion implies") == len(causes)


def test_system_without_derivation_shows_its_declaration() -> None:
    sample = results(1)
    sample = replace(sample, systems=(replace(sample.systems[0], derivation=None),))
    about = report(sample).groups[0].about
    assert about is not None
    assert (about.lagrangian, about.equations) == ((), ())
    assert about.linearizations
    assert all(one.poles and not one.equations and not one.modes for one in about.linearizations)
    assert about.constants[0][1] == "38.25"


def test_failed_audit_is_shown_next_to_its_file() -> None:
    sample = changed_model(results(1), 0, audit=None, audit_failure="the engine died")
    about = report(sample).groups[0].about
    assert about is not None
    assert about.files[0].failures == ("mujoco.xml was not audited. mujoco: the engine died",)


def test_agreeing_chaotic_motion_is_not_shown_as_a_fault() -> None:
    sample = results(1)
    full_run = sample.cases[0].full_run
    assert full_run is not None
    lost = replace(full_run, global_error=0.944, decomposition=None, resolved_until=3.5)
    seen = report(changed_case(sample, 0, full_run=lost))
    view = case_view(seen, "case-system_0/mujoco.xml/mujoco/free")
    assert view.global_error == "chaotic"
    assert view.cost.startswith("The motion is chaotic: small differences grow")
    assert "here until 3.5\u00a0s" in view.cost
    assert "not a fault of the model" in view.cost
    cell = seen.matrix.rows[0].cells[0]
    assert cell is not None
    assert cell.global_error == "0.911\u00a0%", "of the other scenarios"
    assert [one.value for one in seen.outliers] == ["11.9", "0.911\u00a0%", "1"]
    differs = replace(sample.cases[0], outcome=Outcome.DIFFERS, full_run=lost)
    seen = report(replace(sample, cases=(differs, *sample.cases[1:])))
    assert case_view(seen, view.id).global_error == "94.4\u00a0%", "no excuse for what differs"
