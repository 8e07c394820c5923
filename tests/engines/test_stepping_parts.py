"""Parts that adapters share: coordinates of rotations, captured output, settings."""

import os
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, ModelSpec
from physics_crosscheck.harness.engines.installed import STDERR, STDOUT, capture_output
from physics_crosscheck.harness.engines.runge_kutta import BALL, FREE, JointLayout, RungeKutta
from physics_crosscheck.harness.engines.urdf_sidecar import check_settings
from physics_crosscheck.reference.mechanism.rotations import angular_velocity, from_quaternion

FREE_ROOT = JointLayout([FREE])


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.0099, 0.0101, 1.0, 3.0])
def test_displacement_rates_invert_the_differential_of_the_exponential(angle: float) -> None:
    by = angle * np.array([0.36, -0.48, 0.8])
    spin = np.array([0.3, 0.9, -0.4])
    rate = FREE_ROOT.displacement_rate(
        np.concatenate([np.zeros(3), by]), np.concatenate([np.zeros(3), spin])
    )[3:6]
    h = 1e-5
    x = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0]])
    start, end = (
        FREE_ROOT.displaced(x, np.concatenate([np.zeros(3), by + s * h * rate])) for s in (-1, 1)
    )
    turn = from_quaternion(start[3:7]).T @ from_quaternion(end[3:7]) / (2 * h)
    doubled = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    np.testing.assert_allclose(doubled / 2, spin, atol=1e-9)


@pytest.mark.parametrize("sizes", [[FREE, 1], [1, BALL, BALL], [BALL, 1, BALL]])
def test_coordinates_of_rotations_are_returned_as_set(sizes: list[int]) -> None:
    z = np.array([0.1, -0.2, 0.3, 5.0, -0.9, 1.1, 0.6])  # rotated by more than half a turn
    w, layout = np.array([1.0, 0.0, -2.0, 0.7, 2.0, -1.3, 0.4]), JointLayout(sizes)
    stepper = RungeKutta(lambda x, m, f: f, layout)
    result = stepper.rollout(z[None], w[None], 1e-30, 1, None, 1)
    for actual, expected in zip(result, (z, w), strict=True):
        np.testing.assert_allclose(actual[0, 0], expected, rtol=1e-14, atol=1e-15)
    m = layout.to_state(z, w)[1]
    for here, _ in layout.turns:
        np.testing.assert_allclose(m[here], angular_velocity(z[here], w[here]))


def test_output_of_a_library_is_captured_on_both_streams(capfd: pytest.CaptureFixture[str]) -> None:
    with capture_output((STDOUT, STDERR), again=False) as texts:
        os.write(STDOUT, b"out")
        os.write(STDERR, b"err")
    assert texts == ["out", "err"]
    with capture_output() as texts:
        os.write(STDOUT, b"again")
    assert texts == ["again"]
    assert capfd.readouterr() == ("again", "")


@pytest.mark.parametrize(("settings", "message"), [
    ({"fast": 3}, r"fast is 3; expected true or false"),
    ({"drag": True}, r"drag is True; expected a number"),
    ({"way": "up"}, r"way is 'up'; expected one of left, right"),
    ({"odd": 1}, r"Title has no setting odd"), ({"gravity": None}, "must set gravity"),
])  # fmt: skip
def test_invalid_settings_are_rejected(settings: dict[str, object], message: str) -> None:
    given = {"step": 0.01, "gravity": [0, 0, 0], **settings}
    stated = {key: value for key, value in given.items() if value is not None}
    defaults: dict[str, float | bool | str] = {"fast": False, "drag": 0.1, "way": "left"}
    with pytest.raises(EngineError, match=message):
        check_settings(
            ModelSpec(Path("r.urdf"), settings=stated), "Title", "none", defaults,
            {"way": ("left", "right")},
        )  # fmt: skip
