"""Bindings say what the engines do: models and equations at other constants still agree."""

from collections.abc import Container
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import (
    at_constants,
    bindings,
    with_literals,
)
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Motion, Segments
from physics_crosscheck.reference.solving.solve import solve
from tests.engines.extras import EXTRAS, need
from tests.physics import redrawn

SECONDS = 2.0
SEGMENTS = 20
"""Of a motion: spread over its spans, they show every literal."""

COARSE = 1e-5
"""Resolution that tells a share of a thousandth."""

SLIDES = "a body that only slides does not turn"
HINGES = "it turns about another axis"
NO_EFFECT = {
    ("anchored_pair", "diaginertia"): SLIDES, ("anchored_pair", "/inertia@"): SLIDES,
    ("free_pair", "diaginertia"): SLIDES, ("free_pair", "/inertia@"): SLIDES,
    ("mass_spring_damper", "diaginertia"): SLIDES, ("mass_spring_damper", "/inertia@"): SLIDES,
    ("torsional_disc", "mass"): "the disc turns in its place",
    ("torsional_disc", "MASS"): "the disc turns in its place",
    ("torsional_disc", "diaginertia[0]"): HINGES, ("torsional_disc", "diaginertia[1]"): HINGES,
    ("torsional_disc", "inertia@ixx"): HINGES, ("torsional_disc", "inertia@iyy"): HINGES,
    ("drum_pendulum", "body[rod]/inertial@diaginertia[0]"): HINGES,
    ("drum_pendulum", "link[rod]/inertial/inertia@ixx"): HINGES,
    ("drum_pendulum", "body[drum]/inertial@diaginertia[0]"): HINGES,
    ("drum_pendulum", "body[drum]/inertial@diaginertia[2]"): HINGES,
    ("drum_pendulum", "link[drum]/inertial/inertia@ixx"): HINGES,
    ("drum_pendulum", "link[drum]/inertial/inertia@izz"): HINGES,
    # Where the rolling is an armature or a mass, the drum itself does not turn.
    ("drum_pendulum", "mujoco.xml:body[drum]/inertial@diaginertia[1]"): SLIDES,
    ("drum_pendulum", "robot_folded.urdf:link[drum]/inertial/inertia@iyy"): SLIDES,
}  # fmt: skip

STANDING = {engine.name for engine in engines().values() if not engine.extra}


def _cases(names: Container[str]) -> list[Any]:
    return [
        pytest.param(
            sidecar,
            engine,
            id=f"{folder.name}-{sidecar.model.name}-{engine}",
            marks=pytest.mark.xdist_group(f"bindings of {folder.name}"),
        )
        for folder in system_folders([])
        for sidecar in model_files(folder)
        if isinstance(sidecar, Sidecar)
        for engine in sidecar.engines
        if engine in names
    ]


@cache
def drawn(folder: Path) -> tuple[System, dict[str, float], Motion]:
    """A system at random constants, its draw, and its free motion."""
    rng = np.random.default_rng(20240817)
    system = load_system(folder)
    draw = {c.name: c.value * rng.uniform(0.7, 1.4) for c in system.constants}
    system = at_constants(system, draw)
    motion = solve(derive(system), replace(system.scenario("free"), duration=SECONDS))
    return system, draw, replace(motion, scale=component_scale(motion, []))


@cache
def forced(folder: Path) -> tuple[System, Segments]:
    """A system as declared, and some of its first motion under a sine, or else under a force.

    A known force: without, masses and stiffnesses are known but for a common factor.
    """
    system = load_system(folder)
    driven = [s for s in system.scenarios if any(s.inputs.values())]
    first = min(driven, key=lambda s: not any(sp.sympify(f).has(sp.sin) for f in s.inputs.values()))
    scenario = replace(first, duration=SECONDS)
    motion = solve(derive(system), scenario)
    motion = replace(motion, scale=component_scale(motion, []))
    return system, motion.pick(motion.informative(SEGMENTS))


def verdict(
    system: System, sidecar: Sidecar, engine: str, motion: Segments, resolution: float
) -> CaseJudgement:
    model, coordinates = load(system, sidecar, engine)
    claimed, _ = model.exponents(motion.varying)
    found = extrapolate(model, coordinates, motion, resolution=resolution)
    names = [c.name for c in system.coordinates]
    components = (*names, *(f"{name}_dot" for name in names))
    return judge(found.limit, motion, components, claimed, resolution)


@pytest.fixture(autouse=True)
def _installed(engine: str) -> None:
    need(engine)


@pytest.mark.parametrize(("sidecar", "engine"), _cases({*STANDING, *EXTRAS}))
def test_a_model_and_equations_at_random_constants_agree(
    sidecar: Sidecar, engine: str, tmp_path: Path
) -> None:
    nominal = load_system(sidecar.model.parent)
    system, draw, motion = drawn(sidecar.model.parent)
    copy = redrawn(nominal, sidecar, draw, tmp_path / "copy")
    found = verdict(system, copy, engine, motion, 1e-9)
    assert found.outcome is Outcome.AGREES, found.reason
    # The draw moves the motion: the file as it ships does something else.
    assert verdict(system, sidecar, engine, motion, COARSE).outcome is Outcome.DIFFERS


@pytest.mark.parametrize(("sidecar", "engine"), _cases(STANDING))
def test_a_literal_off_by_a_thousandth_differs_unless_no_motion_depends_on_it(
    sidecar: Sidecar, engine: str, tmp_path: Path
) -> None:
    system, motion = forced(sidecar.model.parent)
    expected, outcomes = {}, {}
    for b in bindings(system, sidecar):
        copy = with_literals(sidecar, {b.address: b.value * 1.001}, tmp_path / "copy")
        outcomes[b.address] = verdict(system, copy, engine, motion, COARSE).outcome
        known = f"{sidecar.model.name}:{b.address}"
        idle = any(folder == system.name and part in known for folder, part in NO_EFFECT)
        expected[b.address] = Outcome.AGREES if idle else Outcome.DIFFERS
    assert outcomes == expected
    assert Outcome.DIFFERS in outcomes.values()
