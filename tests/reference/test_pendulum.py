"""The simple pendulum against Jacobi's elliptic functions; the IFToMM benchmark's energy."""

from collections.abc import Sequence
from functools import cache

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve
from tests.reference.mechanisms import EPS, pendulum

G, L = 9.81, 0.75
STARTS = {  # angle, speed
    "small": (0.05, 0.0),
    "moderate": (1.1, -0.3),
    "large": (2.9, 0.0),
    "almost upright": (3.1, 0.02),
    "whirling": (0.4, 9.0),
    "whirling backwards": (-0.4, -8.0),
}


@cache
def solved(angle: sp.Expr | float, speed: float, duration: float, l: float = L) -> Motion:  # noqa: E741
    system = pendulum(angle, speed, duration, G, l)
    return solve(derive(system), system.scenarios[0])


def flow(state: Sequence[float], time: mp.mpf, w: mp.mpf) -> list[mp.mpf]:
    """Move a state along theta'' = -w^2 sin(theta), exactly: Whittaker, Dynamics, section 44."""
    angle, speed = map(mp.mpf, state)
    si, half = mp.sin(angle / 2), speed / (2 * w)
    m = si**2 + half**2  # (E + w^2) / (2 w^2), the parameter k^2
    if m < 1:
        k = mp.sqrt(m)
        turns = mp.nint(angle / (2 * mp.pi))  # it swings about the nearest hanging position
        phase = mp.ellipf(mp.atan2((-1) ** int(turns) * si, half), m) + w * time
        sn, cn = (mp.ellipfun(name, phase, m=m) for name in ("sn", "cn"))
        return [2 * mp.asin(k * sn) + 2 * mp.pi * turns, 2 * k * w * cn]
    way = mp.sign(speed)
    rate = w * mp.sqrt(m)
    phase = way * mp.ellipf(angle / 2, 1 / m) + rate * time
    sn, cn, dn = (mp.ellipfun(name, phase, m=1 / m) for name in ("sn", "cn", "dn"))
    period = 2 * mp.ellipk(1 / m)  # of half a turn of theta / 2
    turned = mp.nint(phase / period)
    inside = mp.atan2((-1) ** int(turned) * sn, (-1) ** int(turned) * cn)
    return [2 * way * (inside + mp.pi * turned), 2 * way * rate * dn]


@pytest.mark.parametrize("name", STARTS)
def test_segment_ends_match_elliptic_functions(name: str) -> None:
    motion = solved(*STARTS[name], duration=5.0)
    (span,) = motion.spans
    with mp.workdps(25):
        w = mp.sqrt(mp.mpf(G) / L)
        gaps = [
            [
                float(a - b)
                for a, b in zip(
                    motion.end[i], flow(motion.start[i], mp.mpf(span.length), w), strict=True
                )
            ]
            for i in range(0, span.count, 5)
        ]
    worst = np.max(np.abs(gaps), axis=0)
    # The motion's bound, which includes the difference of the two integrations.
    assert np.all(worst <= motion.bound)
    assert np.all(motion.bound <= 1e-13)


@pytest.mark.parametrize("name", STARTS)
def test_chain_of_starts_stays_on_the_exact_motion(name: str) -> None:
    motion = solved(*STARTS[name], duration=5.0)
    (span,) = motion.spans
    with mp.workdps(25):
        w = mp.sqrt(mp.mpf(G) / L)
        exact = flow(STARTS[name], mp.mpf(span.length) * (span.count - 1), w)
    gap = np.abs(motion.start[-1] - np.array(exact, dtype=float))
    # DOP853 at 1e-13 a step, some 200 steps; where the motion lingers near the saddle, an error
    # grows there by a hundred (2.9 rad) or thousands (3.1 rad) a swing.
    assert np.max(gap) <= {"large": 1e-10, "almost upright": 1e-8}.get(name, 1e-11)


@pytest.mark.parametrize("amplitude", [0.05, 1.1, 2.9])
def test_period_is_four_quarter_periods(amplitude: float) -> None:
    w = mp.sqrt(mp.mpf(G) / L)
    exact = float(4 * mp.ellipk(mp.sin(mp.mpf(amplitude) / 2) ** 2) / w)
    motion = solved(amplitude, 0.0, duration=6.0 * exact)
    crossing = [
        brentq(
            lambda time: motion.states_at(np.array([time]))[0, 0],
            (cycle + 0.7) * exact,
            (cycle + 0.8) * exact,
            xtol=1e-14,
            rtol=4 * EPS,
        )
        for cycle in (0, 5)
    ]
    # The error of the starts (above), at a speed of the amplitude times some w.
    allowed = 1e-11 if amplitude == 2.9 else 1e-12
    assert (crossing[1] - crossing[0]) / 5 == pytest.approx(exact, rel=allowed)


@pytest.mark.slow
def test_benchmark_pendulum_of_iftomm_keeps_its_energy() -> None:
    """IFToMM multibody benchmark A01: 1 m, 1 kg, released from the horizontal at rest.

    Its bound on the drift of the energy is 5e-5 J in 2000 s; here it runs for a tenth of them.
    """
    motion = solved(sp.pi / 2, 0.0, duration=200.0, l=1.0)
    angle, speed = motion.start.T
    energy = speed**2 / 2 - G * np.cos(angle)
    # 7 000 steps of DOP853, each with 1e-13 of a state of 4.4: 7e-10 if all had one sign.
    assert np.max(np.abs(energy - energy[0])) <= 1e-10
    (span,) = motion.spans
    with mp.workdps(30):
        w = mp.sqrt(mp.mpf(G))
        exact = flow([angle[0], 0], mp.mpf(span.length) * (span.count - 1), w)
        gap = np.abs(motion.start[-1] - np.array(exact, dtype=float))
    # A drift of 1e-10 J grown evenly changes the frequency by 1e-10 / (4 g) of itself on average,
    # which over 600 rad is 2e-9 rad, in the chain only: each segment has the bound below.
    assert np.max(gap) <= 2e-9 * np.sqrt(G)
    assert np.max(np.abs(by_addition(motion.start, span.length, w) - motion.end)) <= 1e-13
    assert np.all(motion.bound <= 1e-13)


def by_addition(states: Array, length: float, w: mp.mpf) -> Array:
    """Move all states by one segment, through the addition theorem of sn, in long doubles.

    The parameter is that of the release, m = 1/2, up to what the energy has drifted; to first
    order in that, 1e-11, it enters sn, cn and dn of the segment's length.
    """
    long = np.longdouble
    angle, speed = states.T.astype(long)
    speed = speed / (2 * long(str(w)))
    m = np.sin(angle / 2) ** 2 + speed**2
    with mp.workdps(30):
        sn, cn, dn = (
            long(mp.nstr(mp.ellipfun(name, w * length, m=mp.mpf(1) / 2), 25))
            + (m - long(0.5))
            * long(
                mp.nstr(mp.diff(lambda p, n=name: mp.ellipfun(n, w * length, m=p), mp.mpf(1) / 2))
            )
            for name in ("sn", "cn", "dn")
        )
    k = np.sqrt(m)
    s0, c0, d0 = np.sin(angle / 2) / k, speed / k, np.cos(angle / 2)
    below = 1 - m * s0**2 * sn**2
    s1, c1 = (s0 * cn * dn + sn * c0 * d0) / below, (c0 * cn - s0 * d0 * sn * dn) / below
    return np.column_stack([2 * np.arcsin(k * s1), 2 * k * long(str(w)) * c1]).astype(float)
