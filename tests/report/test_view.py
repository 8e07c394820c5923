"""What the report shows, before it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from harness.report.charts import amplitudes, charts
from harness.report.text import agreeing_digits, equation, percent, shown, slug
from harness.report.view import Report, report
from tests.report.samples import case, results


@pytest.fixture(scope="module")
def seen(troubled: dict[str, Any]) -> Report:
    return report(troubled)


def facts(view: Any) -> dict[str, str]:
    return {what: value for _, rows in view.facts for what, value in rows}


def test_every_case_is_shown_once_with_an_id_of_its_own(
    seen: Report, troubled: dict[str, Any]
) -> None:
    ids = [case.id for case in seen.cases]
    assert len(ids) == len(set(ids)) == len(troubled["cases"])


def test_two_folders_with_systems_and_models_of_the_same_name_are_told_apart() -> None:
    found = results(1)
    for kind in ("systems", "models", "cases"):
        found[kind] += [{**one, "folder": "/elsewhere"} for one in found[kind]]
    seen = report(found)
    assert len({case.id for case in seen.cases}) == len(found["cases"])
    assert [group.name for group in seen.groups] == [
        "system_0 in /models/system_0",
        "system_0 in /elsewhere",
    ]
    assert len({group.id for group in seen.groups}) == 2


def test_a_case_recorded_twice_is_shown_twice() -> None:
    found = results(1)
    found["cases"].append(found["cases"][0])
    assert len({case.id for case in report(found).cases}) == len(found["cases"])


def test_digits_of_agreement_are_rounded_down_from_the_larger_of_both() -> None:
    assert agreeing_digits(7.1e-14, 1.02e-12) == "11.9"
    assert agreeing_digits(1e-3, 1e-12) == "3.0"
    assert agreeing_digits(5.0, 1e-12) == "0.0"
    assert agreeing_digits(0.0, 0.0) == "all"
    assert agreeing_digits(1e-3, None) == "–"


def test_the_facts_of_a_case_are_those_of_its_record(seen: Report) -> None:
    view = seen.cases[-2]
    assert (view.digits, view.discrepancy, view.uncertainty) == ("11.9", "7.1e-14", "1.0e-12")
    told = {what: value.replace("\u00a0", " ") for what, value in facts(view).items()}
    assert told["raw error"] == "0.911 %"
    assert told["order in h"] == "1.002 seen, 1 claimed"
    assert told["1 % error at"] == "0.0021 s"
    assert told["0.1 % error at"] == "–"
    assert told["checked by a run"] == "0.957 % at 0.0021 s, 1 % foretold"
    assert told["phase, at the end"] == "-0.068 rad"
    assert told["constraint drift"] == "0 (engine units)"
    assert told["engine steps for the limits"] == "48\u202f185"
    assert told["integrator"] == "euler"
    assert told["f"] == "sin(t)"


def test_what_needs_a_look_comes_worst_first_and_absences_in_one_line(seen: Report) -> None:
    outcomes = [case.outcome for case in seen.troubled]
    assert outcomes == ["FAILED", "FAILED", "FAILED", "DIFFERS", "UNRESOLVED"]
    assert seen.absences == ((1, "pybullet is not installed"),)
    assert seen.absent == ("pybullet",)


def test_a_case_without_numbers_shows_none(seen: Report) -> None:
    absent = seen.cases[2]
    assert (absent.outcome, absent.digits, absent.discrepancy, absent.raw_error) == (
        "ABSENT",
        *"–––",
    )
    assert not absent.judged
    assert absent.charts == ()


def test_a_failed_case_claims_no_digits_though_its_segments_agreed(seen: Report) -> None:
    blown_up = seen.cases[4]
    assert blown_up.discrepancy == "7.1e-14"
    assert blown_up.digits == "–"
    assert not blown_up.judged


def test_a_folder_that_could_not_be_read_is_a_group_of_its_own(seen: Report) -> None:
    group = seen.groups[-1]
    assert group.name == "unread"
    assert group.about is None
    assert [cell.reason for row in group.rows for cell in row.cells if cell] == [
        "/models/unread/system.py: line 3: no unit"
    ]


def test_a_scenario_that_did_not_run_in_one_engine_leaves_a_gap_in_the_matrix() -> None:
    found = results(1)
    del found["cases"][1]
    rows = report(found).groups[0].rows
    assert [cell is None for cell in rows[0].cells] == [False, True, False]
    assert all(cell is not None for row in rows[1:] for cell in row.cells)


def test_the_engines_poles_stand_beside_taylors_one_of_each_pair(seen: Report) -> None:
    about = seen.groups[0].about
    assert about is not None
    linear = about.linearizations[0]
    assert linear.poles == (("-0.1 ± 3i", "3.0017 rad/s, damping ratio 0.03331"),)
    assert linear.twins[0].errors == ("2.5e-14", "3.5e-15", "–", "0")
    assert linear.twins[0].poles == (("-0.1 ± 3.0003i", "1.0e-04"),)
    # The second model has none: its linearization failed.
    assert len(linear.twins) == 2
    assert [file.reasons for file in about.files] == [(), ("mujoco: it diverges",)]


def test_results_without_any_case_make_a_report() -> None:
    nothing = results(0)
    assert report(nothing).cases == ()


def test_equations_lose_their_wrapping_at_the_outer_comma() -> None:
    assert equation("Eq(m*a, f*max(0, 1) - k*q)") == "m*a = f*max(0, 1) - k*q"
    assert equation("a + b") == "a + b"


def test_small_shares_are_written_with_an_exponent() -> None:
    assert percent(0.00911) == "0.911\u00a0%"
    assert percent(3e-9) == "3.0e-09"
    assert percent(1.5e19) == "1.5e+19"


def test_characters_that_would_change_the_text_around_them_are_made_visible() -> None:
    assert shown("a\x1b[31mb\x00") == "a␛[31mb␀"
    assert shown("a\u202eb") == "a⟨U+202E⟩b"
    assert shown("\ud800") == "⟨U+D800⟩"
    assert shown("θ ± שלום\n") == "θ ± שלום\n"


def test_different_names_have_different_slugs_of_harmless_characters() -> None:
    names = ["a/b", "a b", "a~2f~b", "a<b", "ab", "a\u202eb", "a=b", "a~~b"]
    slugs = [slug(name) for name in names]
    assert len(set(slugs)) == len(names)
    assert all(set(s) <= set("abcdef0123456789~") for s in slugs)
    assert slug("a", "b") != slug("a/b")
    assert (
        slug("drum_pendulum", "mujoco.xml", "mujoco", "free")
        == "drum_pendulum/mujoco.xml/mujoco/free"
    )


def test_raw_errors_are_relative_to_no_less_than_a_share_of_the_largest_amplitude() -> None:
    moving, still = (case("s", "m.xml", "mujoco", name, 1) for name in ("moving", "still"))
    still["series"]["reference"] = [[0.0] * len(row) for row in still["series"]["reference"]]
    still["series"]["error"][0][5] = 0.02
    reach = amplitudes([moving, still])["/models/s"]
    assert reach == pytest.approx([1.0, 1.0], abs=1e-3)
    raw = next(c for c in charts(still, ["m", "m/s"], reach)[1].curves if c.role == "raw")
    # FLOOR is one per cent of the other scenario's amplitude of one.
    assert raw.y[5] == pytest.approx(0.02 / 0.01, rel=1e-3)


def test_a_motion_that_blew_up_does_not_hide_the_reference(seen: Report) -> None:
    blown_up, sound = seen.cases[4].charts[0], seen.cases[0].charts[0]
    assert blown_up.y_limits is not None
    assert max(np.abs(blown_up.y_limits)) < 5
    assert sound.y_limits is None


def test_every_chart_is_told_in_words_with_numbers_and_units(seen: Report) -> None:
    for view in seen.cases:
        for chart in view.charts:
            assert any(c.isdigit() for c in chart.summary)
            assert "nan" not in chart.summary
            assert "[" in chart.x_label
    motion, errors, convergence = seen.cases[-4].charts[-3:]
    assert motion.y_label == "q1 [m]"
    assert errors.log_y
    assert convergence.log_x
    assert "slope 1.00 (observed)" in {curve.label for curve in convergence.curves}
