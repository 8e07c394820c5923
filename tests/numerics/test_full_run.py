"""Full runs: global error, order, error taken apart, steps told, energy, drift."""

import cmath
import math

import numpy as np
import pytest
from sympy import Heaviside, Rational

from harness.engines.protocol import Array, Force
from harness.numerics.decomposition import ErrorDecomposition
from harness.numerics.full_run import full_run
from harness.numerics.step_study import StepStudy, study_step
from reference import t
from tests.numerics.conftest import (
    DAMPING,
    MASS,
    STIFFNESS,
    Bench,
    MakeBench,
    SymplecticEuler,
)


def study(bench: Bench, claimed: int = 1) -> StepStudy:
    return study_step(
        bench.model,
        bench.coordinates,
        bench.motion,
        power=bench.equations.numeric_power,
        amplitude=bench.motion.amplitude,
        claimed=claimed,
    )


def decomposed(bench: Bench) -> ErrorDecomposition:
    found = study(bench).decomposition
    assert found is not None
    return found


def discrete_root(h: float, damping: float) -> complex:
    """ln z / h of one step of symplectic Euler: its own frequency and decay, in closed form."""
    matrix = np.array(
        [
            [1 - h * h * STIFFNESS / MASS, h - h * h * damping / MASS],
            [-h * STIFFNESS / MASS, 1 - h * damping / MASS],
        ]
    )
    return max((cmath.log(z) / h for z in np.linalg.eigvals(matrix)), key=lambda s: s.imag)


@pytest.mark.parametrize("damping", [DAMPING, 0.2])
def test_frequency_and_damping_error_are_those_of_the_difference_equation(
    bench: MakeBench, damping: float
) -> None:
    made = bench(damping=damping, duration=12.0)
    found = decomposed(made)
    s = discrete_root(made.model.step, damping)
    exact = complex(-damping / 2 / MASS, math.sqrt(STIFFNESS / MASS - (damping / 2 / MASS) ** 2))
    # Second order in the error itself is what the least squares leave out: some 1 %.
    assert found.frequency == pytest.approx(s.imag / exact.imag - 1, rel=0.03)
    assert found.damping == pytest.approx(exact.real / abs(exact) - s.real / abs(s), rel=0.03)
    assert found.explained > 0.999


def test_a_wrong_frequency_is_told_as_that(bench: MakeBench) -> None:
    model = SymplecticEuler(stiffness=STIFFNESS * 1.002, step=1e-4)
    found = decomposed(bench(model, duration=8.0))
    assert found.frequency == pytest.approx(1e-3, rel=0.05)
    # Half a percent of damping ratio would be 2.9e-4; the stiffness alone changes it by 6e-5.
    assert abs(found.damping) < 1e-4


def test_the_global_error_falls_with_the_claimed_order(bench: MakeBench) -> None:
    found = study(bench())
    assert found.witness.bears_out
    assert found.witness.order == pytest.approx(1, abs=0.1)
    assert 1e-3 < found.global_error < 1e-1


def test_a_step_told_for_an_error_gives_that_error(bench: MakeBench) -> None:
    found = study(bench())
    assert found.checked is not None
    target, h, measured = found.checked
    assert 0.5 * target < measured <= 1.05 * target
    assert h in found.steps_for
    steps = [step for step in found.steps_for if step is not None]
    assert list(found.steps_for) == sorted(steps, reverse=True)


def test_steps_told_reach_the_breaks_of_the_input(bench: MakeBench) -> None:
    found = study(bench(drive=6 * Heaviside(t - Rational(13, 10))))
    for h in found.steps_for:
        assert h is not None
        assert 1.3 / h == pytest.approx(round(1.3 / h), abs=1e-9)
    assert found.checked is not None
    target, _, measured = found.checked
    assert measured <= 1.05 * target


class Sleepy(SymplecticEuler):
    """Falls asleep a hundred steps after a start, as engines do to save time."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        awake = min(n, 100)
        z, w = super().rollout(q, v, h, awake, None, 1)
        z = np.concatenate([z, np.repeat(z[:, -1:], n - awake, axis=1)], axis=1)
        w = np.concatenate([w, np.zeros((len(q), n - awake, q.shape[1]))], axis=1)
        return z[:, every - 1 :: every], w[:, every - 1 :: every]


def test_a_run_that_does_not_converge_is_a_finding(bench: MakeBench) -> None:
    assert not study(bench(Sleepy())).witness.bears_out


class Tiring(SymplecticEuler):
    """A little more damping from the hundredth step of a run on: less than the step's own error."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        awake = min(n, 100)
        z, w = super().rollout(q, v, h, awake, None, 1)
        if n > awake:
            tired = SymplecticEuler(damping=self.damping * (1 + 1e-3))
            more_z, more_w = tired.rollout(z[:, -1], w[:, -1], h, n - awake, None, 1)
            z, w = np.concatenate([z, more_z], axis=1), np.concatenate([w, more_w], axis=1)
        return z[:, every - 1 :: every], w[:, every - 1 :: every]


def test_memory_below_the_steps_own_error_is_a_finding_all_the_same(bench: MakeBench) -> None:
    found = study(bench(Tiring()))
    assert found.witness.order > 0.9  # the global error alone looks well
    assert found.witness.residual > 1e-4
    assert not found.witness.bears_out


def test_an_honest_engine_leaves_nothing_as_the_step_falls(bench: MakeBench) -> None:
    found = study(bench(drive=6 * Heaviside(t - Rational(13, 10))))
    assert found.witness.bears_out
    assert found.witness.residual < 1e-6


class Leaning(SymplecticEuler):
    """A force of its own, a thousandth of the spring's: it does not go away with h."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        push = np.full((len(q), n, 1), 0.001 * STIFFNESS * 0.25)
        return super().rollout(q, v, h, n, push, every)


def test_an_error_that_does_not_fall_with_the_step_is_a_finding(bench: MakeBench) -> None:
    found = study(bench(Leaning(step=2e-5)))
    assert not found.witness.bears_out
    assert found.witness.order < 0.5


def test_a_run_that_blows_up_is_not_finite(bench: MakeBench) -> None:
    found = study(bench(SymplecticEuler(step=2.0)))
    assert not found.witness.bears_out
    assert found.steps_for == (None, None, None) or found.global_error > 1


def test_energy_balances_to_the_order_of_the_step_with_input_and_damper(bench: MakeBench) -> None:
    made = bench(drive=6 * Heaviside(t - Rational(13, 10)))
    power = made.equations.numeric_power

    def imbalance(model: SymplecticEuler, h: float) -> float:
        return full_run(model, made.coordinates, made.motion, power, h).energy

    coarse, fine = imbalance(made.model, 2e-3), imbalance(made.model, 2e-4)
    assert fine < 2e-3
    assert coarse / fine == pytest.approx(10, rel=0.2)
    # A damper ten percent too weak takes ten percent too little.
    assert imbalance(SymplecticEuler(damping=0.9 * DAMPING), 2e-4) > 10 * fine


def test_sampling_does_not_change_what_is_seen_at_the_end(bench: MakeBench) -> None:
    made = bench(duration=3.0)
    run = full_run(made.model, made.coordinates, made.motion, made.equations.numeric_power, 1e-4)
    assert run.steps == 30000
    assert run.t[-1] == pytest.approx(3.0, abs=1e-12)
    assert len(run.t) <= 1100
