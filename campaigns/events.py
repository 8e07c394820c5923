"""Motions with events at random constants: is the truth within the uncertainty?

`python -m campaigns.events --draws 1000` draws the constants of a system in `models/events`, writes
them into its model file, and compares extrapolated segments with the exact ones: those around each
event, and a few others. It prints how often the truth is outside U, the number of segments with U
below 1e-9, and each draw that has another result, with its constants. Exit code 1 if any truth is
outside, which is what a false convergence is.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.checks.verdict import component_scale
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.laws.motion import EventError, solve_events
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.declaration import DeclarationError
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.segments import Segments

EVENTS = Path(__file__).parents[1] / "models" / "events"
SPREAD = 1.5
"""Largest factor of a drawn constant."""

RESOLUTION = 1e-9
"""Uncertainty up to which a segment counts as resolved."""

OTHERS = 8
"""Segments without an event per motion, evenly spaced."""


@dataclass
class Tally:
    """Counts of segments.

    Attributes:
        kinds: number of motions by system and result, and of coarse segments by system.
        segments: judged segments.
        resolved: those with U below 1e-9.
        outside: those whose truth is outside U.
        worst: largest error over U.
    """

    kinds: Counter[str] = field(default_factory=Counter)
    segments: int = 0
    resolved: int = 0
    outside: int = 0
    worst: float = 0.0


def drawn(system: System, random: np.random.Generator) -> System:
    """Return the system with other constants; a share below 1 stays below 1."""
    constants = []
    for constant in system.constants:
        value = float(constant.value * SPREAD ** random.uniform(-1, 1))
        bounded = min(value, 0.99) if constant.name == "e" else value
        constants.append(replace(constant, value=bounded))
    return replace(system, constants=tuple(constants))


def around_events(segments: Segments) -> Segments:
    """Return the segments with an event, and a few others."""
    middles = segments.t + segments.lengths / 2
    rows = [int(np.argmin(np.abs(middles - event))) for event in segments.events]
    rows += np.linspace(0, len(middles) - 1, OTHERS).astype(int).tolist()
    return segments.pick(np.unique(rows).astype(np.intp))


def compare(system: System, sidecar: Sidecar, engine: str, tally: Tally) -> Iterator[str]:
    """Compare every scenario of a system in an engine; yield each result that needs a cause."""
    expected = {b.address: b.expected for b in bindings(system, sidecar)}
    at = ", ".join(f"{c.name} = {c.value:.17g}" for c in system.constants)
    for scenario in system.scenarios:
        what = f"{system.name} [{engine}] {scenario.name}"
        try:
            motion = solve_events(derive(system), scenario, sidecar.laws)
        except (EventError, ReferenceError, DeclarationError) as error:
            tally.kinds[f"{what} refused"] += 1
            yield f"{what} refused: {error}; {at}"
            continue
        motion = replace(motion, scale=component_scale(motion, []))
        with tempfile.TemporaryDirectory() as folder:
            copy = with_literals(sidecar, expected, Path(folder))
            model, coordinates = load(system, copy, engine)
            some = around_events(motion)
            limit = extrapolate(model, coordinates, some, resolution=RESOLUTION).limit
        tally.kinds[f"{what} judged"] += 1
        for line in _count(tally, what, some, limit.value, limit.uncertainty):
            yield f"{line}; {at}"


def _count(
    tally: Tally, what: str, some: Segments, value: Array, uncertainty: Array
) -> Iterator[str]:
    unit = some.unit
    total = np.maximum((uncertainty + some.bound) / unit, np.finfo(float).eps)
    error = np.abs(value - some.end) / unit
    ratio = np.where(np.isfinite(total), error / total, 0.0).max(axis=1)
    tally.segments += len(ratio)
    tally.worst = max(tally.worst, float(ratio.max()))
    for row, largest in enumerate(total.max(axis=1)):
        middle = some.t[row] + some.lengths[row] / 2
        centred = np.abs(np.array(some.events) - middle).min(initial=np.inf) < 1e-9
        where = f"{what} t = {middle:.6g} s, {'with' if centred else 'without'} an event"
        if ratio[row] > 1:
            tally.outside += 1
            yield f"OUTSIDE {where}: {ratio[row]:.3g} U, U = {largest:.1e}"
        elif largest < RESOLUTION:
            tally.resolved += 1
        else:
            tally.kinds[f"{what} coarse, {'with' if centred else 'without'} an event"] += 1
            yield f"coarse {where}: U = {largest:.1e}"


def main(arguments: Mapping[str, int]) -> int:
    """Draw, compare and print; return the exit code."""
    random, tally = np.random.default_rng(arguments["seed"]), Tally()
    models = sorted(EVENTS.glob("*/*.toml"))
    for draw in range(arguments["draws"]):
        sidecar = read_sidecar(models[draw % len(models)])
        system = drawn(load_system(sidecar.model.parent), random)
        for line in compare(system, sidecar, sidecar.engines[0], tally):
            print(f"draw {draw}: {line}", flush=True)
        if draw % 20 == 19:
            print(draw + 1, tally, flush=True)
    print(tally)
    return 1 if tally.outside else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    sys.exit(main(vars(parser.parse_args())))
