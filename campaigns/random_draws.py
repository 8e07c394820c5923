"""Random constants of the built-in systems: does any correct model differ from its equations?

`python -m campaigns.random_draws --count 500 --seed 1`

The campaign counts the limits whose error exceeds their uncertainty. It takes the segments of the
verdict, the segments of a diagnosis, the baseline snapshots, and the entries of linearizations.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.baseline.measure import ends, segments_of, snapshot_of
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.diagnosis.samples import (
    engine_ends,
    reference_ends,
    sample_segments,
)
from physics_crosscheck.harness.engines.protocol import Array, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import at_constants, parametric_model_file
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve

Pairing = tuple[Path, Sidecar, str]
"""A folder, a model of it, and an engine."""

SPREAD = 10.0
"""Ratio of the largest to the smallest drawn value of a constant."""

DURATION = 4.0
RESOLUTION = 1e-9
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, kw_only=True)
class DrawJudgement:
    """The judgement of a model at given constants.

    Attributes:
        verdict: of the motion.
        extrapolated: limits of its segments.
        motion: the motion that the equations give.
        ratios: errors of limits over their uncertainty, by source; 0 where the uncertainty is
            infinite.
    """

    verdict: CaseJudgement
    extrapolated: Extrapolated
    motion: Motion
    ratios: Mapping[str, Array]


def pairings() -> list[Pairing]:
    """Return (folder, sidecar, engine) of every built-in model in every default engine."""
    return [
        (folder, sidecar, engine)
        for folder in system_folders([])
        for sidecar in model_files(folder)
        if isinstance(sidecar, Sidecar)
        for engine in sidecar.engines
        if not engines()[engine].extra
    ]


def draw(pairing: Pairing, rng: np.random.Generator, into: Path) -> tuple[DrawJudgement, str]:
    """Judge a random scenario of a model at random constants; return the judgement and a name."""
    folder, sidecar, engine = pairing
    system = load_system(folder)
    factors = SPREAD ** rng.uniform(-0.5, 0.5, len(system.constants))
    constants = {c.name: c.value * f for c, f in zip(system.constants, factors, strict=True)}
    if "g" in constants:
        constants["g"] = 9.81 * float(rng.uniform(0.5, 1.5))
    scenario = system.scenarios[rng.integers(len(system.scenarios))].name
    judged = judge_at(pairing, constants, scenario, into)
    return judged, f"{folder.name}/{sidecar.model.name} [{engine}] {scenario} {constants}"


def judge_at(
    pairing: Pairing, constants: Mapping[str, float], scenario: str, into: Path
) -> DrawJudgement:
    """Judge a model at given constants; write its file into a folder."""
    folder, sidecar, engine = pairing
    system = load_system(folder)
    drawn = at_constants(system, constants)
    equations = derive(drawn)
    motion = solve(equations, replace(drawn.scenario(scenario), duration=DURATION))
    model_file = parametric_model_file(system, sidecar, constants, ())
    copy = model_file.write({c.name: c.value for c in drawn.constants}, into)
    model, coordinates = load(drawn, copy, engine)
    motion = replace(motion, scale=component_scale(motion, []))
    extrapolated = extrapolate(model, coordinates, motion, resolution=RESOLUTION)
    names = tuple(c.name for c in drawn.coordinates) * 2
    claimed = model.exponents(motion.varying)[0]
    error = np.abs(extrapolated.limit.value - motion.end)
    return DrawJudgement(
        verdict=judge(extrapolated.limit, motion, names, claimed, RESOLUTION),
        extrapolated=extrapolated,
        motion=motion,
        ratios={
            "verdict": _ratios(error, extrapolated.limit.uncertainty + motion.bound),
            "diagnosis": _sample_ratios(model, coordinates, motion, scenario),
            "snapshot": _snapshot_ratios(model, coordinates, equations, motion, scenario),
            "linearization": np.concatenate(
                [*_linearization_ratios(model, coordinates, equations, motion)]
            ),
        },
    )


def _ratios(error: Array, uncertainty: Array) -> Array:
    finite = np.isfinite(uncertainty)
    return np.where(finite, error / np.where(finite, uncertainty, 1.0), 0.0).ravel()


def _sample_ratios(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, scenario: str
) -> Array:
    samples = sample_segments({scenario: motion})
    value, uncertainty = engine_ends(model, coordinates, samples)
    bound = np.tile(motion.bound / motion.unit, len(value) // len(motion.unit))
    return _ratios(np.abs(value - reference_ends(samples)), uncertainty + bound)


def _snapshot_ratios(
    model: LoadedModel,
    coordinates: CoordinateMap,
    equations: Equations,
    motion: Motion,
    scenario: str,
) -> Array:
    names = tuple(c.name for c in equations.system.coordinates)
    components = (*names, *(f"{name}_dot" for name in names))
    segments = segments_of(snapshot_of(motion, scenario, components, ()))
    value, uncertainty = ends(model, coordinates, segments)
    return _ratios(np.abs(value - segments.end), uncertainty + motion.bound)


def _linearization_ratios(
    model: LoadedModel, coordinates: CoordinateMap, equations: Equations, motion: Motion
) -> Iterator[Array]:
    push = np.max(np.abs(motion.inputs(motion.t)), axis=0, initial=0.0)
    for equilibrium in equations.system.equilibria:
        taylor = linearize(equations, equilibrium)
        point = OperatingPoint(
            name=taylor.equilibrium,
            position=taylor.position,
            hold=np.zeros_like(push),
            matrices=taylor.arrays,
            amplitude=np.where(motion.amplitude > 0, motion.amplitude, 1.0),
            push=np.where(push > 0, push, 1.0),
        )
        _, matrix = linearize_engine(model, coordinates, point, RESOLUTION)
        size = len(point.amplitude)
        for key, part in (("A", slice(0, size)), ("B", slice(size, None))):
            wanted, error = taylor.arrays[key], matrix.uncertainty[:size, part]
            rounded = 16 * EPSILON * np.max(np.abs(wanted), initial=0.0)
            yield _ratios(np.abs(matrix.value[:size, part] - wanted), error + rounded)


def campaign(count: int, seed: int) -> list[tuple[DrawJudgement, str]]:
    """Judge draws of all pairings in turn; return each judgement with its name.

    If there are fewer draws than pairings, they are spread evenly.
    """
    rng = np.random.default_rng(seed)
    every = pairings()
    every = every[:: max(1, len(every) // count)]
    results = []
    for index in range(count):
        with tempfile.TemporaryDirectory() as into:
            results.append(draw(every[index % len(every)], rng, Path(into)))
    return results


def main() -> None:
    """Print the draws that do not agree, and the limits outside their uncertainty."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=500, help="draws [500]")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    results = campaign(options.count, options.seed)
    for judged, what in results:
        verdict = judged.verdict
        if verdict.outcome is not Outcome.AGREES:
            print(verdict.outcome, f"E {verdict.discrepancy:.1e} U {verdict.uncertainty:.1e}", what)
            print("   ", verdict.reason)
        for place, ratios in judged.ratios.items():
            if np.max(ratios) > 1:
                print(
                    f"{place}: {int(np.sum(ratios > 1))} outside, by {np.max(ratios):.2g} U", what
                )
    print(Counter(str(judged.verdict.outcome) for judged, _ in results))
    for place in results[0][0].ratios:
        every = np.concatenate([judged.ratios[place] for judged, _ in results])
        print(
            f"{place}: {len(every)} limits, {int(np.sum(every > 1))} outside U, worst"
            f" {np.max(every):.2g} U, median {np.median(every):.1e} U"
        )


if __name__ == "__main__":
    main()
