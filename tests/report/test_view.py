"""Content of the report's page: cases, systems, diagnoses and the overview."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.render.html import render
from physics_crosscheck.harness.render.html.text import percent, shown, slug
from tests.report.page import facts_of, plain, table_rows, view_of
from tests.report.samples import changed_case, changed_model, results

BEST = "case-system_0/mujoco.xml/mujoco/free"
DIAGNOSIS = "diagnosis-system_0/mujoco.xml/mujoco"


@pytest.fixture(scope="module")
def seen(troubled: Results) -> str:
    return render(troubled)


def diagnosis_of(run: Results) -> Diagnosis:
    diagnosis = run.models[0].diagnosis
    assert diagnosis is not None
    return diagnosis


def listed(page: str) -> list[dict[str, str]]:
    """Return the cells of the list of cases, with the id of each."""
    body = page.split('id="cases"')[1].split("</table>")[0].split("<tbody>")[1]
    names = ("outcome", "case", "engine", "digits", "E", "U", "error", "dt", "reason")
    return [
        dict(zip(names, map(plain, re.findall(r"<td.*?</td>", row)), strict=True))
        | {
            "id": re.findall(r'href="#(.*?)"', row)[0],
            "sorts": " ".join(re.findall(r'data-v="(.*?)"', row)[1:]),
        }
        for row in body.split("</tr>")[:-1]
    ]


def listed_case(page: str, identity: str) -> dict[str, str]:
    return next(row for row in listed(page) if row["id"] == identity)


def issues(page: str) -> list[str]:
    """Return the text of each issue."""
    parts = page.split('id="matrix-title"')[0].split("<li class=")[1:]
    return [plain("<" + part.split("</li>")[0]) for part in parts]


def matrix_row(page: str, name: str) -> str:
    body = page.split('<table class="matrix')[1].split("</table>")[0]
    return next(row for row in body.split("<tr")[2:] if f">{name}</a>" in row)


def marked(page: str, identity: str) -> list[tuple[str, str, str]]:
    """Return file, number and text of each marked line of a diagnosis."""
    excerpts = view_of(page, identity).split('<div class="source"')
    return [
        (before.rsplit("<h3>", 1)[1].split("</h3>")[0], number, plain(text))
        for before, excerpt in pairwise(excerpts)
        for number, text in re.findall(
            r'class="marked" value="(\d+)">.*?<code>(.*?)</code>', excerpt
        )
    ]


def test_every_case_is_shown_once_with_a_unique_id(seen: str, troubled: Results) -> None:
    ids = [row["id"] for row in listed(seen)]
    assert len(ids) == len(set(ids)) == len(troubled.cases)
    assert all(seen.count(f' id="{one}"') == 1 for one in ids)


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
    seen = render(sample)
    assert len({row["id"] for row in listed(seen)}) == len(sample.cases)
    links = re.findall(r'<a href="#(system.*?)">(.*?)</a>', seen.split("<main")[0])
    assert [name for _, name in links] == ["system_0 in /models/system_0", "system_0 in /elsewhere"]
    assert len({identity for identity, _ in links}) == 2


def test_case_recorded_twice_is_shown_twice() -> None:
    sample = results(1)
    sample = replace(sample, cases=(*sample.cases, sample.cases[0]))
    assert len({row["id"] for row in listed(render(sample))}) == len(sample.cases)


def test_facts_of_case_equal_its_record(seen: str) -> None:
    identity = "case-system_1/robot.urdf/pybullet/driven"
    row, of_it = listed_case(seen, identity), facts_of(view_of(seen, identity))
    assert (row["digits"], row["E"], row["U"]) == ("11.9", "7.1e-14", "1.0e-12")
    assert of_it["error at dt"] == "0.911 %"
    assert of_it["order"] == "1.002 measured, 1 claimed"
    assert of_it["checked by a run"] == "0.957 % at 0.0021 s, 1 % predicted"
    assert of_it["phase, at the end"] == "-0.068 rad"
    assert of_it["constraint drift"] == "0 (engine units)"
    assert of_it["engine steps for the verdict"] == "48 185"
    assert of_it["integrator"] == "euler"
    assert of_it["f"] == "sin(t)"


def test_case_shows_effective_and_declared_numbers() -> None:
    sample, row = results(1), ActingQuantity(subject="floor", quantity="friction", value=0.25)
    rigid = replace(row, value=0.3, declared=True, rule="declared, rigid")
    for acting, shown_rows in (((row,), []), ((row, rigid), ["0.25", "0.3 (declared, rigid)"])):
        view = view_of(render(changed_model(sample, 0, acting=acting)), BEST)
        assert re.findall(r"<dt>floor: friction</dt><dd>(.*?)</dd>", view) == shown_rows


def test_cases_come_worst_first(seen: str) -> None:
    outcomes = [row["outcome"].split()[1] for row in listed(seen)]
    worst = ["FAILED", "FAILED", "FAILED", "DIFFERS", "UNRESOLVED", "REFUSED", "ABSENT"]
    assert outcomes[:7] == worst
    assert set(outcomes[7:]) == {"AGREES"}
    assert facts_of(seen.split('class="run"')[1])["pybullet"] == "not installed"


def test_case_without_numbers_shows_none(seen: str) -> None:
    absent = listed_case(seen, "case-system_0/mujoco.xml/mujoco/large")
    assert absent["outcome"] == "○ ABSENT"
    assert (absent["digits"], absent["E"], absent["error"]) == ("–", "–", "–")
    view = view_of(seen, absent["id"])
    assert "digits" not in view
    assert "No motion to plot." in view


def test_failed_case_with_agreeing_segments_has_no_digits(seen: str) -> None:
    blown_up = listed_case(seen, "case-system_0/robot.urdf/mujoco/driven")
    assert (blown_up["E"], blown_up["digits"]) == ("7.1e-14", "–")
    assert 'class="brief"' not in view_of(seen, blown_up["id"])


def test_unreadable_folder_is_a_separate_group(seen: str) -> None:
    assert "This system could not be read." in view_of(seen, "system-unread")
    assert "/models/unread/system.py: line 3: no unit" in [row["reason"] for row in listed(seen)]


def test_poles_of_engine_and_taylor_are_listed_once_per_pair(seen: str) -> None:
    view = view_of(seen, "system-system_0")
    equilibrium = re.findall(r"Engine linearizations about “(.*?)”", view)[0]
    taylor, *engines = table_rows(view, f"Linearizations about {equilibrium}")
    assert taylor[1:] == ["-0.1 ± 3i", "3.0017 rad/s, damping ratio 0.03331"]
    assert engines[0][2:] == [
        *("2.5e-14", "3.5e-15", "–", "0", "2.0e-13", "0.999000"),
        *("-0.1 ± 3.0003i", "1.0e-04"),
    ]
    # The second model has none: its linearization failed.
    assert len(engines) == 2
    assert re.findall(r'class="reason">(.*?)</p>', view) == [
        "robot.urdf was not linearized. mujoco: it diverges"
    ]


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


def test_matrix_shows_worst_case_of_each_model_in_order(seen: str) -> None:
    matrix = seen.split('<table class="matrix')[1].split("</table>")[0]
    engines = re.findall(r'<th scope="col">(.*?)</th>', matrix)
    assert engines[1:3] == ["mujoco", "pybullet"]
    names = re.findall(r'<a href="#system-.*?">(.*?)</a>', matrix)
    assert names == ["unread", "system_0", "system_1"] or names[-1] == "system_1"
    assert matrix.count('<tr class="first">') == len(names)
    row = matrix_row(seen, "system_0")
    assert '<span class="file">mujoco.xml</span>' in row
    _, first, *_, last = re.split(r"<td", row)
    assert f'href="#{BEST}"' in first
    assert plain("<td" + first) == "≠ DIFFERS 1 of 3"
    assert "1 of 3 DIFFERS, 5.5 digits, error at dt 0.911\u00a0%, free worst" in first
    assert "not run" in last, "the unread folder's column has no case here"


def test_notes_of_an_engine_are_listed_once() -> None:
    """Ignore a limit that no motion reaches when comparing readings."""
    sample = results(2)
    note = AuditFinding(
        kind="default", subject=("motors",), message="motors are switched off", location=None,
        expected=None, actual=None, severity="note",
    )  # fmt: skip
    audit = (note, replace(note, kind="reach", message="x is limited"))
    models = tuple(replace(model, audit=audit) for model in sample.models)
    seen = render(replace(sample, models=models))
    notes = facts_of(seen.split('class="readings"')[1].split("</dl>")[0])
    assert set(notes.values()) == {"motors are switched off"}


def test_issue_names_the_cause_and_links_to_the_diagnosis(seen: str) -> None:
    (differs,) = [one for one in issues(seen) if "DIFFERS" in one]
    assert (
        "joint[x]@stiffness (mujoco.xml:21) is 38.25; the motion implies 39.5 ± 1e-09." in differs
    )
    assert f'<a href="#{DIAGNOSIS}">system_0/mujoco.xml [mujoco]</a>' in seen
    (absent,) = [one for one in issues(seen) if "ABSENT" in one]
    assert absent.endswith("1 case pybullet is not installed")


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
    seen = render(changed_model(results(1), 1, audit=(finding,)))
    (issue,) = issues(seen)
    assert "! AUDIT" in issue
    assert "m is 2 where 3 belongs" in issue
    assert [one[:2] for one in marked(seen, "diagnosis-system_0/robot.urdf/mujoco")] == [
        ("robot.urdf", "7")
    ]


def test_finding_about_a_whole_file_marks_no_line() -> None:
    finding = AuditFinding(
        kind="default",
        subject=("time step",),
        message="no time step is stated",
        location=SourceLine(file="/a/robot.urdf"),
        expected=None,
        actual=None,
        severity="finding",
    )
    page = render(changed_model(results(1), 1, audit=(finding,)))
    view = view_of(page, "diagnosis-system_0/robot.urdf/mujoco")
    assert table_rows(view, "Audit") == [["default", "no time step is stated", "robot.urdf"]]
    assert 'class="source"' not in view


def test_unexplained_difference_has_no_cause(troubled: Results) -> None:
    unexplained = replace(diagnosis_of(troubled), explained=False)
    sample = changed_model(troubled, 0, diagnosis=unexplained, audit=())
    view = view_of(render(sample), DIAGNOSIS)
    assert "Unexplained: the best single cause, joint[x]@stiffness," in view
    assert 'class="source"' not in view, "no line is blamed"


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
    page = render(sample)
    view, sentence = (
        view_of(page, DIAGNOSIS),
        (
            "No single cause or pair of causes explains the motions; start with the audit findings:"
            " mass is 9 where m = 0.9, and 1 more."
        ),
    )
    assert sentence in view
    assert any(sentence in issue for issue in issues(page))
    assert [one[:2] for one in marked(page, DIAGNOSIS)] == [("mujoco.xml", "21")]
    assert view.index("Audit findings") < view.index("Possible causes")


def test_line_of_cause_is_marked_in_context(seen: str) -> None:
    assert marked(seen, DIAGNOSIS) == [("mujoco.xml", "21", "<line n='21'/>")]
    lines = re.findall(r'<li.*?value="(\d+)"|class="(gap)"', view_of(seen, DIAGNOSIS))
    assert ["".join(one) for one in lines] == [*map(str, range(17, 26)), "gap"]


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
    assert [one[:2] for one in marked(render(sample), DIAGNOSIS)] == [("mujoco.xml.toml", "2")]


def test_changes_since_the_baseline_link_to_their_cases(seen: str) -> None:
    changes = seen.split('class="changes"')[1].split("</ul>")[0]
    assert plain(changes).endswith(
        "changed system_0/mujoco.xml/free [mujoco] it agreed to 11.9 digits"
    )
    assert re.findall(r'href="#(.*?)"', changes) == [BEST]
    assert 'id="changes"' not in render(results(1))


def test_equal_changes_of_several_cases_are_grouped() -> None:
    """Group new cases, which would otherwise repeat one sentence each."""
    sample = results(1)
    same = tuple(bare_diff(case.id, Status.NEW, ("not in it",)) for case in sample.cases[:2])
    sample = replace(sample, baseline=BaselineChanges(name="main", changes=same))
    changes = render(sample).split('class="changes"')[1].split("</ul>")[0]
    assert changes.count("<li>") == 1
    assert re.findall(r'href=".*?">(.*?)</a>', changes) == [str(c.id) for c in sample.cases[:2]]


def test_cost_of_the_step_is_one_sentence(seen: str) -> None:
    view = view_of(seen, "case-system_1/robot.urdf/mujoco/free")
    assert plain(view.split('class="cost">')[1].split("</p>")[0]) == (
        "At dt = 0.002 s, the error is 0.911 % of the amplitude over the whole motion:"
        " by the end the amplitude is -2.9 % off and the phase 0.068 rad early."
        " Time steps: dt for 1 %: 0.0021 s"
    ), "an unknown step is not shown"


def test_digits_use_worst_and_discrepancies_use_deciding_component() -> None:
    sample = results(1)
    verdict = sample.cases[0].verdict
    assert verdict is not None
    wide = replace(verdict, largest_discrepancy=2e-11, largest_uncertainty=4e-10)
    seen = render(changed_case(sample, 0, verdict=wide))
    row, of_it = listed_case(seen, BEST), facts_of(view_of(seen, BEST))
    assert (row["digits"], row["E"], row["U"]) == ("9.3", "7.1e-14", "1.0e-12")
    assert row["sorts"].split()[:3] == ["4e-10", "7.1e-14", "1.02e-12"]
    assert of_it["agreeing digits"] == "9.3"
    assert of_it["worst component"] == "q0"
    assert (of_it["largest E"], of_it["largest U"]) == ("2.0e-11", "4.0e-10")
    assert 'style="--digits: 9.3"' in matrix_row(seen, "system_0")


def test_cause_with_and_in_its_name_is_one_cause(troubled: Results) -> None:
    diagnosis = diagnosis_of(troubled)
    best = diagnosis.explanations[0]
    body = replace(best.causes[0], subject=("body[nut and bolt]@mass",), locations=())
    pair = (body, replace(best.causes[0], estimate=2.5))
    for causes in ((body,), pair):
        first = replace(best, causes=causes, tied_with=(body.id,))
        sample = changed_model(troubled, 0, diagnosis=replace(diagnosis, explanations=(first,)))
        view = view_of(render(sample), DIAGNOSIS)
        rows = table_rows(view, "Ranked hypotheses")
        names = ["body[nut and bolt]@mass", "and joint[x]@stiffness"][: len(causes)]
        assert [row[0] for row in rows] == names
        assert [row[1] for row in rows] == ["literal"] * len(causes)
        assert rows[0][-1] == "body[nut and bolt]@mass"
        assert view.split("</p>")[1].count("the motion implies") == len(causes)


def test_system_without_derivation_shows_its_declaration() -> None:
    sample = results(1)
    sample = replace(sample, systems=(replace(sample.systems[0], derivation=None),))
    view = view_of(render(sample), "system-system_0")
    assert "The equations of motion were not derived in this run." in view
    assert "Lagrangian" not in view
    assert "Engine linearizations about" in view
    assert "<h3>Linearization about" not in view
    assert table_rows(view, "Constants")[0][1] == "38.25"


def test_failed_audit_is_shown_next_to_its_file() -> None:
    sample = changed_model(results(1), 0, audit=None, audit_failure="the engine died")
    reason = '<p class="reason">mujoco.xml was not audited. mujoco: the engine died</p>'
    assert reason in view_of(render(sample), "system-system_0")


def test_agreeing_chaotic_motion_is_not_shown_as_a_fault() -> None:
    sample = results(1)
    full_run = sample.cases[0].full_run
    assert full_run is not None
    lost = replace(full_run, global_error=0.944, decomposition=None, resolved_until=3.5)
    seen = render(changed_case(sample, 0, full_run=lost))
    assert listed_case(seen, BEST)["error"] == "chaotic"
    cost = plain(view_of(seen, BEST).split('class="cost">')[1].split("</p>")[0])
    assert cost.startswith("The motion is chaotic: small differences grow")
    assert "here until 3.5 s" in cost
    assert "not a fault of the model" in cost
    assert "error at dt 0.911\u00a0%" in matrix_row(seen, "system_0"), "of the other scenarios"
    outliers = facts_of(seen.split('class="standing"')[1].split("</dl>")[0]).values()
    assert [one.rsplit(maxsplit=2)[0] for one in outliers] == ["11.9", "0.911 %", "1"]
    differs = replace(sample.cases[0], outcome=Outcome.DIFFERS, full_run=lost)
    seen = render(replace(sample, cases=(differs, *sample.cases[1:])))
    assert listed_case(seen, BEST)["error"] == "94.4 %", "no excuse for what differs"
