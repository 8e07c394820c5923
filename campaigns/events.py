"""Motions with events at random constants: is the truth within the uncertainty?

`python -m campaigns.events --draws 1000` draws the constants of a system in `models/events`, writes
them into its model file, and compares extrapolated segments with the exact ones: those around each
event, and a few others. It prints how often the truth is outside U, and the number of segments with
U below 1e-9. Exit code 1 if any truth is outside, which is what a false convergence is.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
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

OTHERS = 8
"""Segments without an event per motion, evenly spaced."""


@dataclass
class Tally:
    """Counts of segments.

    Attributes:
        kinds: number of draws by system and result.
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


def compare(system: System, sidecar: Sidecar, engine: str, tally: Tally) -> None:
    """Compare every scenario of a system in an engine, with its constants in the file."""
    expected = {b.address: b.expected for b in bindings(system, sidecar)}
    for scenario in system.scenarios:
        try:
            motion = solve_events(derive(system), scenario, sidecar.laws)
        except (EventError, ReferenceError, DeclarationError):
            tally.kinds[f"{system.name} refused"] += 1
            continue
        motion = replace(motion, scale=component_scale(motion, []))
        with tempfile.TemporaryDirectory() as folder:
            copy = with_literals(sidecar, expected, Path(folder))
            model, coordinates = load(system, copy, engine)
            some = around_events(motion)
            limit = extrapolate(model, coordinates, some, resolution=1e-9).limit
        _count(tally, some, limit.value, limit.uncertainty)
        tally.kinds[f"{system.name} judged"] += 1


def _count(tally: Tally, some: Segments, value: Array, uncertainty: Array) -> None:
    unit = some.unit
    total = np.maximum((uncertainty + some.bound) / unit, np.finfo(float).eps)
    error = np.abs(value - some.end) / unit
    judged = np.asarray(np.isfinite(total).all(axis=1))
    tally.segments += len(judged)
    tally.resolved += int(np.sum(judged & (total.max(axis=1) < 1e-9)))
    ratio = (error / total)[judged]
    tally.outside += int(np.sum((ratio > 1).any(axis=1)))
    tally.worst = max(tally.worst, float(ratio.max(initial=0.0)))


def main(arguments: Mapping[str, int]) -> int:
    """Draw, compare and print; return the exit code."""
    random, tally = np.random.default_rng(arguments["seed"]), Tally()
    models = sorted(EVENTS.glob("*/*.toml"))
    for draw in range(arguments["draws"]):
        sidecar = read_sidecar(models[draw % len(models)])
        system = drawn(load_system(sidecar.model.parent), random)
        compare(system, sidecar, sidecar.engines[0], tally)
        if draw % 50 == 49:
            print(draw + 1, tally, flush=True)
    print(tally)
    return 1 if tally.outside else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    sys.exit(main(vars(parser.parse_args())))
