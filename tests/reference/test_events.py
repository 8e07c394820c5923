"""Event-driven motions against closed forms, and the configurations that are refused."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import (
    Constant,
    Contact,
    Coordinate,
    DeclarationError,
    DryFriction,
    Output,
    Scenario,
    System,
)
from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.laws.motion import EventError, solve_events
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.interactions import Interaction
from physics_crosscheck.reference.solving.segments import Motion

EVENTS = Path(__file__).parents[2] / "models" / "events"
DIGITS = 3e-14
"""Largest error of a state or of the time of an event, relative to its size."""


@cache
def built_in(name: str) -> tuple[System, dict[str, float]]:
    system = load_system(EVENTS / name)
    return system, {c.name: c.value for c in system.constants}


@cache
def motion(name: str, scenario: str) -> Motion:
    system, _ = built_in(name)
    return solve_events(derive(system), system.scenario(scenario))


def assert_close(values: object, expected: object) -> None:
    np.testing.assert_allclose(np.asarray(values), np.asarray(expected), rtol=DIGITS, atol=DIGITS)


def test_ball_bounces_at_the_times_of_newtons_restitution() -> None:
    _, c = built_in("bouncing_ball")
    impact = np.sqrt(2 * 0.5 / c["g"])
    speed = c["g"] * impact
    flights = [2 * speed * c["e"] ** n / c["g"] for n in range(1, 3)]
    assert_close(motion("bouncing_ball", "drop").events, np.cumsum([impact, *flights]))


def test_pendulum_reaches_its_limit_at_the_time_of_the_elliptic_integral() -> None:
    _, c = built_in("pendulum_stop")
    swing = motion("pendulum_stop", "swing")
    w = mp.sqrt(mp.mpf(c["g"]) / c["l"])
    k = mp.sin(mp.mpf(-1.1) / 2)
    quarter = mp.ellipk(k**2)
    rising = mp.ellipf(mp.asin(mp.sin(mp.mpf(c["limit"]) / 2) / abs(k)), k**2)
    assert_close(swing.events[0], float((quarter + rising) / w))
    # It rebounds with e times its speed, and returns with that speed.
    fast = mp.sqrt(2 * w**2 * (mp.cos(c["limit"]) - mp.cos(1.1)))
    turned = mp.acos(mp.cos(c["limit"]) - (c["e"] * fast) ** 2 / (2 * w**2))
    k = mp.sin(turned / 2)
    there = mp.ellipk(k**2)
    returning = mp.ellipf(mp.asin(mp.sin(mp.mpf(c["limit"]) / 2) / k), k**2)
    assert_close(swing.events[1] - swing.events[0], float(2 * (there + returning) / w))


def test_dry_friction_shortens_each_half_cycle_by_two_deadbands() -> None:
    _, c = built_in("coulomb_oscillator")
    release = motion("coulomb_oscillator", "release")
    half = np.pi * np.sqrt(c["m"] / c["k"])
    assert_close(release.events, half * np.arange(1, 4))
    band = c["F"] / c["k"]
    assert_close(release.end[-1], [-(0.115 - 6 * band), 0])  # the third turn is within the band


@pytest.mark.parametrize("scenario", ["slide", "uphill"])
def test_block_slides_on_an_incline(scenario: str) -> None:
    _, c = built_in("incline_block")
    down = c["g"] * (np.sin(c["th"]) - c["mu"] * np.cos(c["th"]))
    up = c["g"] * (np.sin(c["th"]) + c["mu"] * np.cos(c["th"]))
    sliding = motion("incline_block", scenario)
    if scenario == "slide":
        assert sliding.events == ()
        assert_close(sliding.end[-1], [down / 2, 0, down, 0])
        return
    turn = 2.0 / up
    assert_close(sliding.events, [turn])
    rest = 1.0 - turn
    assert_close(sliding.end[-1], [down * rest**2 / 2 - 2.0**2 / (2 * up), 0, down * rest, 0])


def test_block_sticks_on_a_flat_slope() -> None:
    system, _ = built_in("incline_block")
    constants = tuple(replace(c, value=0.6) if c.name == "mu" else c for c in system.constants)
    steep = replace(system, constants=constants)
    still = solve_events(derive(steep), steep.scenario("slide"))
    assert still.events == ()
    assert np.all(still.end == 0)


def test_block_stops_after_its_stopping_distance() -> None:
    _, c = built_in("stopping_block")
    stop = motion("stopping_block", "stop")
    assert_close(stop.events, [2.0 / (c["mu"] * c["g"])])
    assert_close(stop.end[-1], [2.0**2 / (2 * c["mu"] * c["g"]), 0, 0, 0])


@pytest.mark.parametrize(("scenario", "spin"), [("skid", 0.0), ("back spin", -30.0)])
def test_ball_skids_until_it_rolls(scenario: str, spin: float) -> None:
    _, c = built_in("skidding_ball")
    skid = motion("skidding_ball", scenario)
    slip = 1.0 - c["R"] * spin
    assert_close(skid.events, [2 * slip / (7 * c["mu"] * c["g"])])
    speed = (5 * 1.0 + 2 * c["R"] * spin) / 7
    assert_close(skid.end[-1][[3, 5]], [speed, speed / c["R"]])


def test_ball_rolls_down_a_slope() -> None:
    _, c = built_in("slope_ball")
    rolling = motion("slope_ball", "roll")
    a = 5 / 7 * c["g"] * np.sin(c["th"])
    assert rolling.events == ()
    assert_close(rolling.end[-1][[0, 3, 5]], [a / 2, a, a / c["R"]])


def test_ball_slides_down_a_steep_slope() -> None:
    system, c = built_in("slope_ball")
    constants = tuple(replace(x, value=0.1) if x.name == "mu" else x for x in system.constants)
    smooth = replace(system, constants=constants)
    sliding = solve_events(derive(smooth), smooth.scenario("roll"))
    a = c["g"] * (np.sin(c["th"]) - 0.1 * np.cos(c["th"]))
    turn = 5 / 2 * 0.1 * c["g"] * np.cos(c["th"]) / c["R"]
    assert_close(sliding.end[-1][[0, 3, 5]], [a / 2, a, turn])


def test_belt_drags_until_the_spring_exceeds_the_friction() -> None:
    _, c = built_in("belt_oscillator")
    drag = motion("belt_oscillator", "drag")
    w, shift = np.sqrt(c["k"] / c["m"]), c["mu"] * c["m"] * c["g"] / c["k"]
    # Slipping backward, friction drags forward: a cosine about its force over k.
    amplitude = -shift
    first = np.arcsin(c["V_belt"] / (-amplitude * w)) / w
    place = shift + amplitude * np.cos(w * first)
    lets_go = first + (shift - place) / c["V_belt"]
    assert_close(drag.events[:2], [first, lets_go])


def test_buffer_holds_a_cart_until_its_force_is_zero() -> None:
    _, c = built_in("buffered_cart")
    bump = motion("buffered_cart", "bump")
    w0 = np.sqrt(c["k"] / c["m"])
    touch = c["x0"] / 1.5
    contact = np.pi / w0
    assert_close(bump.events, [touch, touch + contact])
    assert_close(bump.end[-1][1], -1.5)


def test_balls_collide_in_the_order_of_their_gaps() -> None:
    _, c = built_in("ball_train")
    hit = motion("ball_train", "hit")
    m1, m2, m3, e = (c[name] for name in ("m1", "m2", "m3", "e"))
    v1, v2 = (m1 - e * m2) / (m1 + m2), (1 + e) * m1 / (m1 + m2)
    second = 0.2 + 0.1 / v2
    v2, v3 = (m2 - e * m3) / (m2 + m3) * v2, (1 + e) * m2 / (m2 + m3) * v2
    assert_close(hit.events[:2], [0.2, second])
    assert_close(hit.end[-1][5], v3)
    assert v2 < v1
    assert len(hit.events) == 3  # the first ball hits the second one again


def test_servo_leaves_its_limit_on_a_parabola() -> None:
    _, c = built_in("saturated_servo")
    a = c["F"] / c["m"]
    # kp (target - a t^2 / 2) - kd a t = F
    leaves = (-c["kd"] * a + np.sqrt(
        (c["kd"] * a) ** 2 + 2 * c["kp"] * a * (c["kp"] * c["target"] - c["F"])
    )) / (c["kp"] * a)  # fmt: skip
    assert_close(motion("saturated_servo", "move").events[0], leaves)


@pytest.mark.parametrize(
    ("scenario", "first", "speed"), [("push", 0.0, 0.0), ("turn back", -40.0, 0.5)]
)
def test_motor_follows_its_filter_to_its_limit(scenario: str, first: float, speed: float) -> None:
    _, c = built_in("filtered_motor")
    lag, last, slow = c["J"] / c["d"], c["M"] / c["d"], c["m"] / c["c"]
    limit = c["F"] / c["k"]

    def reached(rate: float, start: float) -> float:
        """Return the time after which the rotor has a rate."""
        return lag * float(np.log((last - start) / (last - rate)))

    def held(force: float, v: float, time: float) -> tuple[float, float]:
        """Return distance and velocity under a constant force."""
        end, decay = force / c["c"], np.exp(-time / slow)
        return end * time + (v - end) * slow * (1 - decay), end + (v - end) * decay

    def lagging(start: float, v: float, time: float) -> tuple[float, float]:
        """Return the same under the force of the filter, by partial fractions."""
        steady, fade = held(c["k"] * last, v, time), c["k"] * (start - last) / c["m"]
        share = fade / (1 / slow - 1 / lag)  # of e^(-t/lag) - e^(-t/slow) in the velocity
        quick, decay = np.exp(-time / lag), np.exp(-time / slow)
        return (
            steady[0] + share * (lag * (1 - quick) - slow * (1 - decay)),
            steady[1] + share * (quick - decay),
        )

    x, v, now, start, events = 0.0, speed, 0.0, first, []
    if first < -limit:
        now = reached(-limit, first)
        x, v = held(-c["F"], v, now)
        events, start = [now], -limit
    span = reached(limit, start)
    far, v = lagging(start, v, span)
    events.append(now + span)
    more, v = held(c["F"], v, 0.6 - events[-1])
    pushed = motion("filtered_motor", scenario)
    assert_close(pushed.events, events)
    rate = last + (first - last) * np.exp(-0.6 / lag)
    turned = last * 0.6 + (first - last) * lag * (1 - np.exp(-0.6 / lag))
    assert_close(pushed.end[-1], [x + far + more, turned, v, rate])


def tipping_speed(c: dict[str, float], edge: int, start: Any, stop: Any, speed: Any = 0) -> Any:
    """Return the angular velocity of a box at a second angle about an edge: 1 downhill, -1 uphill.

    Its moment of inertia about the edge is 4/3 m r^2.
    """
    b, h, slope = (mp.mpf(c[name]) for name in ("b", "h", "slope"))

    def potential(a: Any) -> Any:
        below = edge * b * mp.sin(a) + h * mp.cos(a)
        beyond = edge * b * mp.cos(a) - h * mp.sin(a)
        return below * mp.cos(slope) + beyond * mp.sin(slope)

    fall = potential(start) - potential(stop)
    return mp.sqrt(speed**2 + 2 * mp.mpf(c["g"]) * fall / (mp.mpf(4) / 3 * (b**2 + h**2)))


def tipping_time(c: dict[str, float], edge: int, start: Any, stop: Any, speed: Any = 0) -> float:
    """Return the time in which a box turns about an edge, by its energy."""
    with mp.workdps(30):
        between = [mp.mpf(start), mp.mpf(stop)]
        return float(mp.quad(lambda a: 1 / tipping_speed(c, edge, between[0], a, speed), between))


@pytest.mark.slow
def test_edge_stays_closed_along_a_motion() -> None:
    # Integration alone drifts by 1e-13 m/s, which an engine undoes in its first step.
    constants = {"b": 0.0528, "h": 0.217, "g": 12.37, "slope": 0.405, "mu": 0.781}
    system = at_constants(built_in("tipping_box")[0], constants)
    _, z, angle, _, rise, turning = solve_events(derive(system), system.scenario("tip")).start.T
    b, h = constants["b"], constants["h"]
    np.testing.assert_allclose(z, b * np.sin(angle) + h * np.cos(angle), rtol=0, atol=1e-15)
    rate = (b * np.cos(angle) - h * np.sin(angle)) * turning
    np.testing.assert_allclose(rise, rate, rtol=0, atol=1e-15)


@pytest.mark.slow
def test_rocking_box_lands_with_the_angular_momentum_about_its_new_edge() -> None:
    _, c = built_in("tipping_box")
    rock = motion("tipping_box", "rock")
    assert_close(rock.events, [tipping_time(c, -1, -0.1, 0)])
    ratio = 1 - 1.5 * c["b"] ** 2 / (c["b"] ** 2 + c["h"] ** 2)  # Housner (1963)
    landed = ratio * float(tipping_speed(c, -1, mp.mpf(-0.1), 0))
    assert_close(tipping_time(c, 1, 0, rock.end[-1][2], landed), 0.25 - rock.events[0])


def test_ball_lands_on_a_damped_spring() -> None:
    system, c = built_in("soft_landing")
    sidecar = read_sidecar(EVENTS / "soft_landing" / "mujoco.xml.toml")
    land = solve_events(derive(system), system.scenarios[0], sidecar.laws)
    (softness,) = (law.softness for law in sidecar.laws.values())
    (time, ratio), d, g = softness.reference, softness.impedance[0], c["g"]
    # While pressed z'' = -(1 - d) g - 2 z'/T - z/(T Z)^2.
    # The force per mass is z'' + g.
    rest = -(1 - d) * g * (time * ratio) ** 2
    w = np.sqrt(1 / (time * ratio) ** 2 - 1 / time**2)
    fast = -np.sqrt(2 * g * 0.2)

    def pressed(s: Any) -> Any:  # of mpmath, which has no types
        swing = -rest * mp.cos(w * s) + (fast - rest / time) / w * mp.sin(w * s)
        return rest + mp.exp(-s / time) * swing

    def force(s: Any) -> Any:
        return d * g - 2 / time * mp.diff(pressed, s) - pressed(s) / (time * ratio) ** 2

    with mp.workdps(30):
        contact = mp.findroot(force, (0.5 / w, 2.5 / w), solver="anderson", tol=1e-20)
        depth, leaves = float(pressed(contact)), float(mp.diff(pressed, contact))
    flight = (leaves + np.sqrt(leaves**2 + 2 * g * depth)) / g
    touch = -fast / g
    assert_close(land.events[:3], np.cumsum([touch, float(contact), flight]))


def test_segments_centre_each_event_or_keep_a_coarsest_step_away() -> None:
    for name, scenario in [("bouncing_ball", "drop"), ("belt_oscillator", "drag")]:
        laid = motion(name, scenario)
        for event in laid.events:
            offset = np.abs(event - laid.t - laid.lengths / 2) / laid.lengths
            assert np.sum(offset < 1e-12) == 1
            assert np.all((offset < 1e-12) | (offset > 0.5 + 1 / 3 - 1e-9))


x, y, angle = (Coordinate(name, unit, name) for name, unit in
               (("x", "m"), ("y", "m"), ("angle", "rad")))  # fmt: skip
MASS = Constant("m", 1.0, "kg", "mass", "test")
HALF = Constant("half", 1.0, "m", "half of the rod", "test")
INERTIA = Constant("J", 1 / 3, "kg*m^2", "moment of inertia", "test")
GRAVITY = Constant("g", 9.81, "m/s^2", "gravity", "test")


def planar(interactions: tuple[Interaction, ...], scenario: Scenario) -> System:
    return System(
        name="rod", title="rod", source="test", coordinates=(x, y, angle),
        constants=(MASS, HALF, INERTIA, GRAVITY), inputs=(),
        outputs=(Output("x", x.q, "m", "x"),),
        T=MASS * (x.v**2 + y.v**2) / 2 + INERTIA * angle.v**2 / 2,
        V=MASS * GRAVITY * y.q, D=0, equilibria=(), scenarios=(scenario,), published=(),
        interactions=interactions,
    )  # fmt: skip


def test_rod_that_jams_is_refused() -> None:
    tip = y.q - HALF * sp.sin(angle.q)
    slip = x.v + HALF * sp.sin(angle.q) * angle.v
    start = Scenario("jam", "slides on its tip", q={x: 0, y: sp.sin(1.1), angle: 1.1},
                     v={x: -1.0, y: 0, angle: 0}, inputs={}, duration=0.5)  # fmt: skip
    rod = planar((Contact("tip", gap=tip, slip=slip, mu=2.5, e=0),), start)
    with pytest.raises(EventError, match="Painleve"):
        solve_events(derive(rod), rod.scenarios[0])
    # Sliding the other way lifts no weight from the tip, so it is not refused.
    back = replace(start, v={x: 1.0, y: 0, angle: 0}, duration=0.05)
    dragged = replace(rod, scenarios=(back,))
    assert solve_events(derive(dragged), back).events == ()


@pytest.mark.parametrize(("mu", "spin"), [(0.1, 0.0), (0.4, 0.0), (0.4, -9.0), (0.0, 3.0)])
def test_impact_friction_includes_compression_and_restitution(mu: float, spin: float) -> None:
    """Catch friction of the compression alone, and slip that continues beyond sticking."""
    e, fall = 0.5, np.sqrt(2 * 9.81 * 0.1)
    # A disc: impulses act on the normal direction by 1, and on the slip by 1 + 1 / J.
    slip, normal, across = 1.0 - spin, 0.0, 0.0
    for part in (fall, e * fall):
        needed = -(slip + 4 * across) / 4
        normal, across = normal + part, across + float(np.clip(needed, -mu * part, mu * part))
    start = Scenario("thrown", "falls on its rim", q={x: 0, y: 1.1, angle: 0},
                     v={x: 1.0, y: 0, angle: spin}, inputs={}, duration=0.2)  # fmt: skip
    rim = Contact("rim", gap=y.q - HALF, slip=x.v - HALF * angle.v, mu=mu, e=e)
    thrown = solve_events(derive(planar((rim,), start)), start)
    (impact,) = thrown.events
    assert_close(thrown.end[-1][3:], [1 + across, normal - fall - 9.81 * (0.2 - impact),
                                      spin - 3 * across])  # fmt: skip


def test_impact_that_gains_energy_is_refused() -> None:
    """Newton's restitution 1 of a rod that slips little: friction would add to its energy."""
    tip = y.q - HALF * sp.sin(angle.q)
    slip = x.v + HALF * sp.sin(angle.q) * angle.v
    start = Scenario("hit", "falls on its tip", q={x: 0, y: 0.76, angle: sp.pi / 4},
                     v={x: 0.2, y: 0, angle: 0}, inputs={}, duration=0.2)  # fmt: skip
    rod = planar((Contact("tip", gap=tip, slip=slip, mu=0.8, e=1),), start)
    with pytest.raises(EventError, match="gains energy"):
        solve_events(derive(rod), start)
    softer = planar((Contact("tip", gap=tip, slip=slip, mu=0.8, e=0.5),), start)
    assert len(solve_events(derive(softer), start).events) == 1


