"""Reference equations of random mechanisms, compared with mpmath and with planted faults."""

from dataclasses import replace
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from campaigns.mechanisms import truth
from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.dynamics import BodyPoses, MechanismDynamics, Real
from campaigns.mechanisms.mechanism import MJCF, Path, RandomMechanism, with_fault
from campaigns.mechanisms.trial import MechanismCase, judge_motion, prepare_case
from tests.campaigns import digits

EPSILON = truth.EPSILON


def apart(actual: Real, wanted: list[Any]) -> float:
    """Return the largest error of `longdouble` numbers, relative to the largest of mpmath's."""
    pairs = [(float(x), float(x - np.longdouble(float(x)))) for x in actual]
    values = [mp.mpf(0) + mp.mpf(high) + mp.mpf(low) for high, low in pairs]
    size = max(1, *(abs(x) for x in wanted))
    return float(max(abs(a - b) for a, b in zip(values, wanted, strict=True)) / size)


@pytest.mark.parametrize("index", range(6))
def test_accelerations_have_more_digits_than_a_double(index: int) -> None:
    mechanism = draw(41, index)
    if mechanism.engine == "pybullet":  # does not normalize axes: an error of a double's last digit
        mechanism = replace(mechanism, engine="mujoco")
    n = len(mechanism.links)
    state = np.array([*mechanism.q, *mechanism.v], dtype=np.longdouble)[:, None]
    time = np.array([0.75], dtype=np.longdouble)
    dynamics = MechanismDynamics(mechanism)
    actual = dynamics.acceleration(time, state[:n], state[n:])[:, 0]
    with mp.workdps(digits.DIGITS):
        q, v = ([mp.mpf(x) for x in part] for part in (mechanism.q, mechanism.v))
        wanted = list(digits.accelerations(mechanism, mp.mpf(0.75), q, v))
        error = apart(actual, wanted)
    condition = np.linalg.cond(dynamics.mass_matrix(np.array([mechanism.q]))[0].astype(float))
    assert error < 100 * EPSILON * condition


@pytest.mark.slow
def test_ends_have_more_digits_than_a_double() -> None:
    mechanism = draw(41, 18, max_joints=2)
    assert mechanism.engine == "mujoco"
    posed = prepare_case(mechanism, 5)
    length = float(posed.motion.lengths[0])
    with mp.workdps(digits.DIGITS):
        wanted = digits.end(mechanism, float(posed.motion.t[2]), posed.motion.start[2], length)
        ends = posed.truth.states[2]
        off = [apart(ends[i : i + 1], wanted[i : i + 1]) * abs(wanted[i]) for i in range(len(ends))]
    assert np.all(np.array(off, dtype=float) <= posed.truth.error)
    assert np.all(posed.truth.error < 1e-16 * posed.motion.unit)


@cache
def three_hinges() -> RandomMechanism:
    """Return three hinges under RK4 without drives, which have the tightest limits."""
    mechanisms = (draw(43, index, max_joints=3) for index in range(400))
    return next(
        replace(m, drives=())
        for m in mechanisms
        if m.kinds == (True,) * 3 and m.integrator == "RK4" and m.format == MJCF
    )


def differs(posed: MechanismCase, mechanism: RandomMechanism) -> bool:
    return bool(np.any(judge_motion(posed, mechanism, 1e-9).ratios > 1))


def test_correct_mechanism_does_not_differ() -> None:
    assert not differs(prepare_case(three_hinges(), 9), three_hinges())


@pytest.mark.parametrize(
    "where", [("links", 1, "mass"), ("links", 2, "inertia", 0), ("links", 1, "centre", 1)]
)
def test_wrong_number_in_the_equations_is_detected(where: Path) -> None:
    assert differs(prepare_case(with_fault(three_hinges(), where, 1e-9), 9), three_hinges())


def test_wrong_term_in_the_equations_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = three_hinges()
    right = MechanismDynamics._biases

    def wrong(self: MechanismDynamics, poses: BodyPoses, v: Real) -> tuple[Real, Real, Real]:
        spins, turning, moving = right(self, poses, v)
        return spins, turning * (1 + 1e-8), moving

    monkeypatch.setattr(MechanismDynamics, "_biases", wrong)
    assert differs(prepare_case(mechanism, 9), mechanism)


def test_missing_convergence_is_reported() -> None:
    mechanism = three_hinges()
    states = np.array([[*mechanism.q, *mechanism.v]])
    with pytest.raises(truth.TruthError, match="does not converge"):
        truth.ends(MechanismDynamics(mechanism), np.zeros(1), states, 20.0)
