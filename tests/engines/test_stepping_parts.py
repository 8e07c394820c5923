"""Parts that adapters share: a Runge-Kutta stepper, mimics, springs, settings."""

import os
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, EngineError, ModelSpec, Spring, StateForce
from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.harness.engines.installed import STDERR, STDOUT, capture_output
from physics_crosscheck.harness.engines.runge_kutta import (
    BALL,
    FREE,
    JointLayout,
    RungeKutta,
    each_alone,
)
from physics_crosscheck.harness.engines.tree_model import (
    SpringForces,
    constrained_accelerations,
    leader_matrix,
)
from physics_crosscheck.harness.engines.urdf_sidecar import check_settings, declared_urdf
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    from_quaternion,
    unit_quaternion,
)


def test_runge_kutta_matches_the_taylor_series() -> None:
    """Compare with the Taylor series of x'' = -x from (1, 0) to order four."""
    stepper = RungeKutta(lambda x, m, f: f - x, JointLayout([1]))
    q, v = stepper.rollout(np.ones((1, 1)), np.zeros((1, 1)), 0.1, 1, None, 1)
    assert q[0, 0, 0] == pytest.approx(1 - 0.1**2 / 2 + 0.1**4 / 24, abs=1e-16)
    assert v[0, 0, 0] == pytest.approx(-0.1 + 0.1**3 / 6, abs=1e-16)


FREE_ROOT = JointLayout([FREE])
INERTIA = np.array([0.3, 0.5, 0.9])


def tumbling(x: Array, m: Array, f: Array) -> Array:
    """Return Euler's equations of a free body with its origin at its centre of mass."""
    spin = m[3:6]
    turn = (f[3:6] - np.cross(spin, INERTIA * spin)) / INERTIA
    return np.concatenate([f[:3] / 2.0, turn])


def tumbled(n: int, span: float = 0.8) -> tuple[Array, Array]:
    z = np.array([0.1, -0.2, 0.3, 0.4, -0.9, 1.1])
    m = np.array([1.0, 0.0, -2.0, 0.7, 2.0, -1.3])
    stepper = RungeKutta(each_alone(tumbling), FREE_ROOT)
    x, m = FREE_ROOT.to_state(z, np.zeros(6))[0][None], m[None]
    for _ in range(n):
        x, m = stepper.stepped(x, m, np.zeros((1, 6)), span / n)
    return x[0], m[0]


def test_tumbling_body_has_order_four() -> None:
    ends = [tumbled(n) for n in (8, 16, 32)]
    fine, _ = tumbled(512)
    errors = [float(np.abs(x - fine).max()) for x, _ in ends]
    orders = np.log2(errors[:-1]) - np.log2(errors[1:])
    assert orders == pytest.approx([4, 4], abs=0.3)


def test_tumbling_body_conserves_angular_momentum() -> None:
    x, m = tumbled(400)
    start, spin = unit_quaternion(np.array([0.4, -0.9, 1.1])), np.array([0.7, 2.0, -1.3])
    np.testing.assert_allclose(
        from_quaternion(x[3:7]) @ (INERTIA * m[3:6]),
        from_quaternion(start) @ (INERTIA * spin),
        atol=1e-10,
    )


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


def test_motion_that_blows_up_does_not_change_its_batch() -> None:
    stepper = RungeKutta(lambda x, m, f: x**3 + f, JointLayout([1]))
    q = np.array([[1e200], [0.1], [np.nan]])
    z, w = stepper.rollout(q, 0 * q, 0.1, 4, None, 2)
    assert np.isfinite(z[:, :, 0]).tolist() == [[False] * 2, [True] * 2, [False] * 2]
    assert np.isfinite(w[1]).all()


def test_forces_by_state_are_evaluated_at_the_start_of_each_step() -> None:
    stepper = RungeKutta(lambda x, m, f: f, JointLayout([1]))
    given = StateForce(np.ones((1, 3, 1)), lambda z, u: [u[0] - z[0]])
    z, _ = stepper.rollout(np.zeros((1, 1)), np.zeros((1, 1)), 1.0, 3, given, 1)
    # Each step adds v + f/2 with f = 1 - z of its start, and v grows by f.
    assert z[0, :, 0] == pytest.approx([0.5, 1.75, 2.875], rel=1e-15)