def test_simultaneous_impacts_are_refused() -> None:
    ends = [
        Contact(f"end {sign}", gap=y.q + sign * HALF * sp.sin(angle.q), slip=0, mu=0, e=0.5)
        for sign in (1, -1)
    ]
    start = Scenario("drop", "falls flat", q={x: 0, y: 0.5, angle: 0},
                     v={x: 0, y: 0, angle: 0}, inputs={}, duration=0.5)  # fmt: skip
    falling = planar(tuple(ends), start)
    with pytest.raises(EventError, match="end -1 and end 1 act at once"):
        solve_events(derive(falling), falling.scenarios[0])


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (DryFriction("rub", slip=x.v, force=sp.Symbol("stray", real=True)), "force uses stray"),
        (DryFriction("rub", slip=x.v, force=-GRAVITY), "force is -9.81; write a number of at"),
        (Contact("floor", gap=y.q, slip=0, mu=-0.3, e=0), "mu is -0.3; write a number of at"),
        (Contact("floor", gap=y.q, slip=0, mu=0, e=-HALF / HALF), "e is -1; write a number of at"),
        (Contact("floor", gap=y.q**2, slip=0, mu=0, e=0), "is never negative"),
        (Contact("floor", gap=(y.q - HALF) ** 2, slip=0, mu=0, e=0), "is never negative"),
    ],
)
def test_interaction_with_a_wrong_number_or_symbol_is_refused(
    item: Interaction, message: str
) -> None:
    start = Scenario("s", "s", q=dict.fromkeys((x, y, angle), 0), v=dict.fromkeys((x, y, angle), 0),
                     inputs={}, duration=0.5)  # fmt: skip
    with pytest.raises(DeclarationError, match=re.escape(message)):
        planar((item,), start)


