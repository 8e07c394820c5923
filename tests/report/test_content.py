"""The packed numbers and charts: what the page draws."""

from __future__ import annotations

import base64
import gzip
import json
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html.view import Content
from tests.report.samples import LITERAL, array, changed_case, changed_model, results, series_of


def unpacked(text: str) -> Any:
    return json.loads(gzip.decompress(base64.b64decode(text)))


@pytest.fixture(scope="module")
def packs(troubled: Results) -> dict[str, Any]:
    return {name: unpacked(text) for name, text in Content(troubled).packs().items()}


def column(packs: dict[str, Any], own: str, reference: Any) -> Any:
    pack, key = reference if isinstance(reference, list) else (own, reference)
    values = packs[pack]["columns"][key]
    return np.array([np.nan if value is None else value for value in values])


def chart(packs: dict[str, Any], own: str, title: str) -> Any:
    return next(chart for chart in packs[own]["charts"] if chart["title"].startswith(title))


def curves(packs: dict[str, Any], own: str, title: str) -> dict[str, Any]:
    """(x, y) of each curve of a chart, by its role and place."""
    return {
        f"{c['role']} {c['place']}": (column(packs, own, c["x"]), column(packs, own, c["y"]))
        for c in chart(packs, own, title)["curves"]
    }


def test_the_charts_of_a_case_hold_its_series(packs: dict[str, Any], troubled: Results) -> None:
    series = series_of(troubled.cases[0])
    motion = curves(packs, "pack-case-0", "q0: reference")
    errors = curves(packs, "pack-case-0", "q0: error against")
    energy = curves(packs, "pack-case-0", "Energy")
    convergence = curves(packs, "pack-case-0", "Convergence")
    work = curves(packs, "pack-case-0", "Work")
    size = np.max(np.abs(array(series.reference[0])))
    assert series.energy is not None
    assert series.convergence is not None
    held, supplied, dissipated = (
        array(row) for row in (series.energy.held, series.energy.supplied, series.energy.dissipated)
    )
    assert series.full_runs.h == (0.002, 0.001, 0.004)  # lines go from the coarsest on
    h, error, seconds = (
        array(row)[[2, 0, 1]]
        for row in (series.full_runs.h, series.full_runs.error, series.full_runs.seconds)
    )
    for found, x, y in (
        (motion["reference 0"], series.t, series.reference[0]),
        (motion["engine 0"], series.t, series.engine[0]),
        (errors["global_error 0"], series.t, array(series.error[0]) / size),
        (errors["defect 0"], series.segment_t, series.defect[0]),
        (errors["band 0"], series.segment_t, series.defect_uncertainty[0]),
        (energy["share 0"], series.t, series.energy.held),
        (energy["share 3"], series.t, held - supplied + dissipated),
        (convergence["rungs 0"], series.convergence.h, series.convergence.defect),
        (convergence["increments 0"], series.convergence.h[1:], series.convergence.increments),
        (convergence["full_run 0"], h, error),
        (convergence["target 0"], (0.0021,), (0.01,)),
        (work["full_run 0"], seconds, error),
    ):
        expected = np.array(y, dtype=float)
        size = np.max(np.abs(expected))
        np.testing.assert_allclose(found[0], np.array(x, dtype=float), rtol=1e-5)
        np.testing.assert_allclose(found[1], expected, rtol=2e-4, atol=1e-6 * size)


def test_every_other_engine_of_the_scenario_lies_over_the_case(
    packs: dict[str, Any], troubled: Results
) -> None:
    motion = curves(packs, "pack-case-9", "q1: reference")
    others = [i for i in (12, 15) if troubled.cases[i].scenario == "free"]
    assert len(others) == 2
    for place, i in enumerate(others):
        expected = array(series_of(troubled.cases[i]).engine[1])
        np.testing.assert_allclose(motion[f"other {place}"][1], expected)
    assert f"other {len(others)}" not in motion


def test_the_numbers_of_another_case_are_not_stored_twice(packs: dict[str, Any]) -> None:
    reference = chart(packs, "pack-case-9", "q1: reference")["curves"][1]["y"]
    assert reference[0] == "pack-case-12"


def test_global_errors_are_relative_to_no_less_than_a_share_of_the_largest_amplitude() -> None:
    found = results(1)
    still = series_of(found.cases[0])
    reference = tuple((0.0,) * len(row) for row in still.reference)
    error = ((*still.error[0][:5], 0.02, *still.error[0][6:]), *still.error[1:])
    found = changed_case(found, 0, series=replace(still, reference=reference, error=error))
    packs = {name: unpacked(text) for name, text in Content(found).packs().items()}
    # FLOOR is one per cent of the other scenarios' amplitude of one.
    drawn = curves(packs, "pack-case-0", "q0: error against")["global_error 0"][1]
    assert drawn[5] == pytest.approx(0.02 / 0.01, rel=1e-3)


def test_a_motion_that_blew_up_does_not_hide_the_reference(packs: dict[str, Any]) -> None:
    limits = chart(packs, "pack-case-4", "q0: reference")["y_limits"]
    assert limits is not None
    assert max(np.abs(limits)) < 5
    assert chart(packs, "pack-case-0", "q0: reference")["y_limits"] is None
    engine = curves(packs, "pack-case-4", "q0: reference")["engine 0"][1]
    assert np.isfinite(engine[:80]).all()
    assert np.isnan(engine[100:]).all()


