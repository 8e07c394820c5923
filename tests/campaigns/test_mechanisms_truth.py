"""The equations that random mechanisms are held against, against mpmath; and they must matter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from campaigns.mechanisms import truth
from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.dynamics import Dynamics, Poses, Real
from campaigns.mechanisms.mechanism import MJCF, Mechanism, Path, with_fault
from campaigns.mechanisms.trial import Posed, examine, pose
from tests.campaigns import digits

EPSILON = truth.EPSILON


def apart(found: Real, wanted: list[Any]) -> float:
    """Largest distance of numbers in `longdouble` from mpmath's, by the largest of these."""
    own = [mp.mpf(0) + mp.mpf(float(x)) + mp.mpf(float(x - np.longdouble(float(x)))) for x in found]
    size = max(1, *(abs(x) for x in wanted))
    return float(max(abs(a - b) for a, b in zip(own, wanted, strict=True)) / size)


@pytest.mark.parametrize("index", range(6))
def test_accelerations_have_more_digits_than_a_double(index: int) -> None:
    mechanism = draw(41, index)
    if mechanism.engine == "pybullet":  # which takes axes as they stand: a last digit of a double
        mechanism = replace(mechanism, engine="mujoco")
    n = len(mechanism.links)
    state = np.array([*mechanism.q, *mechanism.v], dtype=np.longdouble)[:, None]
    time = np.array([0.75], dtype=np.longdouble)
    dynamics = Dynamics(mechanism)
    found = dynamics.acceleration(time, state[:n], state[n:])[:, 0]
    with mp.workdps(digits.DIGITS):
        q, v = ([mp.mpf(x) for x in part] for part in (mechanism.q, mechanism.v))
        wanted = list(digits.accelerations(mechanism, mp.mpf(0.75), q, v))
        error = apart(found, wanted)
    condition = np.linalg.cond(dynamics.mass_matrix(np.array([mechanism.q]))[0].astype(float))
    assert error < 100 * EPSILON * condition


@pytest.mark.slow
def test_ends_have_more_digits_than_a_double() -> None:
    mechanism = draw(41, 18, most=2)
    assert mechanism.engine == "mujoco"
    posed = pose(mechanism, 5)
    length = float(posed.motion.lengths[0])
    with mp.workdps(digits.DIGITS):
        wanted = digits.end(mechanism, float(posed.motion.t[2]), posed.motion.start[2], length)
        ends = posed.truth.states[2]
        off = [apart(ends[i : i + 1], wanted[i : i + 1]) * abs(wanted[i]) for i in range(len(ends))]
    assert np.all(np.array(off, dtype=float) <= posed.truth.error)
    assert np.all(posed.truth.error < 1e-16 * posed.motion.unit)


@cache
def one() -> Mechanism:
    """A mechanism of three hinges, under RK4, without drives: its limits are the best known."""
    found = (draw(43, index, most=3) for index in range(400))
    return next(
        replace(m, drives=())
        for m in found
        if m.kinds == (True,) * 3 and m.integrator == "RK4" and m.format == MJCF
    )


def differs(posed: Posed, mechanism: Mechanism) -> bool:
    return bool(np.any(examine(posed, mechanism, 1e-9).ratios > 1))


def test_a_right_mechanism_does_not_differ() -> None:
    assert not differs(pose(one(), 9), one())


@pytest.mark.parametrize(
    "where", [("links", 1, "mass"), ("links", 2, "inertia", 0), ("links", 1, "centre", 1)]
)
def test_a_wrong_number_in_the_equations_is_noticed(where: Path) -> None:
    assert differs(pose(with_fault(one(), where, 1e-9), 9), one())


def test_a_wrong_term_in_the_equations_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = one()
    right = Dynamics._biases

    def wrong(self: Dynamics, poses: Poses, v: Real) -> tuple[Real, Real, Real]:
        spins, turning, moving = right(self, poses, v)
        return spins, turning * (1 + 1e-8), moving

    monkeypatch.setattr(Dynamics, "_biases", wrong)
    assert differs(pose(mechanism, 9), mechanism)


def test_what_does_not_settle_is_told() -> None:
    mechanism = one()
    states = np.array([[*mechanism.q, *mechanism.v]])
    with pytest.raises(truth.TruthError, match="does not settle"):
        truth.ends(Dynamics(mechanism), np.zeros(1), states, 20.0)
