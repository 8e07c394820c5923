"""Published contact tables are repeated: the metric, the scenes' numbers and a row."""

import numpy as np
import pytest

from campaigns.published import figure, rolling_error, tables


def test_a_box_that_stays_has_the_published_error() -> None:
    rest = np.zeros((4000, 6))  # SimBenchmark's figure for ODE and DART, which a pyramid cone holds
    assert rolling_error(rest, "xy") == pytest.approx(3.14497, rel=1e-6)


def test_bouncing_balls_repeat_the_published_energy_error() -> None:
    pytest.importorskip("pybullet")
    table = next(table for table in tables() if table.get("measure") == "energy")
    case = next(case for case in table["cases"] if case["engine"] == "pybullet")
    assert f"{figure(table, case):.6g}" == case["published"]
