"""Equations with their constants as arguments, against those that are derived with them put in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.family import Family
from physics_crosscheck.reference.solving.solve import solve

CASES = [
    ("mass_spring_damper", "step", {"k": 31.0, "c": 0.4}),
    ("simple_pendulum", "driven", {"l": 0.52, "m": 0.7}),
]


@pytest.mark.parametrize(("name", "scenario", "constants"), CASES)
def test_a_drawn_motion_is_that_of_the_equations_derived_there(
    name: str, scenario: str, constants: Mapping[str, float]
) -> None:
    system = load_system(builtin() / name)
    family = Family.compile(derive(system))
    found = solve(family.with_constants(constants), system.scenario(scenario))
    there = at_constants(system, constants)
    wanted = solve(derive(there), there.scenario(scenario))
    assert found.t.shape == wanted.t.shape
    size = np.max(np.abs(wanted.end), axis=0)
    assert np.max(np.abs(found.start - wanted.start) / size) < 1e-9
    # Each segment from its own start: they are that of the equations to the bounds of both.
    moved = solve(family.with_constants({}), system.scenario(scenario))
    assert np.max(np.abs(moved.end[: len(found.end)] - found.end[: len(moved.end)])) > 1e-3
    assert np.all(found.bound < 1e-13 * np.maximum(size, 1.0))
    times = np.linspace(0.0, wanted.duration, 77)
    assert np.max(np.abs(found.states_at(times) - wanted.states_at(times)) / size) < 1e-9


@pytest.mark.slow
def test_a_motion_that_multiplies_differences_has_a_reference_too() -> None:
    # Newton's method begins too far from it: its segments are started as those of a run are.
    system = load_system(builtin() / "drum_pendulum")
    constants = {
        "M": 2.777978231871478, "m": 0.5031382674606564, "l": 0.42104926367495704,
        "k": 78.7854114449368, "g": 9.764055777893367,
    }  # fmt: skip
    found = solve(
        Family.compile(derive(system)).with_constants(constants), system.scenario("driven")
    )
    there = at_constants(system, constants)
    wanted = solve(derive(there), there.scenario("driven"))
    assert found.t.shape == wanted.t.shape
    assert np.all(np.abs(found.start - wanted.start) <= wanted.global_bound[:-1] + 1e-12)
    assert np.max(wanted.global_bound) > 1e-4
    assert np.all(found.bound < 1e-12)


def test_a_second_draw_derives_and_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    system = load_system(builtin() / "simple_pendulum")
    family = Family.compile(derive(system))
    solve(family.with_constants({}), system.scenario("free"))

    def never(*_: object, **__: object) -> NoReturn:
        raise AssertionError("something is derived or compiled again")

    for name in ("lambdify", "diff", "simplify", "expand"):
        monkeypatch.setattr(sp, name, never)
    solve(family.with_constants({"l": 0.6}), system.scenario("free"))


def test_inputs_that_hold_a_varied_constant_follow_it() -> None:
    from dataclasses import replace

    system = load_system(builtin() / "mass_spring_damper")
    force = system.inputs[0]
    k = next(c for c in system.constants if c.name == "k")
    pushed = replace(system.scenario("step"), inputs={force: k.symbol / 10})
    system = replace(system, scenarios=(pushed,))
    family = Family.compile(derive(system))
    there = at_constants(system, {"k": 80.0})
    wanted = solve(derive(there), there.scenario("step"))
    solve(family.with_constants({}), pushed)
    found = solve(family.with_constants({"k": 80.0}), pushed)
    assert np.max(np.abs(found.end - wanted.end)) < 1e-12
