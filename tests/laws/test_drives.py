"""Drives against closed forms: limits, filters and muscles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from physics_crosscheck import ForceElement, Joint, RigidBody
from physics_crosscheck.reference.laws.drives import Driven, drive, unsaturated
from physics_crosscheck.reference.laws.mechanics import LawTree, Posture
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.laws import Actuator, Laws
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY
from physics_crosscheck.reference.mechanism.tree import WORLD

STEP = 0.01
CART = RigidBody(
    name="cart", parent=None, joints=(Joint(name="x", kind="slide", axis=(1, 0, 0)),), mass=2.0
)


def cart(
    drives: tuple[dict[str, Any], ...], x: float, v: float, **laws: Any
) -> tuple[Laws, Posture]:
    """Return drives on a cart, each with its own path, and the cart at a state."""
    pulls = [ForceElement(name=f"p{i}", joints=(("x", 1.0),)) for i in range(len(drives))]
    tree = assembled([CART], (0, 0, 0), pulls).tree
    whole = LawTree(
        tree=replace(tree, pulls=()), paths=tree.pulls, bodies=((WORLD, IDENTITY),),
        masses=np.zeros(1), centers=np.zeros((1, 3)),
    )  # fmt: skip
    numbers = tuple(Actuator(path=i, **{"control": 0, **one}) for i, one in enumerate(drives))
    posture = next(whole.postures(np.array([[x]]), np.array([[v]])))
    return Laws(step=STEP, integrator="euler", drives=numbers, **laws), posture


def driven(
    *drives: dict[str, Any],
    x: float = 0.3,
    v: float = -0.2,
    control: float = 2.0,
    state: float = 0.4,
    **laws: Any,
) -> Driven:
    """Return the forces of drives on a cart."""
    accelerations, states = np.full(len(drives), 0.5), np.array([state])
    return drive(*cart(drives, x, v, **laws), accelerations, np.array([control]), states)


def test_servo_limits_follow_its_file() -> None:
    """Catch limits that are ignored, or applied in another order: control, force, joint."""
    servo = {"gains": (40.0,), "bias": "affine", "biases": (0.0, -40.0, -2.0)}
    free = 40 * (2.0 - 0.3) + 2.0 * 0.2
    assert driven(servo).forces[0] == pytest.approx(free)
    within = driven({**servo, "control_range": (-1.0, 1.0)}).forces[0]
    assert within == pytest.approx(40 * (1.0 - 0.3) + 0.4)
    limited = driven(
        {**servo, "force_range": (-3.0, 3.0)}, servo, joint_ranges={0: ((-9, 9), False)}
    )
    assert limited.forces == pytest.approx([3.0, free])
    assert limited.joint_forces == pytest.approx([9.0])
    assert limited.damping == pytest.approx(0.0)
    assert driven(servo).damping == pytest.approx(2.0)


SERVO = {"gains": (40.0,), "bias": "affine", "biases": (0.0, -40.0, -2.0)}


@pytest.mark.parametrize(("drives", "laws"), [
    ([{**SERVO, "force_range": (0.0, 100.0)}], {}),
    ([{**SERVO, "force_range": (-90.0, -10.0)}], {}),
    ([SERVO, {**SERVO, "control": 1}], {"sums": (((0, 1), (0.0, 100.0)),)}),
    ([SERVO, {**SERVO, "control": 1}], {"joint_ranges": {0: ((20.0, 100.0), False)}}),
    ([{**SERVO, "force_range": (0.0, 100.0)}], {"joint_ranges": {0: ((-50.0, 20.0), False)}}),
])  # fmt: skip
def test_range_on_one_side_of_zero_is_drawn_inside(
    drives: list[dict[str, Any]], laws: dict[str, Any]
) -> None:
    """Catch controls that put each drive at its limit if its range starts at zero or beyond."""
    numbers, posture = cart(tuple(drives), 0.3, -0.2, **laws)
    ones = np.ones(len(drives))
    forces = []
    for share in (-0.8, 0.0, 0.8):
        controls, states = unsaturated(numbers, posture, ones, share * ones)
        result = drive(numbers, posture, ones, controls, states)
        assert not result.clipped
        assert result.damping[0, 0] == pytest.approx(2.0 * len(drives))  # no joint is at a limit
        forces.append(result.joint_forces[0])
    assert np.all(np.diff(forces) > 5.0)


def test_sum_of_drives_on_a_tendon_is_scaled() -> None:
    """Catch a limit of a sum that is applied to each drive."""
    both = driven({"gains": (1.0,)}, {"gains": (3.0,)}, sums=(((0, 1), (-4.0, 4.0)),))
    assert both.forces == pytest.approx([1.0, 3.0])


def test_exact_filter_follows_the_exponential() -> None:
    """Catch filters that are exchanged, and a range that is not applied to the state."""
    exact = {"state": 0, "dynamics": "exact filter", "constants": (0.05,)}
    expected = 2.0 + (0.4 - 2.0) * np.exp(-STEP / 0.05)
    assert driven(exact).states[0] == pytest.approx(expected, rel=1e-14)
    assert driven(exact).forces[0] == 0.4
    assert driven({**exact, "early": True}).forces[0] == pytest.approx(expected, rel=1e-14)
    plain = driven({**exact, "dynamics": "filter", "state_range": (0.0, 0.5)})
    assert plain.states[0] == 0.5
    assert driven({"state": 0, "dynamics": "integrator"}).states[0] == pytest.approx(0.42)


def test_muscle_has_its_peak_at_its_best_length() -> None:
    """Catch a muscle's curves that are shifted, and a sign that makes it push."""
    numbers = (0.75, 1.05, -1.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2)
    muscle: dict[str, Any] = {
        "state": 0, "dynamics": "muscle", "constants": (0.01, 0.04, 0.0), "gain": "muscle",
        "gains": numbers, "bias": "muscle", "biases": numbers, "stretch": (0.2, 0.35),
    }  # fmt: skip
    best = 0.2 + (1.0 - 0.75) * (0.15 / 0.3)
    at_best = driven(muscle, x=best, v=0.0, control=1.0)
    assert at_best.forces[0] == pytest.approx(-0.4 * 200.0 / 0.5)
    assert at_best.states[0] == pytest.approx(0.4 + STEP * 0.6 / (0.01 * 1.1))
    longer = driven(muscle, x=best + 0.5 * 0.3, v=0.0, state=0.0).forces[0]
    assert longer == pytest.approx(-400.0 * 1.3 * 0.5)
    assert driven(muscle, x=best, v=-2.0).forces[0] == 0.0


def test_damping_of_a_muscle_is_the_slope_of_its_force() -> None:
    """Catch a slope that an implicit integrator would use with another sign or scale."""
    numbers = (0.75, 1.05, 300.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2)
    muscle: dict[str, Any] = {"gain": "muscle", "gains": numbers, "stretch": (0.2, 0.35)}
    for v in (-0.3, 0.05, 0.4):
        low, high = (driven(muscle, v=v + by).forces[0] for by in (-1e-6, 1e-6))
        assert driven(muscle, v=v).damping[0, 0] == pytest.approx(-(high - low) / 2e-6, rel=1e-6)