def test_motion_too_long_for_its_events_is_refused() -> None:
    system = load_system(EVENTS / "bouncing_ball")
    long = replace(system.scenario("drop"), duration=1e5)
    with pytest.raises(EventError, match="shorten the motion"):
        solve_events(derive(system), long)


@pytest.mark.parametrize(
    ("height", "speed", "message"),
    [
        (0, -1.5, "starts with an impact: floor is closed, and its gap falls by 1.5 m/s"),
        (-0.01, 1.5, "starts inside floor, where the gap is -0.01 m"),
    ],
)
def test_motion_that_starts_in_a_contact_is_refused(
    height: float, speed: float, message: str
) -> None:
    system = load_system(EVENTS / "bouncing_ball")
    (z,) = system.coordinates
    low = replace(system.scenario("drop"), q={z: height}, v={z: speed})
    with pytest.raises(EventError, match=re.escape(message)):
        solve_events(derive(system), low)


def test_accumulating_impacts_are_rejected_with_a_valid_duration() -> None:
    system, c = built_in("bouncing_ball")
    rest = np.sqrt(1 / c["g"]) * (1 + c["e"]) / (1 - c["e"])
    long = replace(system.scenario("drop"), duration=1.1 * rest)
    with pytest.raises(EventError, match=r"end the motion before t = 2\.\d+ s"):
        solve_events(derive(system), long)
