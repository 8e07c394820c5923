"""The range of the linear equations, against elliptic functions and the square law."""

import mpmath as mp
import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.solving import linearity as linearities
from physics_crosscheck.reference.solving.linearity import AMPLITUDES, LinearityError, linearity
from tests.reference.mechanisms import LINEAR, built_in, equations_of


def errors_of(name: str) -> tuple[LinearityError, ...]:
    equations = equations_of(name)
    return linearity(equations, linearize(equations, equations.system.equilibria[0]))


def test_error_of_the_linear_pendulum_matches_elliptic_functions() -> None:
    (table,) = errors_of("simple_pendulum")
    w = mp.sqrt(mp.mpf(9.81) / mp.mpf(0.75))
    assert table.period == pytest.approx(float(2 * mp.pi / w), rel=1e-15)
    for amplitude, error in zip(table.amplitudes, table.errors, strict=True):
        k = mp.sin(mp.mpf(amplitude) / 2)
        quarter = mp.ellipk(k**2)
        exact = max(
            abs(
                amplitude * mp.cos(phase)
                - 2 * mp.asin(k * mp.ellipfun("sn", phase + quarter, m=k**2))
            )
            for phase in (mp.mpf(2) * mp.pi * i / 100 for i in range(101))
        )
        # Integrated to 1e-10 of the amplitude a step, and an error is relative to the amplitude.
        assert error == pytest.approx(float(exact) / amplitude, rel=1e-5, abs=1e-8)


@pytest.mark.parametrize("name", ["simple_pendulum", "drum_pendulum"])
def test_error_falls_with_the_square_of_the_amplitude(name: str) -> None:
    for table in errors_of(name):
        small = [(a, e) for a, e in zip(table.amplitudes, table.errors, strict=True) if a <= 0.05]
        slope = np.diff(np.log([e for _, e in small])) / np.diff(np.log([a for a, _ in small]))
        # The next order adds about a^2 of the error, at most 0.0025.
        assert np.all(np.abs(slope - 2) < 0.01)


@pytest.mark.parametrize("name", sorted(LINEAR))
def test_linear_equations_have_no_such_error(name: str) -> None:
    assert errors_of(name) == ()


@pytest.mark.parametrize("name", ["simple_pendulum", "drum_pendulum"])
def test_unstable_equilibrium_has_no_such_table(name: str) -> None:
    equations = equations_of(name)
    (upright,) = (e for e in built_in(name).equilibria if e.name == "upright")
    assert linearity(equations, linearize(equations, upright)) == ()


def test_each_mode_of_the_drum_has_a_table() -> None:
    first, second = errors_of("drum_pendulum")
    assert (first.mode, second.mode) == (0, 1)
    assert first.amplitudes == AMPLITUDES == linearities.AMPLITUDES
    assert second.period < first.period
