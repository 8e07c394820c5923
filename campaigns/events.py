"""Motions with events at random constants: is the truth within the uncertainty?

`python -m campaigns.events --draws 1000` draws the constants of a system in `models/events` and
writes them into its model file. It compares extrapolated segments with the exact ones: those around
each event, and a few others. It prints how often the truth is outside U, the number of segments
with U below 1e-9, and every other draw with its constants. The exit code is 1 if any truth is
outside U: a false convergence.

`--planted` changes each number of a contact, limit, friction, drive or soft law by 1e-6 and by 1 %,
one at a time. It prints a table of the faults that motions alone catch and name, with the line.
`--peers` repeats contact tests of other projects with folders from here.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.checks.verdict import component_scale
from physics_crosscheck.harness.commands.mutation.mistakes import Edit
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.modelfiles.bindings import at_constants, bindings, with_literals
from physics_crosscheck.harness.modelfiles.locations.attributes import elements
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.laws.motion import EventError, solve_events
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.declaration import Constant, DeclarationError, Scenario
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.segments import Segments

EVENTS = Path(__file__).parents[1] / "models" / "events"
SPREAD = 1.5
"""Largest factor of a drawn constant."""

RESOLUTION = 1e-9
"""Uncertainty up to which a segment counts as resolved."""

WITHOUT_LIMIT = {"bouncing_ball/robot.urdf", "pendulum_stop/robot.urdf"}
"""Models whose motions have no limit, or a different one, as the step falls: not drawn."""

WITHOUT_LIMIT_SCENARIOS = {"tipping_box": "rock"}
"""Scenarios without a limit, by system: not drawn."""

SMOOTH_SEGMENTS = 8
"""Segments without an event per motion, evenly spaced."""


@dataclass
class Tally:
    """Counts of segments.

    Attributes:
        kinds: number of motions by system and result, and of coarse segments by system.
        segments: judged segments.
        resolved: segments with U below 1e-9.
        outside: segments whose truth is outside U.
        worst: largest error over U.
    """

    kinds: Counter[str] = field(default_factory=Counter)
    segments: int = 0
    resolved: int = 0
    outside: int = 0
    worst: float = 0.0


def drawn(system: System, random: np.random.Generator) -> System:
    """Return the system with random constants; a restitution e stays below 1."""
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
    rows += np.linspace(0, len(middles) - 1, SMOOTH_SEGMENTS).astype(int).tolist()
    return segments.pick(np.unique(rows).astype(np.intp))


def compare(system: System, sidecar: Sidecar, engine: str, tally: Tally) -> Iterator[str]:
    """Compare every scenario of a system in an engine; yield a line for each result to explain."""
    constants = ", ".join(f"{c.name} = {c.value:.17g}" for c in system.constants)
    for scenario in system.scenarios:
        if WITHOUT_LIMIT_SCENARIOS.get(system.name) == scenario.name:
            continue
        what = f"{system.name} [{engine}] {scenario.name}"
        try:
            some, error, total = judged(system, sidecar, engine, scenario)
        except (EventError, ReferenceError, DeclarationError) as refusal:
            tally.kinds[f"{what} refused"] += 1
            yield f"{what} refused: {refusal}; {constants}"
            continue
        tally.kinds[f"{what} judged"] += 1
        for line in _count(tally, what, some, error, total):
            yield f"{line}; {constants}"


def judged(
    system: System, sidecar: Sidecar, engine: str, scenario: Scenario
) -> tuple[Segments, Array, Array]:
    """Return segments of a scenario, with relative error and uncertainty of their ends, (K, 2n).

    The model file has the constants of the system.

    Raises:
        EventError, ReferenceError, DeclarationError: if the reference refuses the motion.
    """
    motion = solve_events(derive(system), scenario, sidecar.laws)
    some = around_events(replace(motion, scale=component_scale(motion, [])))
    expected = {b.address: b.expected for b in bindings(system, sidecar)}
    with tempfile.TemporaryDirectory() as folder:
        copy = with_literals(sidecar, expected, Path(folder))
        model, coordinates = load(system, copy, engine)
        limit = extrapolate(model, coordinates, some, resolution=RESOLUTION).limit
    total = np.maximum((limit.uncertainty + some.bound) / some.unit, np.finfo(float).eps)
    return some, np.abs(limit.value - some.end) / some.unit, total


def _count(tally: Tally, what: str, some: Segments, error: Array, total: Array) -> Iterator[str]:
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


FAULTS = {"1e-6": 1e-6, "1 %": 1e-2}

DEFAULT_LAWS = {
    "bouncing_ball": ("geom", "ball", "solref"),
    "pendulum_stop": ("joint", "theta", "solreflimit"),
    "coulomb_oscillator": ("joint", "x", "solreffriction"),
}
"""Files that rely on MuJoCo's default soft law: element, its name, and the attribute to add."""