def test_every_chart_is_told_in_words_with_numbers_and_units(packs: dict[str, Any]) -> None:
    charts = [chart for pack in packs.values() for chart in pack["charts"]]
    assert len(charts) > 100
    for one in charts:
        assert any(c.isdigit() for c in one["summary"])
        assert "nan" not in one["summary"]
        assert "[" in one["x_label"] or one["names"]
    labels = {c["label"] for c in chart(packs, "pack-case-9", "Convergence")["curves"]}
    assert "slope 1.00 (observed)" in labels


def test_linear_charts_show_engine_over_transfer_function_and_error_over_amplitude(
    packs: dict[str, Any],
) -> None:
    response = curves(packs, "pack-case-9", "Frequency response")
    for role in ("transfer", "response"):
        for place in (0, 1):
            np.testing.assert_allclose(response[f"{role} {place}"], ([1, 2], [1, 2]))
    reach = curves(packs, "pack-case-9", "Linear against nonlinear")["reach 0"]
    np.testing.assert_allclose(reach, ([0.01, 0.1, 1.0], [1e-5, 1e-3, 0.1]))


def test_the_diagnosis_shows_the_ranking_and_the_motion_corrected(
    packs: dict[str, Any], troubled: Results
) -> None:
    (own,) = (name for name in packs if name.startswith("pack-diagnosis"))
    ranking = chart(packs, own, "Ranked")
    assert ranking["names"] == ["mass", "k", "joint[x]@stiffness"]
    left, rows = curves(packs, own, "Ranked")["lollipop 0"]
    np.testing.assert_allclose(left, [1e-10, 1.1e-10, 0.4])
    np.testing.assert_allclose(rows, [2.5, 1.5, 0.5])
    drawn = curves(packs, own, "free: q0, corrected")
    series = series_of(troubled.cases[0])
    np.testing.assert_allclose(drawn["reference 0"][1], array(series.reference[0]))
    np.testing.assert_allclose(drawn["corrected 0"][1], array(series.engine[0]))
    # The sample's corrected motion is the engine's: nothing is left.
    told = chart(packs, own, "free: q0, corrected")["summary"]
    assert "k = 39.5 by 0" in told or "e-" in told.split("39.5 by ")[1][:8]
    defects = curves(packs, own, "free: defects")
    np.testing.assert_allclose(defects["before 0"][1], 3.1e-6)
    np.testing.assert_allclose(defects["after 0"][1], 2e-14)


def test_a_system_without_a_sketch_has_no_motion(packs: dict[str, Any]) -> None:
    assert packs["pack-case-0"]["motion"]["system"] == "pack-system-0"
    assert packs["pack-case-9"]["motion"] is None


def test_a_run_without_energies_and_times_is_drawn_without_them() -> None:
    found = results(1)
    for place, case in enumerate(found.cases):
        series = series_of(case)
        full_runs = replace(series.full_runs, seconds=(None, None, None))
        series = replace(series, energy=None, full_runs=full_runs)
        found = changed_case(found, place, series=series)
    packs = {name: unpacked(text) for name, text in Content(found).packs().items()}
    titles = [one["title"] for one in packs["pack-case-0"]["charts"]]
    assert "Convergence" in titles
    assert not [title for title in titles if title.startswith(("Energy", "Work"))]


def test_a_cause_whose_name_has_an_and_in_it_is_one_row_of_the_ranking(troubled: Results) -> None:
    diagnosis = troubled.models[0].diagnosis
    assert diagnosis is not None
    assert diagnosis.corrected is not None
    first = diagnosis.explanations[0]
    body = "body[nut and bolt]@mass"
    cause = replace(first.causes[0], subject=(body,))
    other = replace(first.causes[0], subject=LITERAL.subject, estimate=2.5)
    found = changed_model(
        troubled,
        0,
        diagnosis=replace(
            diagnosis,
            explanations=(replace(first, causes=(cause,)), *diagnosis.explanations[1:]),
            corrected=replace(diagnosis.corrected, causes=(cause, other)),
        ),
    )
    packs = {name: unpacked(text) for name, text in Content(found).packs().items()}
    (own,) = (name for name in packs if name.startswith("pack-diagnosis"))
    assert chart(packs, own, "Ranked")["names"] == ["mass", "k", body]
    assert len(curves(packs, own, "Ranked")["lollipop 0"][0]) == 3
    labels = [c["label"] for c in chart(packs, own, "free: q0, corrected")["curves"]]
    assert labels[1] == f"equations with {body} = 39.5 and joint[x]@stiffness = 2.5"


def test_the_plot_that_tells_is_that_of_the_component_that_decides(troubled: Results) -> None:
    verdict = troubled.cases[9].verdict
    assert verdict is not None
    found = changed_case(troubled, 9, verdict=replace(verdict, component="q1_dot"))
    packs = {name: unpacked(text) for name, text in Content(found).packs().items()}
    leading = [one["title"] for one in packs["pack-case-9"]["charts"] if one["lead"]]
    assert leading == ["q1: reference and engines", "q1_dot: error against uncertainty"]
