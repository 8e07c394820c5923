"""The packed numbers and charts that the page draws."""

import base64
import gzip
import json
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.render.html.view import Content
from physics_crosscheck.records import Results
from tests.report.samples import LITERAL, array, changed_case, changed_model, results, series_of


def unpacked(text: str) -> Any:
    return json.loads(gzip.decompress(base64.b64decode(text)))


def unpacked_packs(run: Results) -> dict[str, Any]:
    content = Content(run)
    return {name: unpacked(content.text(name)) for name in content.names}


@pytest.fixture(scope="module")
def packs(troubled: Results) -> dict[str, Any]:
    return unpacked_packs(troubled)


def column(packs: dict[str, Any], pack_name: str, reference: Any) -> Any:
    pack, key = reference if isinstance(reference, list) else (pack_name, reference)
    values = packs[pack]["columns"][key]
    return np.array([np.nan if value is None else value for value in values])


def chart(packs: dict[str, Any], pack_name: str, title: str) -> Any:
    return next(chart for chart in packs[pack_name]["charts"] if chart["title"].startswith(title))


def curves(packs: dict[str, Any], pack_name: str, title: str) -> dict[str, Any]:
    """(x, y) of each curve of a chart, by its role and place."""
    return {
        f"{c['role']} {c['place']}": (
            column(packs, pack_name, c["x"]),
            column(packs, pack_name, c["y"]),
        )
        for c in chart(packs, pack_name, title)["curves"]
    }


def test_charts_of_case_have_its_series(packs: dict[str, Any], troubled: Results) -> None:
    series = series_of(troubled.cases[0])
    motion = curves(packs, "pack-case-0", "q0: reference")
    errors = curves(packs, "pack-case-0", "q0: error against")
    energy = curves(packs, "pack-case-0", "Energy")
    convergence = curves(packs, "pack-case-0", "Convergence")
    work_curves = curves(packs, "pack-case-0", "Work")
    size = np.max(np.abs(array(series.reference[0])))
    assert series.energy is not None
    assert series.convergence is not None
    held, supplied, dissipated = (
        array(row) for row in (series.energy.held, series.energy.supplied, series.energy.dissipated)
    )
    assert series.full_runs.h == (0.002, 0.001, 0.004)  # lines start at the coarsest
    h, error, seconds = (
        array(row)[[2, 0, 1]]
        for row in (series.full_runs.h, series.full_runs.error, series.full_runs.seconds)
    )
    for curve, x, y in (
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
        (work_curves["full_run 0"], seconds, error),
    ):
        expected = np.array(y, dtype=float)
        size = np.max(np.abs(expected))
        np.testing.assert_allclose(curve[0], np.array(x, dtype=float), rtol=1e-5)
        np.testing.assert_allclose(curve[1], expected, rtol=2e-4, atol=1e-6 * size)


def test_other_engines_of_the_scenario_are_overlaid(
    packs: dict[str, Any], troubled: Results
) -> None:
    motion = curves(packs, "pack-case-9", "q1: reference")
    others = [i for i in (12, 15) if troubled.cases[i].scenario == "free"]
    assert len(others) == 2
    for place, i in enumerate(others):
        expected = array(series_of(troubled.cases[i]).engine[1])
        np.testing.assert_allclose(motion[f"other {place}"][1], expected)
    assert f"other {len(others)}" not in motion


def test_numbers_of_another_case_are_not_stored_twice(packs: dict[str, Any]) -> None:
    reference = chart(packs, "pack-case-9", "q1: reference")["curves"][1]["y"]
    assert reference[0] == "pack-case-12"


def test_relative_errors_have_a_minimum_amplitude() -> None:
    sample = results(1)
    still = series_of(sample.cases[0])
    reference = tuple((0.0,) * len(row) for row in still.reference)
    error = ((*still.error[0][:5], 0.02, *still.error[0][6:]), *still.error[1:])
    sample = changed_case(sample, 0, series=replace(still, reference=reference, error=error))
    packs = unpacked_packs(sample)
    # FLOOR is one per cent of the other scenarios' amplitude of one.
    drawn = curves(packs, "pack-case-0", "q0: error against")["global_error 0"][1]
    assert drawn[5] == pytest.approx(0.02 / 0.01, rel=1e-3)


def test_diverged_motion_does_not_hide_the_reference(packs: dict[str, Any]) -> None:
    limits = chart(packs, "pack-case-4", "q0: reference")["y_limits"]
    assert limits is not None
    assert max(np.abs(limits)) < 5
    assert chart(packs, "pack-case-0", "q0: reference")["y_limits"] is None
    engine = curves(packs, "pack-case-4", "q0: reference")["engine 0"][1]
    assert np.isfinite(engine[:80]).all()
    assert np.isnan(engine[100:]).all()


