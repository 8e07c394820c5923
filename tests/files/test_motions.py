"""Bindings are complete: models and equations at random constants still agree."""

import os
from collections.abc import Container
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck import System
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Segments
from physics_crosscheck.reference.solving.solve import solve
from tests.engines.extras import EXTRAS, need
from tests.physics import copy_with_constants

SECONDS = 2.0
SEGMENTS = 20
"""Segments of a motion; spread over its spans, they depend on every literal."""

COARSE = 1e-5
"""Resolution that detects a relative difference of a thousandth."""

ENGINES = {engine.name for engine in engines().values() if not engine.extra}
if os.environ.get("REQUIRE_ALL_ENGINES"):  # in `make test-engines`
    ENGINES |= set(EXTRAS)


def _cases(names: Container[str]) -> list[Any]:
    return [
        pytest.param(
            sidecar,
            engine,
            id=f"{folder.name}-{sidecar.model.name}-{engine}",
            # `make test-engines` runs slow ones too.
            marks=() if folder.name in ("drum_pendulum", "free_pair") else pytest.mark.slow,
        )
        for folder in system_folders([])
        for sidecar in model_files(folder)
        if isinstance(sidecar, Sidecar)
        for engine in sidecar.engines
        if engine in names
    ]


@cache
def draw_system(folder: Path) -> tuple[System, dict[str, float], Segments]:
    """Return a system at random constants, its draw, and segments of its free motion."""
    rng = np.random.default_rng(20240817)
    system = load_system(folder)
    draw = {c.name: c.value * rng.uniform(0.7, 1.4) for c in system.constants}
    system = at_constants(system, draw)
    motion = solve(derive(system), replace(system.scenario("free"), duration=SECONDS))
    motion = replace(motion, scale=component_scale(motion, []))
    return system, draw, motion.pick(motion.informative(SEGMENTS))


def verdict(
    system: System, sidecar: Sidecar, engine: str, motion: Segments, resolution: float
) -> CaseJudgement:
    model, coordinates = load(system, sidecar, engine)
    claimed, _ = model.exponents(motion.varying)
    extrapolation = extrapolate(model, coordinates, motion, resolution=resolution)
    names = [c.name for c in system.coordinates]
    components = (*names, *(f"{name}_dot" for name in names))
    return judge(extrapolation.limit, motion, components, claimed, resolution)


@pytest.fixture(autouse=True)
def _installed(engine: str) -> None:
    need(engine)


@pytest.mark.parametrize(("sidecar", "engine"), _cases(ENGINES))
def test_model_and_equations_at_random_constants_agree(
    sidecar: Sidecar, engine: str, tmp_path: Path
) -> None:
    nominal = load_system(sidecar.model.parent)
    system, draw, motion = draw_system(sidecar.model.parent)
    copy = copy_with_constants(nominal, sidecar, draw, tmp_path / "copy")
    judgement = verdict(system, copy, engine, motion, 1e-9)
    assert judgement.outcome is Outcome.AGREES, judgement.reason
    # The draw changes the motion, so the original file differs.
    assert verdict(system, sidecar, engine, motion, COARSE).discrepancy > 1e-3
