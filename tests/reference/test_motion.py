"""The motion as a value: its segments, its interpolation, and its serialization."""

import pickle

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.dynamics.modes import modes, poles
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.solving.collocation import collocate
from physics_crosscheck.reference.solving.integrate import field_of
from physics_crosscheck.reference.solving.segments import NODES, chebyshev_nodes
from physics_crosscheck.reference.solving.solve import SEGMENTS_A_PERIOD, SEGMENTS_AT_LEAST
from tests.reference.mechanisms import EPS, SCENARIOS, built_in, equations_of, motion_of

every = pytest.mark.parametrize(("name", "scenario"), SCENARIOS)


@every
def test_segments_tile_the_duration_in_prime_numbers(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    declared = built_in(name).scenario(scenario)
    assert all(sp.isprime(span.count) for span in motion.spans)
    assert len(motion.t) == sum(span.count for span in motion.spans) >= SEGMENTS_AT_LEAST == 200
    assert motion.t[0] == 0
    assert motion.duration == pytest.approx(declared.duration, rel=4 * EPS)
    np.testing.assert_allclose(
        np.diff(motion.t), motion.lengths[:-1], rtol=0, atol=4 * EPS * motion.duration
    )
    assert np.all(motion.lengths * motion.fastest <= 2 * np.pi / SEGMENTS_A_PERIOD * (1 + EPS))
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
def test_nodes_begin_at_the_start_and_stop_at_the_end(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    assert motion.nodes.shape == (len(motion.t), NODES, motion.start.shape[1])
    np.testing.assert_allclose(motion.nodes[:, 0], motion.start, rtol=0, atol=4 * EPS)
    gap = np.max(np.abs(motion.nodes[:, -1] - motion.end), axis=0)
    assert np.all(gap <= 2 * EPS * motion.amplitude)


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
            # Degree 10 over a twentieth of the fastest period: see `NODES`. Late times are rounded:
            # eps of 18 s at 10 rad/s is 4e-14.
            assert np.all(gap <= 1e-13 * np.maximum(motion.amplitude, 1e-2))


@every
def test_motion_at_its_nodes_equals_the_nodes(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    np.testing.assert_array_equal(motion.states_at(motion.t), motion.nodes[:, 0])
    inner = motion.t[3] + motion.lengths[3] * chebyshev_nodes()[1:-1]
    gap = np.max(np.abs(motion.states_at(inner) - motion.nodes[3, 1:-1]), axis=0)
    # The node's time is rounded: eps of the time, at the component's rate.
    assert np.all(gap <= 8 * EPS * motion.amplitude * max(1, motion.fastest))


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
