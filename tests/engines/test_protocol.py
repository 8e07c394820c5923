"""The engine protocol: every adapter on every format, and the known-answer engine."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from physics_crosscheck.engine import Array, StateForce
from physics_crosscheck.harness.numerics.ladder import RUNGS, limits, observed_order
from tests.engines.extras import need
from tests.engines.protocol_models import (
    GRAVITY,
    LENGTH,
    MASS,
    PAIRINGS,
    STEP,
    Loaded,
    Pairing,
    Values,
    matrices,
)

Motion = tuple[Array, Array]

LINEAR = ("free mass", "oscillator", "pair")
CAN_SWING = [p for p in PAIRINGS if p.format != "python"]


def installed(pairing: Pairing) -> Pairing:
    """Return the pairing, or skip with what is missing."""
    need(pairing.engine)
    return pairing


@pytest.fixture(params=PAIRINGS, ids=str)
def pairing(request: pytest.FixtureRequest) -> Pairing:
    """Return every pairing whose engine is installed."""
    return installed(request.param)


@pytest.fixture
def oscillator(pairing: Pairing, tmp_path: Path) -> Loaded:
    return pairing.load("oscillator", tmp_path)


@pytest.fixture
def pair(pairing: Pairing, tmp_path: Path) -> Loaded:
    return pairing.load("pair", tmp_path)


Q = np.array([[0.1, -0.2], [0.3, 0.05], [-0.15, 0.25]])
V = np.array([[0.4, 0.1], [-0.3, 0.2], [0.0, -0.5]])


def pushes(n: int, size: int = 2) -> Array:
    """Return forces of three runs that change in each step."""
    return np.random.default_rng(5).uniform(-3, 3, (3, n, size))


def assert_same(first: Iterable[Array], second: Iterable[Array]) -> None:
    """Compare positions and velocities bitwise."""
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_coordinates_are_named_and_ordered_as_in_the_file(pairing: Pairing, pair: Loaded) -> None:
    names = pair.model.coordinates
    if pairing.format == "python":
        assert names == ("b0.x", "b0.y", "b0.angle", "b1.x", "b1.y", "b1.angle")
    else:
        assert names == ("q1", "q2")
    # The order holds for values too: the second start gives the second end.
    zs, ws = pair.run([[0.0, 0.2]], [[0.0, 0.3]], 1e-4, 1)
    assert zs[0, 0] == pytest.approx([0.0, 0.2], abs=1e-3)
    assert ws[0, 0] == pytest.approx([0.0, 0.3], abs=1e-2)


def test_step_of_the_file_does_not_change(oscillator: Loaded) -> None:
    assert oscillator.model.step == STEP
    for h in (0.01, 0.0003):
        oscillator.run([[0.1]], [[0.0]], h, 3)
        assert oscillator.model.step == STEP


def test_integrator_has_a_name(oscillator: Loaded) -> None:
    assert isinstance(oscillator.model.integrator, str)
    assert oscillator.model.integrator


@pytest.mark.parametrize(("n", "every"), [(12, 4), (12, 12), (12, 1), (1, 1)])
def test_samples_have_one_row_per_interval(pair: Loaded, n: int, every: int) -> None:
    zs, ws = pair.model.rollout(pair.lift(Q), pair.lift(V, origin=False), 0.002, n, None, every)
    assert zs.shape == ws.shape == (3, n // every, pair.size)
    assert zs.dtype == ws.dtype == np.float64


@pytest.mark.parametrize("forced", [False, True])
def test_sampling_gives_the_ends_of_shorter_rollouts(pair: Loaded, forced: bool) -> None:
    force = pushes(12) if forced else None
    zs, ws = pair.run(Q, V, 0.003, 12, force, every=4)
    for row, n in enumerate((4, 8, 12)):
        shorter = pair.run(Q, V, 0.003, n, None if force is None else force[:, :n])
        assert_same(shorter, (zs[:, row : row + 1], ws[:, row : row + 1]))


def test_later_calls_do_not_change_results_and_arguments(pair: Loaded) -> None:
    q, v, force = Q.copy(), V.copy(), pushes(9)
    copy = force.copy()
    zs, ws = pair.run(q, v, 0.003, 9, force)
    before = zs.copy(), ws.copy()
    pair.run(V, Q, 0.007, 9, -force)
    assert_same((zs, ws), before)
    assert_same((q, v, force), (Q, V, copy))


def test_repeated_calls_are_bitwise_equal(pair: Loaded) -> None:
    first = pair.run(Q, V, 0.003, 9, pushes(9))
    assert_same(pair.run(Q, V, 0.003, 9, pushes(9)), first)


def test_reordered_or_split_batch_is_bitwise_equal(pair: Loaded) -> None:
    force = pushes(9)
    zs, ws = pair.run(Q, V, 0.003, 9, force)
    order = [2, 0, 1]
    assert_same(pair.run(Q[order], V[order], 0.003, 9, force[order]), (zs[order], ws[order]))
    for b in range(3):
        row = slice(b, b + 1)
        assert_same(pair.run(Q[row], V[row], 0.003, 9, force[row]), (zs[row], ws[row]))


def test_free_rollout_after_a_forced_one_has_no_force(pair: Loaded) -> None:
    free = pair.run(Q, V, 0.003, 9)
    pair.run(Q, V, 0.003, 9, 100 + pushes(9))
    assert_same(pair.run(Q, V, 0.003, 9), free)


def test_rollout_after_one_with_another_step_is_unchanged(pair: Loaded) -> None:
    first = pair.run(Q, V, 0.003, 9)
    pair.run(Q, V, 0.05, 2)
    assert_same(pair.run(Q, V, 0.003, 9), first)


def blow_up(loaded: Loaded, h: float = 1.0, n: int = 400) -> Motion:
    """Return a motion that overflows because its step is too large for the spring."""
    return loaded.run([[0.1], [0.2]], [[0.0], [1.0]], h, n)


@pytest.mark.parametrize(("h", "n"), [(1.0, 400), (0.005, 2000)])
def test_motion_that_blows_up_returns_values_that_are_not_finite(
    pairing: Pairing, tmp_path: Path, h: float, n: int
) -> None:
    zs, ws = blow_up(pairing.load("stiff", tmp_path), h, n)
    assert not np.isfinite(zs).all(axis=2).any()
    assert zs.shape == ws.shape == (2, 1, 1)


def test_rollout_after_one_that_blew_up_is_unchanged(pairing: Pairing, tmp_path: Path) -> None:
    loaded = pairing.load("stiff", tmp_path)
    start = [[0.1]], [[0.2]], 0.0001, 7
    before = loaded.run(*start)
    blow_up(loaded)
    assert_same(loaded.run(*start), before)
    assert np.isfinite(before[0]).all()


def test_run_that_blows_up_does_not_change_its_batch(pairing: Pairing, tmp_path: Path) -> None:
    loaded = pairing.load("stiff", tmp_path)
    single = loaded.run([[1e-3]], [[0.0]], 0.0005, 60)
    q, v = [[1e-3], [np.nan], [1e-3]], [[0.0], [0.0], [0.0]]
    zs, ws = loaded.run(q, v, 0.0005, 60)
    for b in (0, 2):
        assert_same((zs[b : b + 1], ws[b : b + 1]), single)
    assert not np.isfinite(zs[1]).any()


def test_force_held_for_one_step_adds_its_impulse(pairing: Pairing, tmp_path: Path) -> None:
    loaded = pairing.load("free mass", tmp_path)
    for h in (0.01, 0.003):
        _, ws = loaded.run([[0.0]], [[0.5]], h, 1, np.full((1, 1, 1), 7.0))
        assert ws[0, 0, 0] == pytest.approx(0.5 + h * 7.0 / MASS, rel=1e-12)


@pytest.mark.parametrize("step", [0, 3, 5])
def test_force_of_a_step_acts_only_in_that_step(
    pairing: Pairing, tmp_path: Path, step: int
) -> None:
    loaded = pairing.load("free mass", tmp_path)
    force = np.zeros((1, 6, 1))
    force[0, step] = 7.0
    _, ws = loaded.run([[0.0]], [[0.0]], 0.01, 6, force, every=1)
    expected = np.where(np.arange(6) >= step, 0.01 * 7.0 / MASS, 0.0)
    assert ws[0, :, 0] == pytest.approx(expected, rel=1e-12, abs=1e-300)


def test_force_on_one_coordinate_does_not_act_on_the_other(pair: Loaded) -> None:
    force = np.zeros((1, 1, 2))
    force[0, 0, 1] = 2.0
    _, ws = pair.run([[0.0, 0.0]], [[0.0, 0.0]], 1e-5, 1, force)
    assert abs(ws[0, 0, 0]) < 1e-3 * abs(ws[0, 0, 1])
    assert ws[0, 0, 1] == pytest.approx(1e-5 * 2.0 / 0.7, rel=1e-3)


def test_force_by_state_with_a_constant_map_equals_an_array(pair: Loaded) -> None:
    n = 9
    force = pushes(n)
    plain = pair.run(Q, V, 0.003, n, force, every=3)

    def evaluate(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        return tuple(pair.lift(np.asarray(u), origin=False))

    zs, ws = pair.model.rollout(
        pair.lift(Q), pair.lift(V, origin=False), 0.003, n, StateForce(force, evaluate), 3
    )
    whole = pair.model.rollout(
        pair.lift(Q), pair.lift(V, origin=False), 0.003, n, pair.lift(force, origin=False), 3
    )
    assert_same((zs, ws), whole)
    assert plain[0].shape == (3, 3, 2)


def test_force_by_state_sees_the_state_at_the_start_of_its_step(
    pairing: Pairing, tmp_path: Path
) -> None:
    loaded = pairing.load("free mass", tmp_path)
    seen = []

    def evaluate(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        seen.append(list(z))
        return tuple(loaded.lift(np.asarray(u), origin=False))

    inputs = np.ones((1, 4, 1))
    start = loaded.lift([[0.25]]), loaded.lift([[0.5]], origin=False)
    zs, _ = loaded.model.rollout(*start, 0.01, 4, StateForce(inputs, evaluate), 1)
    place = loaded.places[0]
    expected = [0.25, *zs[0, :3, place]]
    assert np.array(seen)[:, place] == pytest.approx(expected, abs=1e-15)


def closed_form(mechanism: str, q: Values, v: Values, time: float, force: Array) -> Array:
    """Return the end state of a linear mechanism under a constant force."""
    M, C, K = matrices(mechanism)
    n = len(M)
    full = np.zeros((2 * n + 1, 2 * n + 1))
    full[:n, n : 2 * n] = np.eye(n)
    full[n : 2 * n, :n] = -np.linalg.solve(M, K)
    full[n : 2 * n, n : 2 * n] = -np.linalg.solve(M, C)
    full[n : 2 * n, 2 * n] = np.linalg.solve(M, force)
    end: Array = scipy.linalg.expm(full * time) @ [*q, *v, 1.0]
    return end[: 2 * n]


@pytest.mark.parametrize("mechanism", LINEAR)
def test_limit_of_small_steps_is_the_closed_form(
    pairing: Pairing, tmp_path: Path, mechanism: str
) -> None:
    loaded = pairing.load(mechanism, tmp_path)
    n = len(loaded.places)
    q, v, force = Q[0, :n], V[0, :n], np.array([1.5, -0.8])[:n]
    time = 0.06
    values = [
        np.concatenate(
            loaded.run([q], [v], time / rung, rung, np.broadcast_to(force, (1, rung, n))), axis=2
        )[:, 0]
        for rung in RUNGS
    ]
    ones = np.ones(2 * n)
    limit = limits(values, RUNGS, loaded.model.exponents(False), ones, ones)
    error = np.abs(limit.value[0] - closed_form(mechanism, q, v, time, force))
    assert np.all(error <= limit.uncertainty[0])
    assert np.max(error) < 1e-11


@pytest.mark.parametrize("swinging", CAN_SWING, ids=str)
def test_pendulum_falls_with_gravity(swinging: Pairing, tmp_path: Path) -> None:
    loaded = installed(swinging).load("pendulum", tmp_path)
    h = 1e-5
    _, ws = loaded.run([[1.0]], [[0.0]], h, 1)
    assert ws[0, 0, 0] / h == pytest.approx(-GRAVITY / LENGTH * math.sin(1.0), rel=1e-6)


@pytest.mark.parametrize("kind", ["none", "constant", "varying"])
def test_claimed_order_is_the_observed_one(oscillator: Loaded, kind: str) -> None:
    time = 0.05

    def force(rung: int) -> Array | None:
        s = np.arange(rung) / rung
        value = {"none": 0 * s, "constant": 0 * s + 9.0, "varying": 40 * np.cos(3 * s)}[kind]
        return None if kind == "none" else value.reshape(1, rung, 1)

    ends = [
        np.concatenate(oscillator.run([[0.2]], [[0.5]], time / r, r, force(r)), axis=2)[:, 0]
        for r in RUNGS
    ]
    claimed, increment = oscillator.model.exponents(kind == "varying")
    order, holds = observed_order(np.stack(ends), RUNGS[: len(ends)], claimed, 1.0)
    assert holds
    assert order == pytest.approx(claimed, abs=0.2)
    assert increment == 1


def test_runge_kutta_claims_order_four_until_an_input_varies(
    pairing: Pairing, oscillator: Loaded
) -> None:
    claims = [oscillator.model.exponents(varying)[0] for varying in (False, True)]
    assert claims == ([4, 1] if pairing.integrator == "RK4" else [1, 1])
