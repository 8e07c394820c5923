"""Steps of pymunk against the law of its impulses, and planted faults."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, ModelSpec
from physics_crosscheck.harness.checks.acting import planar_quantities
from physics_crosscheck.harness.checks.planar_step import (
    PlanarSample,
    check_planar_step,
    compare,
    drawn_states,
)
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck
from physics_crosscheck.harness.engines.protocol import PlanarWhole
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.laws.planar import PlanarModel
from tests.models import written

HEAD = """import pymunk

def build():
    space = pymunk.Space()
    space.gravity = (0, -9.81)
    ground = space.static_body
    bodies = {}

    def body(name, mass, moment, place, center=(0, 0)):
        bodies[name] = one = pymunk.Body(mass, moment)
        one.position, one.center_of_gravity = place, center
        space.add(one)
        return one

"""

TAIL = """
    return space, bodies
"""

BALL = (
    HEAD
    + """    space.collision_slop = 0.001
    floor = pymunk.Segment(ground, (-3, 0), (3, 0.2), 0.02)
    floor.friction, floor.elasticity = 0.1, 0.5
    ball = pymunk.Circle(body("ball", 1.2, 0.01, (0, 0.4)), 0.15)
    ball.friction, ball.elasticity = 0.9, 0.6
    space.add(floor, ball)
"""
    + TAIL
)

STACK = (
    HEAD
    + """    space.collision_bias = 0.001
    space.iterations = 12
    floor = pymunk.Segment(ground, (-3, 0), (3, 0), 0.02)
    floor.friction, floor.surface_velocity = 0.7, (0.3, 0)
    space.add(floor)
    for k in range(2):
        box = pymunk.Poly.create_box(body(f"box{k}", 1 + k, 0.02, (0.05 * k, 0.15 + 0.25 * k)),
                                     (0.4, 0.2), 0.01)
        box.friction, box.elasticity = 0.5, 0.2 * k
        space.add(box)
"""
    + TAIL
)

JOINTS = (
    HEAD
    + """    space.damping = 0.9
    a = body("a", 1.2, 0.01, (0, 0.4))
    b = body("b", 0.8, 0.02, (0.1, 0.8), (0.02, 0.01))
    c = body("c", 0.5, 0.01, (1, 0.8))
    d = body("d", 0.3, 0.004, (1, 0.5))
    limit = pymunk.RotaryLimitJoint(a, b, -0.3, 0.4)
    limit.max_force = 4
    motor = pymunk.SimpleMotor(ground, b, 2.0)
    motor.max_force = 0.4
    pivot = pymunk.PivotJoint(c, d, (1, 0.65))
    pivot.max_force, pivot.max_bias = 30, 0.05
    gear = pymunk.GearJoint(c, d, 0.2, 2.5)
    gear.max_force = 3
    pin = pymunk.PinJoint(b, d, (0.1, 0), (0, 0.05))
    pin.max_bias, pin.error_bias = 2, 0.01
    space.add(
        limit, motor, pivot, gear, pin,
        pymunk.SlideJoint(ground, a, (0, 1), (0.05, 0), 0.1, 0.9),
        pymunk.DampedSpring(a, b, (0, 0.1), (0.1, 0), 0.3, 20, 0.5),
        pymunk.DampedRotarySpring(a, b, 0.1, 2, 0.05),
        pymunk.GrooveJoint(ground, c, (0.9, 0.8), (1.1, 0.85), (0, 0.05)),
    )
