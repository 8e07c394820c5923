"""The engine's own linearization, from limits of small perturbations."""

import numpy as np
import pytest

from harness.numerics.linearization import twin
from reference.linearize import linearize
from tests.numerics.conftest import STIFFNESS, SymplecticEuler


def linear(bench):
    taylor = linearize(bench.equations, bench.system.equilibria[0])
    return twin(
        bench.model,
        bench.coordinates,
        "rest",
        taylor.position,
        taylor.arrays,
        bench.motion.amplitude,
        np.array([5.0]),
    )


def test_a_right_engine_has_taylors_matrices_to_ten_digits(bench):
    found = linear(bench())
    assert found.a_error < 1e-10
    assert found.b_error < 1e-10
    assert found.transfer_error < 1e-8
    assert found.shapes > 1 - 1e-12
    for ours, theirs in zip(found.poles, found.taylor_poles, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-10)


@pytest.mark.parametrize("fault", [1e-3, 1e-7])
def test_a_wrong_stiffness_is_seen_in_a_and_not_in_b(bench, fault):
    found = linear(bench(SymplecticEuler(stiffness=STIFFNESS * (1 + fault))))
    assert found.a_error == pytest.approx(fault, rel=1e-2)
    assert found.b_error < 1e-10


class Hardening(SymplecticEuler):
    """A spring whose cubic term the perturbations' extrapolation must remove."""

    def rollout(self, q, v, h, n, force, every):
        q, v = q.copy(), v.copy()
        for i in range(n):
            push = 0.0 if force is None else force[:, i]
            pull = self.stiffness * q * (1 + 3 * q**2) + self.damping * v
            v = v + h * (push - pull) / self.mass
            q = q + h * v
        return q[:, None], v[:, None]


def test_the_nonlinear_terms_are_extrapolated_away(bench):
    found = linear(bench(Hardening()))
    assert found.a_error < 1e-9
