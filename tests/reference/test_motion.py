"""The motion as a value, its segments and interpolation, and motions of a family."""

import pickle
from collections.abc import Mapping
from typing import NoReturn

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.linearize import linearize, modes, poles
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.solving.collocation import collocate
from physics_crosscheck.reference.solving.integrate import field_of
from physics_crosscheck.reference.solving.next_state import Family
from physics_crosscheck.reference.solving.solve import solve
from tests.reference.mechanisms import EPS, SCENARIOS, built_in, equations_of, motion_of

every = pytest.mark.parametrize(("name", "scenario"), SCENARIOS)


@every
def test_segments_tile_the_duration_in_prime_numbers(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    declared = built_in(name).scenario(scenario)
    assert all(sp.isprime(span.count) for span in motion.spans)
    assert len(motion.t) == sum(span.count for span in motion.spans) >= 200 == 200
    assert motion.t[0] == 0
    assert motion.duration == pytest.approx(declared.duration, rel=4 * EPS)
    np.testing.assert_allclose(
        np.diff(motion.t), motion.lengths[:-1], rtol=0, atol=4 * EPS * motion.duration
    )
    assert np.all(motion.lengths * motion.fastest <= 2 * np.pi / 20 * (1 + EPS))
    cuts = [signal.start for signal in pieces(built_in(name), declared)]
    assert [span.start for span in motion.spans] == cuts


@every
def test_each_segment_starts_where_the_last_has_ended(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    gap = np.max(np.abs(motion.start[1:] - motion.end[:-1]), axis=0)
    if equations_of(name).linear:
        # Two roundings, of the start and of the end.
        assert np.all(gap <= 2 * EPS * motion.amplitude)
    else:
        # The starts come from one long DOP853 run, with 1e-13 of a state a step.
        assert np.all(gap <= 1e-11 * np.maximum(motion.amplitude, 1e-2))


@every
def test_interpolated_motion_matches_direct_integration(name: str, scenario: str) -> None:
    motion, equations = motion_of(name, scenario), equations_of(name)
    first = 0
    signals = pieces(equations.system, equations.system.scenario(scenario))
    for span, signal in zip(motion.spans, signals, strict=True):
        chosen = slice(first, first + span.count)
        first += span.count
        for part in (0.03, 0.5, 0.97):
            times, starts = motion.t[chosen], motion.start[chosen]
            direct, _ = collocate(field_of(equations, signal), times, starts, part * span.length)
            gap = np.max(np.abs(motion.states_at(times + part * span.length) - direct), axis=0)
            # Degree 10 over a twentieth of the fastest period: see `11`. Late times are rounded:
            # eps of 18 s at 10 rad/s is 4e-14.
            assert np.all(gap <= 1e-13 * np.maximum(motion.amplitude, 1e-2))


@every
def test_pickled_motion_does_not_need_sympy(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    payload = pickle.dumps(motion)
    assert b"sympy" not in payload
    back = pickle.loads(payload)
    times = np.linspace(0, motion.duration, 50)
    np.testing.assert_array_equal(back.end, motion.end)
    np.testing.assert_array_equal(back.inputs(times), motion.inputs(times))
    np.testing.assert_array_equal(back.states_at(times), motion.states_at(times))


# The built-in scenarios have long and large motions.


@every
def test_scenario_lasts_ten_slow_periods_or_five_decay_times(name: str, scenario: str) -> None:
    equations = equations_of(name)
    rest = linearize(equations, equations.system.equilibria[0])
    slowest = min(mode.frequency for mode in modes(rest) if not mode.rigid)
    assert slowest > 0
    periods = built_in(name).scenario(scenario).duration * slowest / (2 * np.pi)
    rates = [-p.value.real for p in poles(rest) if p.value != 0]
    assert periods >= 10 or built_in(name).scenario(scenario).duration * min(rates) >= 5


@pytest.mark.parametrize("name", sorted({name for name, _ in SCENARIOS}))
def test_system_has_three_scenarios_and_a_forced_one(name: str) -> None:
    motions = [motion_of(n, s) for n, s in SCENARIOS if n == name]
    assert len(motions) >= 3
    grid = np.linspace(0, motions[0].duration, 301)
    assert any(np.any(m.inputs(grid[grid <= m.duration]) != 0) for m in motions)
    assert all(np.all(m.movement > 0) for m in motions)


@pytest.mark.parametrize("name", ["drum_pendulum", "simple_pendulum"])
def test_pendulum_swings_beyond_two_and_a_half_radians(name: str) -> None:
    system = built_in(name)
    (angle,) = (i for i, c in enumerate(system.coordinates) if c.unit == "rad")
    largest = max(motion_of(n, s).amplitude[angle] for n, s in SCENARIOS if n == name)
    assert largest >= 2.5


CASES = [
    ("mass_spring_damper", "step", {"k": 31.0, "c": 0.4}),
    ("simple_pendulum", "driven", {"l": 0.52, "m": 0.7}),
]


@pytest.mark.parametrize(("name", "scenario", "constants"), CASES)
def test_motion_matches_equations_derived_at_the_constants(
    name: str, scenario: str, constants: Mapping[str, float]
) -> None:
    system = load_system(builtin() / name)
    family = Family.compile(derive(system))
    actual = solve(family.with_constants(constants), system.scenario(scenario))
    there = at_constants(system, constants)
    expected = solve(derive(there), there.scenario(scenario))
    assert actual.t.shape == expected.t.shape
    size = np.max(np.abs(expected.end), axis=0)
    assert np.max(np.abs(actual.start - expected.start) / size) < 1e-9
    # Segments depend on the constants.
    moved = solve(family.with_constants({}), system.scenario(scenario))
    assert np.max(np.abs(moved.end[: len(actual.end)] - actual.end[: len(moved.end)])) > 1e-3
    assert np.all(actual.bound < 1e-13 * np.maximum(size, 1.0))
    times = np.linspace(0.0, expected.duration, 77)
    assert np.max(np.abs(actual.states_at(times) - expected.states_at(times)) / size) < 1e-9


@pytest.mark.slow
def test_chaotic_motion_has_a_reference() -> None:
    # Newton's method starts too far away, so segments start from a full run.
    system = load_system(builtin() / "drum_pendulum")
    constants = {
        "M": 2.777978231871478, "m": 0.5031382674606564, "l": 0.42104926367495704,
        "k": 78.7854114449368, "g": 9.764055777893367,
    }  # fmt: skip
    actual = solve(
        Family.compile(derive(system)).with_constants(constants), system.scenario("driven")
    )
    there = at_constants(system, constants)
    expected = solve(derive(there), there.scenario("driven"))
    assert actual.t.shape == expected.t.shape
    assert np.all(np.abs(actual.start - expected.start) <= expected.global_bound[:-1] + 1e-12)
    assert np.max(expected.global_bound) > 1e-4
    assert np.all(actual.bound < 1e-12)


def test_second_draw_does_not_derive_or_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    system = load_system(builtin() / "simple_pendulum")
    family = Family.compile(derive(system))
    solve(family.with_constants({}), system.scenario("free"))

    def never(*_: object, **__: object) -> NoReturn:
        raise AssertionError("something is derived or compiled again")

    for name in ("lambdify", "diff", "simplify", "expand"):
        monkeypatch.setattr(sp, name, never)
    solve(family.with_constants({"l": 0.6}), system.scenario("free"))


def test_inputs_use_the_varied_constant() -> None:
    from dataclasses import replace

    system = load_system(builtin() / "mass_spring_damper")
    force = system.inputs[0]
    k = next(c for c in system.constants if c.name == "k")
    pushed = replace(system.scenario("step"), inputs={force: k.symbol / 10})
    system = replace(system, scenarios=(pushed,))
    family = Family.compile(derive(system))
    there = at_constants(system, {"k": 80.0})
    expected = solve(derive(there), there.scenario("step"))
    solve(family.with_constants({}), pushed)
    actual = solve(family.with_constants({"k": 80.0}), pushed)
    assert np.max(np.abs(actual.end - expected.end)) < 1e-12