"""
    + TAIL
)


STEP = {"step": 0.004}


def checked(tmp_path: Path, text: str, loaded: str = "") -> WholeStepCheck | None:
    """Compare the law of a text with pymunk on the same text or another one."""
    pytest.importorskip("pymunk")
    file, copy = tmp_path / "space.py", tmp_path / "copy.py"
    file.write_text(text)
    copy.write_text(loaded or text)
    return check_planar_step(
        ModelSpec(file, settings=STEP), ModelSpec(copy, settings=STEP), "pymunk", 1e-9
    )


def test_ball_follows_its_law(tmp_path: Path) -> None:
    """Catch a check that compares nothing, or with other numbers."""
    check = checked(tmp_path, BALL)
    assert check is not None
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert "contacts" in {term.name for term in check.record.acted}


@cache
def sound(folder: Path, space: str) -> tuple[list[tuple[Array, Array]], list[PlanarSample]]:
    """Return drawn states of a Space, and both steps there."""
    file = written(folder, "space.py", space)
    whole = engines()["pymunk"].load_planar(ModelSpec(file, settings=STEP))
    assert whole is not None
    law, states = PlanarModel(laws=whole.laws), list(drawn_states(whole, whole.laws))
    return states, [PlanarSample.from_state(law, whole, *state) for state in states]


@pytest.mark.parametrize("space", [STACK, JOINTS], ids=["stack", "joints"])
def test_every_joint_and_contact_follows_its_law(
    tmp_path_factory: pytest.TempPathFactory, space: str
) -> None:
    """Catch a joint, a spring, a mixing rule or a cached impulse that is stated wrong."""
    pytest.importorskip("pymunk")
    _, samples = sound(tmp_path_factory.getbasetemp(), space)
    compared = compare(samples, STEP["step"])
    assert np.all(np.abs(compared.defect) <= np.maximum(compared.uncertainty, 1e-12))
    acted = {name for one in samples for state in one.law for name, count in state.acted if count}
    assert acted >= ({"limits", "motors", "springs", "joints"} if space == JOINTS else {"contacts"})


FAULTS = {
    "friction": (BALL, "ball.elasticity = 0.9", "ball.elasticity = 0.900001"),
    "elasticity": (BALL, "0.9, 0.6", "0.9, 0.600001"),
    "slop": (BALL, "space.collision_slop = 0.001", ""),
    "bias": (STACK, "collision_bias = 0.001", "collision_bias = 0.00100001"),
    "iterations": (STACK, "iterations = 12", "iterations = 11"),
    "surface velocity": (STACK, "(0.3, 0)", "(0.300001, 0)"),
    "limit": (JOINTS, "-0.3, 0.4)", "-0.3, 0.400001)"),
    "limit's force": (JOINTS, "max_force = 4", "max_force = 4.000004"),
    "motor": (JOINTS, "b, 2.0)", "b, -2.0)"),
    "motor's torque": (JOINTS, "max_force = 0.4", "max_force = 0.4000004"),
    "slide": (JOINTS, "0.1, 0.9)", "0.1, 0.900001)"),
    "gear": (JOINTS, "0.2, 2.5)", "0.2, 2.500001)"),
    "error_bias": (JOINTS, "= 2, 0.01", "= 2, 0.0100001"),
    "max_bias": (JOINTS, "30, 0.05", "30, 0.05000005"),
    "spring": (JOINTS, "20, 0.5)", "20, 0.5000005)"),
    "rotary spring": (JOINTS, "2, 0.05)", "2.000002, 0.05)"),
    "center": (JOINTS, "(0.02, 0.01)", "(0.020001, 0.01)"),
    "damping": (JOINTS, "damping = 0.9", "damping = 0.900001"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_changed_number_is_detected(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, fault: str
) -> None:
    """Catch a number that no drawn state depends on."""
    pytest.importorskip("pymunk")
    space, right, wrong = FAULTS[fault]
    assert right in space
    states, samples = sound(tmp_path_factory.getbasetemp(), space)
    copy = written(tmp_path, "copy.py", space.replace(right, wrong, 1))
    engine = engines()["pymunk"].load_planar(ModelSpec(copy, settings=STEP))
    assert engine is not None
    stepped = [
        replace(sample, engine=engine.evaluate(*state))
        for state, sample in zip(states, samples, strict=True)
    ]
    compared = compare(stepped, STEP["step"])
    assert np.any(np.abs(compared.defect) > np.maximum(compared.uncertainty, 1e-9))


def test_copy_is_compared_with_the_numbers_of_its_source(tmp_path: Path) -> None:
    """Catch a law that takes the numbers of the file that the engine loads."""
    space, right, wrong = FAULTS["friction"]
    check = checked(tmp_path, space, space.replace(right, wrong, 1))
    assert check is not None
    assert check.record.outcome is Outcome.DIFFERS


def test_space_of_smooth_joints_alone_is_not_compared(tmp_path: Path) -> None:
    """Catch steps of the built-in systems that their equations cover already."""
    smooth = HEAD + '    space.add(pymunk.PinJoint(ground, body("a", 1, 1, (1, 0))))\n' + TAIL
    assert checked(tmp_path, smooth) is None


def test_parts_without_a_law_are_named(tmp_path: Path) -> None:
    """Catch a comparison that passes although a callback or a ratchet acts."""
    ratchet = BALL.replace(
        "space.add(floor", "space.add(pymunk.RatchetJoint(ball.body, ground, 0, 1), floor"
    )
    callback = BALL.replace("space.add(floor", "space.on_collision(begin=print); space.add(floor")
    for text, name in ((ratchet, "RatchetJoint"), (callback, "callbacks")):
        check = checked(tmp_path, text)
        assert check is not None
        assert check.record.outcome is None
        assert name in check.record.uncovered[0]


def test_body_turns_about_its_center_of_mass(tmp_path: Path) -> None:
    """Catch a start that moves a body when it is turned, and velocities of another point."""
    pytest.importorskip("pymunk")
    file = tmp_path / "space.py"
    file.write_text(HEAD.replace("-9.81", "0") + '    body("a", 1, 1, (0, 0), (0.3, 0.1))\n' + TAIL)
    model = engines()["pymunk"].load(ModelSpec(file, settings=STEP))
    z, w = np.array([[1.0, 2.0, 0.7]]), np.array([[0.5, -0.2, 3.0]])
    places, rates = model.rollout(z, w, 1e-6, 1, None, 1)
    assert (places[0, 0] - z[0]) / 1e-6 == pytest.approx(w[0], abs=1e-5)
    assert rates[0, 0] == pytest.approx(w[0], abs=1e-5)


BOX = (
    HEAD
    + """    space.collision_slop = 0.002
    floor = pymunk.Segment(ground, (-9, 0), (9, 0), 0.02)
    box = pymunk.Poly.create_box(body("box", 1.2, 0.01, (0, 0.12)), (0.4, 0.2))
    floor.friction, floor.elasticity = 0.5, 0.9
    box.friction, box.elasticity = 0.4, 0.7
    space.add(floor, box)
