"""A trajectory: columns, differences, tables, plots and its form in a notebook."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from physics_crosscheck import MotionError, Trajectory
from physics_crosscheck.harness.interfaces.notebook.optional import MissingPackageError
from physics_crosscheck.reference.mechanism.numeric import Array


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
        importlib.util,
        "find_spec",
        lambda name, *_: None if name in packages else find_spec(name),
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


def test_missing_package_is_reported_with_install_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
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