CHAIN = [Mimic("b", "a", 2.0, 0.0), Mimic("c", "b", -0.5, 0.0)]


def test_chained_mimics_follow_the_first_leader() -> None:
    along = leader_matrix(CHAIN, ("c", "x", "a", "b"), "f")
    np.testing.assert_array_equal(along, [[0, -1], [1, 0], [0, 1], [0, 2]])


@pytest.mark.parametrize(("mimics", "message"), [
    ([Mimic("a", "b", 1.0, 0.0), Mimic("b", "a", 1.0, 0.0)], "leads back to it"),
    ([Mimic("a", "nowhere", 1.0, 0.0)], "'nowhere', which is not a moving joint"),
])  # fmt: skip
def test_mimics_without_a_leader_are_rejected(mimics: list[Mimic], message: str) -> None:
    with pytest.raises(EngineError, match=message):
        leader_matrix(mimics, ("a", "b"), "f")


def test_mimic_constraint_forces_do_no_work() -> None:
    mass = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.0], [0.1, 0.0, 0.7]])
    load, along = np.array([1.0, -2.0, 0.4]), leader_matrix(CHAIN, ("a", "b", "c"), "f")
    a = constrained_accelerations(mass, load, along)
    np.testing.assert_allclose(a[1:], [2 * a[0], -a[0]], rtol=1e-14)
    np.testing.assert_allclose(along.T @ (mass @ a - load), 0, atol=1e-15)


def test_springs_act_on_combinations_of_joints() -> None:
    between = Spring({"a": 1.0, "b": -1.0}, 38.0, 0.35, 0.1)
    forces = SpringForces([between, Spring({"b": 1.0}, 5.0, 0.0, 0.0)], ("b", "a"), "f", np.ones(2))
    q, v = np.array([0.2, 0.7]), np.array([-1.0, 0.5])
    load = 38.0 * (0.7 - 0.2 - 0.1) + 0.35 * 1.5
    np.testing.assert_allclose(forces.forces(q, v), [load - 5 * 0.2 + 1.0, -load - 0.5], rtol=1e-14)
    assert SpringForces([], ("a",), "f").empty
    with pytest.raises(EngineError, match="'nowhere', which is not a moving joint"):
        SpringForces([Spring({"nowhere": 1.0}, 1.0, 0.0, 0.0)], ("a",), "f")


def test_output_of_a_library_is_captured_on_both_streams(capfd: pytest.CaptureFixture[str]) -> None:
    with capture_output((STDOUT, STDERR), again=False) as texts:
        os.write(STDOUT, b"out")
        os.write(STDERR, b"err")
    assert texts == ["out", "err"]
    with capture_output() as texts:
        os.write(STDOUT, b"again")
    assert texts == ["again"]
    assert capfd.readouterr() == ("again", "")


URDF = """<robot name="r"><link name="g"/><link name="a"/><link name="b"/>
<joint name="j" type="continuous"><parent link="g"/><child link="a"/></joint>
<joint name="k" type="continuous"><parent link="a"/><child link="b"/><mimic joint="j"/></joint>
<gazebo reference="j"><springStiffness>5</springStiffness></gazebo></robot>"""


@pytest.mark.parametrize(("settings", "springs", "mimics"), [
    ({}, 1, 1), ({"couplings": False}, 1, 0), ({"couplings": ["k"]}, 1, 1),
    ({"couplings": ["other"]}, 1, 0), ({"held": ["j"]}, 0, 1),
])  # fmt: skip
def test_sidecar_selects_springs_and_mimics(
    settings: dict[str, object], springs: int, mimics: int, tmp_path: Path
) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(URDF)
    declared = declared_urdf(ModelSpec(path, settings=settings))
    assert (len(declared.springs), len(declared.mimics)) == (springs, mimics)


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
