"""Equations with constants as arguments, against equations with constants inserted."""

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