"""
    + TAIL
)

SLIDE = (
    HEAD.replace("-9.81", "0")
    + """    space.damping = 0.6
    a = body("a", 1.2, 0.01, (0, 0.4))
    b = body("b", 0.8, 0.02, (1, 0.8))
    space.add(
        pymunk.RotaryLimitJoint(ground, a, -0.3, 0.4),
        pymunk.DampedSpring(ground, b, (1, 0), (0, 0), 0.5, 20, 0.4),
    )
"""
    + TAIL
)


def acting(tmp_path: Path, text: str) -> tuple[dict[tuple[str, str], float], PlanarWhole]:
    """Return the quantities that a Space's numbers act as, and the Space."""
    pytest.importorskip("pymunk")
    file = written(tmp_path, "space.py", text)
    spec = ModelSpec(file, settings=STEP)
    rows = planar_quantities(spec, "pymunk")
    whole = engines()["pymunk"].load_planar(spec)
    assert whole is not None
    return {(row.subject, row.quantity): float(row.value or 0.0) for row in rows}, whole


def moved(
    whole: PlanarWhole, speed: tuple[float, ...], steps: int, lift: float = 0.0
) -> np.ndarray:
    """Return places and velocities of the last body, (2, 3), after steps from a speed."""
    places, speeds = whole.home.copy(), np.zeros_like(whole.speeds)
    places[-1, 1] += lift
    speeds[-1] = speed
    return np.array([part[-1] for part in whole.moved(places, speeds, steps)])


def test_contacts_act_as_stated(tmp_path: Path) -> None:
    """Catch a friction or bounce that is not the product, another depth, or another recovery."""
    table, whole = acting(tmp_path, BOX)
    subject, h = "ground with box", whole.laws.step
    slid = moved(whole, (3, 0, 0), 50)[1]
    assert 3 - slid[0] == pytest.approx(table[subject, "friction"] * 9.81 * 50 * h, rel=1e-6)
    before, after = (moved(whole, (0, -2, 0), n, lift=0.01)[1][1] for n in (1, 2))
    assert -after / before == pytest.approx(table[subject, "restitution"], rel=1e-3)
    depth, tau = table[subject, "rest depth"], table[subject, "time constant"]
    assert moved(whole, (0, 0, 0), 20, lift=-0.9 * depth)[0][1] == pytest.approx(0.12 - 0.9 * depth)
    penetration = 0.12 - depth - moved(whole, (0, 0, 0), 21, lift=-3 * depth)[0][1]
    assert penetration == pytest.approx(2 * depth * np.exp(-20 * h / tau), rel=1e-3)


def test_joints_and_damping_act_as_stated(tmp_path: Path) -> None:
    """Catch a rebound, frequency or damping by another mass, step or share."""
    table, whole = acting(tmp_path, SLIDE)
    h, bound = whole.laws.step, table["rotary limit of ground and a", "rebound"]
    rebounds = []
    for phase in np.linspace(0.02, 0.98, 25):
        places, speeds = whole.home.copy(), np.zeros_like(whole.speeds)
        places[1, 2], speeds[1, 2] = 0.4 - phase * h, 1.0
        rebounds.append(-whole.moved(places, speeds, 30)[1][1, 2] / 0.6 ** (30 * h))
    assert bound / 2 < max(rebounds) <= bound * 1.05
    spring, lost = "spring of ground and b", 1 / table["damping of all bodies", "time constant"]
    rate = 2 * np.pi * table[spring, "natural frequency"]
    decay = rate * table[spring, "damping ratio"] + lost / 2
    fast = np.sqrt(rate**2 - decay**2)
    for steps in (60, 200):
        t = steps * h
        swing = np.exp(-decay * t) * (np.cos(fast * t) + decay / fast * np.sin(fast * t))
        assert moved(whole, (0, 0, 0), steps, lift=0.1)[0][1] == pytest.approx(
            0.5 + 0.4 * swing, abs=4e-3
        )