def planted_edits(system: System, sidecar: Sidecar) -> Iterator[tuple[str, str, Edit]]:
    """Yield the address of each number that acts at events, the size of the fault, and its edit."""
    fields = [value for one in system.interactions for value in vars(one).values()]
    fields += [gain for field in fields if isinstance(field, dict) for gain in field.values()]
    values = [sp.sympify(one) for one in fields if isinstance(one, sp.Expr | Constant)]
    acting = {str(symbol) for value in values for symbol in value.free_symbols}
    for binding in bindings(system, sidecar):
        names = set(re.findall(r"\b[A-Za-z_]\w*", binding.expression))
        for label, share in FAULTS.items() if names & acting or not names else ():
            wrong = binding.value * (1 + share)
            yield binding.address, label, Edit({binding.address: wrong})
    if not sidecar.laws or system.name not in DEFAULT_LAWS:
        return
    tag, name, key = DEFAULT_LAWS[system.name]
    (element,) = [
        one
        for one in elements(sidecar.model)
        if one.tag == tag and one.attributes.get("name") == name
    ]
    for label, share in FAULTS.items():
        added = (element.start, key, f"{0.02 * (1 + share)!r} 1")
        yield f"{element.spelled(1)}@{key}[0]", label, Edit(attributes=(added,))


def planted(sidecar: Sidecar) -> Iterator[str]:
    """Yield a row of the table for each planted fault of a model in its engine."""
    folder, engine = sidecar.model.parent, sidecar.engines[0]
    task = model_task(prepare_system(folder, described=False), engine, sidecar)
    for address, label, edit in planted_edits(task.target.system, sidecar):
        with tempfile.TemporaryDirectory() as into:
            diagnosis = diagnose_model(edit.plant(task, Path(into)))
        fits = diagnosis.explanations
        cause = fits[0].causes[0] if fits and diagnosis.explained else None
        ties = {tied.subject for tied in fits[0].tied_with} if fits else set()
        named = cause is not None and cause.subject == (address,)
        line = f"{cause.locations[0].file}:{cause.locations[0].line}" if cause and named else "-"
        verdict = "named" if named else "tied" if (address,) in ties else "other cause"
        result = verdict if fits else "not seen"
        yield f"| `{folder.name}` | {engine} | `{address}` | {label} | {result} | {line} |"


@dataclass(frozen=True, kw_only=True)
class PeerTest:
    """A contact test of another project, as constants of a folder here.

    Attributes:
        peer: the project, and the test.
        tolerance: of the test.
        folder: in `models/events`.
        constants: values that differ from those of the folder.
        speed: initial value of the first velocity, m/s.
        duration: s.
    """

    peer: str
    tolerance: str
    folder: str
    constants: Mapping[str, float]
    speed: float = 0.0
    duration: float = 1.0


NEWTON, DRAKE, CHRONO = "Newton, stop distance", "Drake, rolling sphere", "Chrono, stop distance"

PEER_TESTS = (
    PeerTest(peer=f"{NEWTON}, mu 0.2", tolerance="1 to 2 %", folder="stopping_block",
             constants={"mu": 0.2}, speed=2.0, duration=1.5),
    PeerTest(peer=f"{NEWTON}, mu 0.4", tolerance="1 to 2 %", folder="stopping_block",
             constants={"mu": 0.4}, speed=2.0),
    PeerTest(peer=f"{NEWTON}, mu 0.7", tolerance="1 to 2 %", folder="stopping_block",
             constants={"mu": 0.7}, speed=2.0),
    PeerTest(peer="Newton, ramp of 30 degrees, mu 0.3", tolerance="slides at least 0.02 m",
             folder="incline_block", constants={"mu": 0.3, "th": math.radians(30)}, duration=0.75),
    PeerTest(peer=DRAKE, tolerance="0.055 %", folder="slope_ball",
             constants={"R": 0.05, "m": 0.1, "th": math.radians(15), "mu": 1.0}),
    PeerTest(peer=CHRONO, tolerance="0.5 %", folder="stopping_block",
             constants={"mu": 0.5}, speed=5.0, duration=1.5),
)  # fmt: skip


def peer_row(test: PeerTest) -> str:
    """Return a row of the table: error and uncertainty of the test in this harness."""
    sidecar = read_sidecar(EVENTS / test.folder / "space.py.toml")
    system = at_constants(load_system(EVENTS / test.folder), test.constants)
    first = system.scenarios[0]
    speeds = {**first.v, system.coordinates[0]: test.speed}
    scenario = replace(first, v=speeds, duration=test.duration)
    _, error, total = judged(system, sidecar, sidecar.engines[0], scenario)
    return (
        f"| {test.peer} | {test.tolerance} | `{test.folder}` | {error.max():.0e} "
        f"| {total.max():.0e} |"
    )


def main(arguments: Mapping[str, Any]) -> int:
    """Run the campaign that the options select; return the exit code."""
    random, tally = np.random.default_rng(arguments["seed"]), Tally()
    models = [
        path
        for path in sorted(EVENTS.glob(f"{arguments['models']}.toml"))
        if f"{path.parent.name}/{path.stem}" not in WITHOUT_LIMIT
    ]
    if arguments["peers"]:
        print("| test | its tolerance | folder | error | U |\n|" + 5 * "---|")
        for test in PEER_TESTS:
            print(peer_row(test), flush=True)
        return 0
    if arguments["planted"]:
        print("| folder | engine | number | fault | result | line |\n|" + 6 * "---|")
        for model in (one for one in models if one.parent.name not in WITHOUT_LIMIT_SCENARIOS):
            for row in planted(read_sidecar(model)):
                print(row, flush=True)
        return 0
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
    parser.add_argument("--draws", type=int, default=1000, help="motions to draw [1000]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--models", default="*/*", help="pattern of FOLDER/FILE [*/*]")
    parser.add_argument("--planted", action="store_true", help="plant faults instead")
    parser.add_argument("--peers", action="store_true", help="repeat tests of other projects")
    sys.exit(main(vars(parser.parse_args())))
