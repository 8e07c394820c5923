"""Random draws of all constants: does any sound model differ?

`python -m campaigns.random_draws --count 500 --seed 1`
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.cases.case import load
from harness.cases.verdict import Verdict, component_scale, judge
from harness.files.bindings import at_constants, with_constants
from harness.files.folders import system_folders
from harness.files.model_files import model_files
from harness.files.sidecar import Sidecar
from harness.numerics.segments import Extrapolated, extrapolate
from harness.records.outcome import Outcome
from reference.derive import derive
from reference.load import load_system
from reference.motion import Motion
from reference.solve import solve

Pairing = tuple[Path, Sidecar, str]
"""A folder, a model of it, and an engine."""

SPREAD = 10.0
"""Largest over smallest value that a constant is drawn at."""

DURATION = 4.0


def pairings() -> list[Pairing]:
    """(folder, sidecar, engine) of every built-in model in every engine."""
    return [
        (folder, found, engine)
        for folder in system_folders([])
        for found in model_files(folder)
        if isinstance(found, Sidecar)
        for engine in found.engines
    ]


def draw(
    folder: Path, sidecar: Sidecar, engine: str, rng: np.random.Generator, into: Path
) -> tuple[Verdict, str]:
    """Judge one scenario of a model at random constants; returns (verdict, what was drawn)."""
    system = load_system(folder)
    factors = SPREAD ** rng.uniform(-0.5, 0.5, len(system.constants))
    constants = {c.name: c.value * f for c, f in zip(system.constants, factors, strict=True)}
    if "g" in constants:
        constants["g"] = 9.81 * float(rng.uniform(0.5, 1.5))
    scenario = system.scenarios[rng.integers(len(system.scenarios))].name
    verdict, _, _ = judge_at(folder, sidecar, engine, constants, scenario, into)
    return verdict, f"{folder.name}/{sidecar.model.name} [{engine}] {scenario} {constants}"


def judge_at(
    folder: Path,
    sidecar: Sidecar,
    engine: str,
    constants: Mapping[str, float],
    scenario: str,
    into: Path,
) -> tuple[Verdict, Extrapolated, Motion]:
    """Judge a model at given constants; returns (verdict, extrapolated, reference motion)."""
    system = load_system(folder)
    drawn = at_constants(system, constants)
    motion = solve(derive(drawn), replace(drawn.scenario(scenario), duration=DURATION))
    copy = with_constants(system, sidecar, constants, into)
    model, coordinates = load(drawn, copy, engine)
    scale = component_scale(motion, [])
    found = extrapolate(model, coordinates, motion, scale, 1e-9)
    names = tuple(c.name for c in drawn.coordinates) * 2
    claimed = model.exponents(not all(s.constant_input for s in motion.spans))[0]
    return judge(found.limit, motion, scale, names, claimed, 1e-9), found, motion


def campaign(count: int, seed: int) -> list[tuple[Verdict, str]]:
    """Draw over all systems and pairings in turn; returns a list of (verdict, description)."""
    rng = np.random.default_rng(seed)
    every = pairings()
    results = []
    for index in range(count):
        with tempfile.TemporaryDirectory() as into:
            results.append(draw(*every[index % len(every)], rng, Path(into)))
    return results


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    results = campaign(options.count, options.seed)
    for verdict, what in results:
        if verdict.outcome is not Outcome.AGREES:
            print(verdict.outcome, f"E {verdict.discrepancy:.1e} U {verdict.uncertainty:.1e}", what)
            print("   ", verdict.reason)
    print(Counter(str(verdict.outcome) for verdict, _ in results))


if __name__ == "__main__":
    main()
