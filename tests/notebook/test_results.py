"""The results of `check` in a notebook: a table, a page and plots, of every outcome."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from physics_crosscheck import CheckResults, MotionError
from physics_crosscheck.harness.interfaces.notebook.markup import GROUNDS
from physics_crosscheck.records import Outcome
from tests.report import samples


@pytest.fixture
def mixed() -> CheckResults:
    return CheckResults(**msgspec.structs.asdict(samples.mixed()))


@pytest.fixture
def pyplot() -> Iterator[Any]:
    pytest.importorskip("matplotlib").use("Agg")
    import matplotlib.pyplot as plt

    yield plt
    plt.close("all")


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
