"""The simple pendulum against Jacobi's elliptic functions; the IFToMM benchmark's energy."""

from collections.abc import Sequence
from functools import cache

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve
from tests.reference.mechanisms import pendulum

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
def test_segment_ends_and_chained_starts_match_elliptic_functions(name: str) -> None:
    motion = solved(*STARTS[name], duration=5.0)
    (span,) = motion.spans
    with mp.workdps(25):
        w, step = mp.sqrt(mp.mpf(G) / L), mp.mpf(span.length)
        gaps = [
            [
                float(a - b)
                for a, b in zip(motion.end[i], flow(motion.start[i], step, w), strict=True)
            ]
            for i in range(0, span.count, 5)
        ]
        exact = flow(STARTS[name], step * (span.count - 1), w)
    worst = np.max(np.abs(gaps), axis=0)
    # The motion's bound, which includes the difference of the two integrations.
    assert np.all(worst <= motion.bound)
    assert np.all(motion.bound <= 1e-13)
    gap = np.abs(motion.start[-1] - np.array(exact, dtype=float))
    # DOP853 at 1e-13 a step, some 200 steps; where the motion lingers near the saddle, an error
    # grows there by a hundred (2.9 rad) or thousands (3.1 rad) a swing.
    assert np.max(gap) <= {"large": 1e-10, "almost upright": 1e-8}.get(name, 1e-11)
