"""Results and trajectories: columns, differences, tables, plots and their form in a notebook."""

import importlib.util
import math
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from physics_crosscheck import CheckResults, MotionError, Trajectory
from physics_crosscheck.harness.interfaces.notebook.markup import GROUNDS
from physics_crosscheck.harness.interfaces.notebook.optional import MissingPackageError
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.report import samples


def trajectory(t: Array, values: Array, uncertainty: Array | None = None) -> Trajectory:
    return Trajectory(
        t=np.array(t),
        names=("x", "x_dot", "share"),
        units=("m", "m/s", "1"),
        values=values,
        uncertainty=uncertainty,
        system="<cart>",
        scenario="free",
        origin="an engine & a step",
        step=0.1,
    )


def grid(count: int, step: float) -> Array:
    return step * np.arange(count, dtype=np.float64)


def moving(t: Array) -> Array:
    return np.stack([np.sin(t), np.cos(t), 0 * t + 1], axis=1)


def without(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Make packages appear not installed."""
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *_: None if name in packages else find_spec(name)
    )


@pytest.fixture
def pyplot() -> Iterator[Any]:
    pytest.importorskip("matplotlib").use("Agg")
    import matplotlib.pyplot as plt

    yield plt
    plt.close("all")


def test_columns_have_names_units_labels_and_are_read_only() -> None:
    motion = trajectory(grid(5, 0.1), moving(grid(5, 0.1)))
    assert len(motion) == 5
    assert np.array_equal(motion["x_dot"], np.cos(motion.t))
    assert [motion.label(name) for name in motion.names] == ["x (m)", "x_dot (m/s)", "share"]
    with pytest.raises(KeyError, match="there is no 'y'; there are x, x_dot, share"):
        motion["y"]
    with pytest.raises(ValueError, match="read-only"):
        motion["x"][0] = 1.0
    with pytest.raises(ValueError, match="no error bound is known of an engine"):
        motion.uncertainty_of("x")


def test_difference_uses_common_times() -> None:
    coarse, fine = grid(6, 0.1), grid(21, 0.025)
    bounds = np.full((21, 3), 1e-9)
    off = np.array([0.5, 0.0, -0.25])
    errors = trajectory(coarse, moving(coarse) + off) - trajectory(fine, moving(fine), bounds)
    assert np.allclose(errors.t, coarse)
    assert np.allclose(errors.values, [[0.5, 0.0, -0.25]] * 6, atol=1e-15)
    assert np.array_equal(errors.uncertainty_of("x"), np.full(6, 1e-9))
    rough = trajectory(coarse, moving(coarse), 2 * bounds[:6])
    back = trajectory(fine, moving(fine), bounds).minus(rough)
    assert np.allclose(back.t, coarse)
    assert np.allclose(back.uncertainty_of("x"), 3e-9, rtol=1e-12, atol=0)


def test_difference_of_other_times_or_quantities_is_rejected() -> None:
    motion = trajectory(grid(5, 0.1), moving(grid(5, 0.1)))
    shifted = trajectory(grid(5, 0.1) + 0.03, moving(grid(5, 0.1)))
    with pytest.raises(MotionError, match=r"share 0 times; .*times=simulated.t"):
        motion - shifted
    other = Trajectory(
        t=motion.t, names=("y", "y_dot", "share"), units=motion.units, values=motion.values,
        uncertainty=None, system="lift", scenario="free", origin="", step=None,
    )  # fmt: skip
    with pytest.raises(MotionError, match=r"x \(m\).* of <cart>, and y \(m\).* of lift"):
        motion - other
    with pytest.raises(TypeError):
        motion - 1.0  # type: ignore[operator]


def test_pandas_table_has_units_in_headings() -> None:
    pytest.importorskip("pandas")
    t = grid(4, 0.5)
    frame = trajectory(t, moving(t)).to_frame()
    assert list(frame.columns) == ["t (s)", "x (m)", "x_dot (m/s)", "share"]
    assert np.array_equal(frame["x (m)"].to_numpy(), np.sin(t))
    with_bounds = trajectory(t, moving(t), np.full((4, 3), 1e-9)).to_frame("pandas")
    assert list(with_bounds.columns)[4:] == [
        "x uncertainty (m)", "x_dot uncertainty (m/s)", "share uncertainty",
    ]  # fmt: skip
    assert (with_bounds["x uncertainty (m)"] == 1e-9).all()


def test_polars_table_is_made_on_request() -> None:
    polars = pytest.importorskip("polars")
    t = grid(4, 0.5)
    frame = trajectory(t, moving(t)).to_frame("polars")
    assert isinstance(frame, polars.DataFrame)
    assert frame["x_dot (m/s)"].to_list() == np.cos(t).tolist()


def test_missing_package_is_reported_with_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = trajectory(grid(4, 0.5), moving(grid(4, 0.5)))
    with pytest.raises(ValueError, match="'arrow'; pandas and polars are known"):
        motion.to_frame("arrow")
    without(monkeypatch, "pandas", "polars", "matplotlib")
    with pytest.raises(MissingPackageError, match=r"pandas or polars.*\[notebook\]'") as error:
        motion.to_frame()
    assert isinstance(error.value, ImportError)
    with pytest.raises(MissingPackageError, match="polars is not installed: pip install polars"):
        motion.to_frame("polars")
    with pytest.raises(MissingPackageError, match=r"needs matplotlib.*\[notebook\]'"):
        motion.plot()


def test_columns_of_one_unit_share_a_labelled_panel(pyplot: Any) -> None:
    t = grid(50, 0.1)
    motion = trajectory(t, moving(t), np.full((50, 3), 0.1))
    axes: Any = motion.plot()
    assert [ax.get_ylabel() for ax in axes] == ["x (m)", "x_dot (m/s)", "share"]
    assert axes[-1].get_xlabel() == "t (s)"
    assert "<cart>, free: an engine & a step" in axes[0].get_title()
    assert np.array_equal(axes[0].lines[0].get_ydata(), np.sin(t))
    # The uncertainty is a band around it.
    (band,) = axes[0].collections
    (path,) = band.get_paths()
    assert path.vertices[:, 1].max() == pytest.approx(np.sin(t).max() + 0.1)
    _, ax = pyplot.subplots()
    assert motion.plot("x", "x_dot", ax=ax) == (ax,)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["x (m)", "x_dot (m/s)"]
    with pytest.raises(KeyError, match="there is no 'y'"):
        motion.plot("y")


def points(html: str) -> list[Array]:
    """Return the curves of a page, each (n, 2)."""
    drawn = re.findall(r'<polyline points="([^"]*)"', html)
    return [np.array([[float(x) for x in p.split(",")] for p in curve.split()]) for curve in drawn]


def test_notebook_shows_one_row_and_curve_per_column_with_names_escaped() -> None:
    t = grid(5001, 0.01)
    values = moving(t)
    values[3000, 0] = 1.5  # a peak of one sample stays in the curve
    html = trajectory(t, values, np.full((5001, 3), 1e-9))._repr_html_()
    ElementTree.fromstring(html)
    assert "&lt;cart&gt;, free" in html
    assert "an engine &amp; a step; 5001 times to 50 s" in html
    for label in ("x (m)", "x_dot (m/s)", "share", "known to", "1.0e-09"):
        assert label in html
    x, _, still = points(html)
    assert len(x) < 400
    peak = x[np.argmin(x[:, 1])]
    assert peak[1] == pytest.approx(3.0)
    assert peak[0] == pytest.approx(2 + 236 * 0.6, abs=0.1)
    # A column that is constant within its uncertainty is drawn as a flat line.
    assert np.ptp(still[:, 1]) == 0
    assert "<script" not in html


def test_diverged_motion_is_shown_up_to_its_last_finite_value() -> None:
    t = grid(11, 0.1)
    values = moving(t)
    values[6:] = np.nan
    html = trajectory(t, values)._repr_html_()
    assert "not finite from t = 0.6 s on" in html
    assert len(points(html)[0]) == 6
    nothing = trajectory(t, np.full((11, 3), np.nan))._repr_html_()
    assert points(nothing) == []


@pytest.fixture
def mixed() -> CheckResults:
    return CheckResults(**msgspec.structs.asdict(samples.mixed()))


def test_table_has_one_row_per_case(mixed: CheckResults) -> None:
    pytest.importorskip("pandas")
    frame = mixed.to_frame()
    assert len(frame) == len(mixed.cases)
    for row, case in zip(frame.to_dict("records"), mixed.cases, strict=True):
        assert [row[k] for k in ("system", "model", "engine", "scenario", "outcome")] == [
            case.system, case.model, case.engine, case.scenario, case.outcome,
        ]  # fmt: skip
        if case.verdict is None or case.full_run is None:
            assert math.isnan(row["discrepancy"])
            assert math.isnan(row["global error"])
            continue
        assert row["discrepancy"] == case.verdict.discrepancy
        assert row["step (s)"] == case.full_run.time_step
        assert row["component"] == case.verdict.component
        wanted = next(one.step for one in case.full_run.steps_for if one.target == 0.001)
        assert row["step for 0.1 % (s)"] == wanted or wanted is None
    assert frame["discrepancy"].dtype == np.float64
    assert frame["reason"].str.contains("exponents").any()


def test_empty_table_has_the_same_columns(mixed: CheckResults) -> None:
    pytest.importorskip("pandas")
    nothing = msgspec.structs.replace(mixed, cases=())
    assert list(nothing.to_frame().columns) == list(mixed.to_frame().columns)


def test_page_shows_outcomes_and_causes(mixed: CheckResults) -> None:
    html = mixed._repr_html_()
    ElementTree.fromstring(html)
    for outcome in Outcome:
        assert f">{outcome}</span>" in html
    assert html.index("DIFFERS") < html.index("system_0/mujoco.xml [mujoco]")
    assert "accepted" in html
    assert "Segmentation fault" in html
    assert "the motion implies 39.5" in html
    assert "<script" not in html
    assert "url(" not in html


def test_page_limits_cases_and_counts_the_rest(mixed: CheckResults) -> None:
    enlarged = msgspec.structs.replace(mixed, cases=mixed.cases * 5)
    html = enlarged._repr_html_()
    assert f"and {len(enlarged.cases) - 60} more, in .cases and .to_frame()" in html


def test_case_has_trajectories_with_units(mixed: CheckResults) -> None:
    given = {"scenario": "free", "model": "mujoco.xml", "system": "system_1"}
    case, trajectories = mixed.case(**given), mixed.trajectories(**given)
    assert case.series is not None
    assert trajectories.simulated.names == case.series.components
    half = len(trajectories.simulated.names) // 2
    coordinates = mixed.systems[1].coordinates
    assert trajectories.simulated.units[:half] == tuple(one.unit for one in coordinates)
    assert trajectories.simulated.units[half:] == tuple(f"{one.unit}/s" for one in coordinates)
    name = trajectories.simulated.names[0]
    assert trajectories.simulated[name].tolist() == list(case.series.engine[0])
    assert trajectories.reference[name].tolist() == list(case.series.reference[0])
    assert trajectories.errors[name].tolist() == list(case.series.error[0])
    assert "mujoco.xml in mujoco" in trajectories.errors.origin
    broken = mixed.trajectories("driven", "robot.urdf", "mujoco", "system_0").simulated
    assert "not finite from t = " in broken._repr_html_()
    with pytest.raises(MotionError, match="has no motion: ABSENT, pybullet is not installed"):
        mixed.trajectories("large", "mujoco.xml", "mujoco", "system_0")
    with pytest.raises(LookupError, match="more than one case has scenario='free'"):
        mixed.trajectories("free")


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.03928 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_badges_and_curves_have_enough_contrast() -> None:
    for colour in GROUNDS.values():
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5
    (line,) = set(re.findall(r"#[0-9a-f]{6}", _curve()))
    assert 1.05 / (luminance(line) + 0.05) >= 3
    assert (luminance(line) + 0.05) / 0.05 >= 3


def _curve() -> str:
    from physics_crosscheck.harness.interfaces.notebook.markup import curve

    return curve(np.arange(3.0), np.arange(3.0), "a line")


def test_verdicts_and_steps_are_drawn_per_case(mixed: CheckResults, pyplot: Any) -> None:
    ax: Any = mixed.plot()
    judged = [case for case in mixed.cases if case.verdict is not None]
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert labels == [f"{case.id}  {case.outcome}" for case in judged]
    drawn = ax.lines[0].get_xdata()
    expected = [case.verdict.discrepancy for case in judged if case.verdict is not None]
    assert np.array_equal(drawn, np.array(expected, dtype=float), equal_nan=True)
    assert ax.lines[2].get_xdata()[0] == mixed.resolution
    axes: Any = pyplot.subplots()[1]
    back: Any = mixed.plot("steps", ax=axes)
    assert back is axes
    runs = [case for case in judged if case.series is not None]
    assert len(axes.lines) == 2 * len(runs)
    assert runs[0].series is not None
    assert axes.lines[0].get_ydata().tolist() == [0.0045, 0.0091, 0.019]
    assert (axes.get_xlabel(), axes.get_yscale()) == ("step (s)", "log")


def test_invalid_plots_are_rejected(mixed: CheckResults, pyplot: Any) -> None:
    with pytest.raises(ValueError, match="'verdicts' and 'steps' can"):
        mixed.plot("motions")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no case has verdicts"):
        msgspec.structs.replace(mixed, cases=()).plot()