def test_every_chart_has_a_summary_with_numbers_and_units(packs: dict[str, Any]) -> None:
    charts = [chart for pack in packs.values() for chart in pack["charts"]]
    assert len(charts) > 100
    for each in charts:
        assert any(c.isdigit() for c in each["summary"])
        assert "nan" not in each["summary"]
        assert "[" in each["x_label"] or each["names"]
    labels = {c["label"] for c in chart(packs, "pack-case-9", "Convergence")["curves"]}
    assert "slope 1.00 (observed)" in labels


def test_linear_charts_compare_engine_and_transfer_function(packs: dict[str, Any]) -> None:
    response = curves(packs, "pack-case-9", "Frequency response")
    for role in ("transfer", "response"):
        for place in (0, 1):
            np.testing.assert_allclose(response[f"{role} {place}"], ([1, 2], [1, 2]))
    error_curve = curves(packs, "pack-case-9", "Linear against nonlinear")["reach 0"]
    np.testing.assert_allclose(error_curve, ([0.01, 0.1, 1.0], [1e-5, 1e-3, 0.1]))


def test_diagnosis_shows_ranking_and_corrected_motion(
    packs: dict[str, Any], troubled: Results
) -> None:
    (pack_name,) = (name for name in packs if name.startswith("pack-diagnosis"))
    ranking = chart(packs, pack_name, "Ranked")
    assert ranking["names"] == ["mass", "k", "joint[x]@stiffness"]
    residuals, rows = curves(packs, pack_name, "Ranked")["lollipop 0"]
    np.testing.assert_allclose(residuals, [1e-10, 1.1e-10, 0.4])
    np.testing.assert_allclose(rows, [2.5, 1.5, 0.5])
    drawn = curves(packs, pack_name, "free: q0, corrected")
    series = series_of(troubled.cases[0])
    np.testing.assert_allclose(drawn["reference 0"][1], array(series.reference[0]))
    np.testing.assert_allclose(drawn["corrected 0"][1], array(series.engine[0]))
    # The sample's corrected motion equals the engine's, so the residual is zero.
    text = chart(packs, pack_name, "free: q0, corrected")["summary"]
    assert "k = 39.5 by 0" in text or "e-" in text.split("39.5 by ")[1][:8]
    defects = curves(packs, pack_name, "free: defects")
    np.testing.assert_allclose(defects["before 0"][1], 3.1e-6)
    np.testing.assert_allclose(defects["after 0"][1], 2e-14)


def test_system_without_sketch_has_no_motion(packs: dict[str, Any]) -> None:
    assert packs["pack-case-0"]["motion"]["system"] == "pack-system-0"
    assert packs["pack-case-9"]["motion"] is None


def test_run_without_energies_and_times_is_drawn() -> None:
    sample = results(1)
    for place, case in enumerate(sample.cases):
        series = series_of(case)
        full_runs = replace(series.full_runs, seconds=(None, None, None))
        series = replace(series, energy=None, full_runs=full_runs)
        sample = changed_case(sample, place, series=series)
    packs = unpacked_packs(sample)
    titles = [one["title"] for one in packs["pack-case-0"]["charts"]]
    assert "Convergence" in titles
    assert not [title for title in titles if title.startswith(("Energy", "Work"))]


def test_cause_with_and_in_its_name_is_one_row(troubled: Results) -> None:
    diagnosis = troubled.models[0].diagnosis
    assert diagnosis is not None
    assert diagnosis.corrected is not None
    first = diagnosis.explanations[0]
    body = "body[nut and bolt]@mass"
    cause = replace(first.causes[0], subject=(body,))
    other = replace(first.causes[0], subject=LITERAL.subject, estimate=2.5)
    sample = changed_model(
        troubled,
        0,
        diagnosis=replace(
            diagnosis,
            explanations=(replace(first, causes=(cause,)), *diagnosis.explanations[1:]),
            corrected=replace(diagnosis.corrected, causes=(cause, other)),
        ),
    )
    packs = unpacked_packs(sample)
    (pack_name,) = (name for name in packs if name.startswith("pack-diagnosis"))
    assert chart(packs, pack_name, "Ranked")["names"] == ["mass", "k", body]
    assert len(curves(packs, pack_name, "Ranked")["lollipop 0"][0]) == 3
    labels = [c["label"] for c in chart(packs, pack_name, "free: q0, corrected")["curves"]]
    assert labels[1] == f"equations with {body} = 39.5 and joint[x]@stiffness = 2.5"


def test_leading_plot_shows_the_deciding_component(troubled: Results) -> None:
    verdict = troubled.cases[9].verdict
    assert verdict is not None
    sample = changed_case(troubled, 9, verdict=replace(verdict, component="q1_dot"))
    packs = unpacked_packs(sample)
    leading = [one["title"] for one in packs["pack-case-9"]["charts"] if one["lead"]]
    assert leading == ["q1: reference and engines", "q1_dot: error against uncertainty"]
