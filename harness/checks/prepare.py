"""Reference side of a folder, shared by all its cases: derive, linearize and solve."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from physics_crosscheck.harness.checks.system_record import system_record
from physics_crosscheck.harness.checks.verdict import component_scale, filled
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.records import system as records
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.load import load_system, with_location
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.next_state import SteppedEquations, stepped_equations
from physics_crosscheck.reference.solving.solve import solve
from physics_crosscheck.reference.solving.variants import Variants, variants


@dataclass(frozen=True)
class Equilibrium:
    """A linearization as plain arrays: `matrices` holds M, C, K, F, A, B, Cy and D."""

    name: str
    position: Array
    matrices: Mapping[str, Array]


@dataclass(frozen=True)
class Prepared:
    """The physics of a folder, solved; picklable.

    Attributes:
        motions: reference motion by scenario.
        scales: scale of the defects by scenario, (2n,) each.
        amplitude: largest magnitude over all scenarios, (2n,); nowhere zero.
        push: largest input over all scenarios, (inputs,).
        power: (energy, supplied, dissipated) of (q, v, u, (t,)).
        components: names of the state's components, positions then velocities.
        stepped: the equations in the form for integrators; None if they depend on time.
        variants: the equations with every constant and some missing terms free.
        record: the system's entry in results.json.
        reads: states of the files that `system.py` read, by name relative to the folder.
    """

    folder: Path
    system: System
    motions: Mapping[str, Motion]
    scales: Mapping[str, Array]
    amplitude: Array
    push: Array
    power: NumericFunction
    equilibria: tuple[Equilibrium, ...]
    components: tuple[str, ...]
    stepped: SteppedEquations | None
    variants: Variants
    record: records.System
    reads: Mapping[str, str]


def prepare(folder: Path, described: bool = True) -> Prepared:
    """Load `folder/system.py`, derive, linearize and solve every scenario.

    Without `described` the record contains no derivation. Formulas take longer than all the rest,
    and only a report shows them.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    began = time.perf_counter()
    with record_reads(folder) as reads:
        system = load_system(folder)
    return derived(folder, system, reads.states(), began, described=described)


def derived(
    folder: Path, system: System, reads: Mapping[str, str], began: float, *, described: bool
) -> Prepared:
    """Derive, linearize and solve the system of a folder.

    Args:
        folder: the system folder.
        system: the declared system.
        reads: states of the files that the declaration read.
        began: start time, from `time.perf_counter`.
        described: as in `prepare`.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    equations = derive(system)
    with with_location(folder):
        linear = tuple(linearize(equations, e) for e in system.equilibria)
        motions = {s.name: solve(equations, s) for s in system.scenarios}
    scales = {
        name: component_scale(motion, [m for other, m in motions.items() if other != name])
        for name, motion in motions.items()
    }
    names = [c.name for c in system.coordinates]
    pushes = [np.max(np.abs(m.inputs(m.t)), axis=0, initial=0.0) for m in motions.values()]
    push = np.max(pushes, axis=0)
    amplitude = filled(np.max([m.amplitude for m in motions.values()], axis=0))
    with with_location(folder):
        record = system_record(folder, equations, linear, motions, described=described)
    return Prepared(
        folder=folder,
        system=system,
        motions=motions,
        scales=scales,
        amplitude=amplitude,
        push=np.where(push > 0, push, 1.0),
        power=equations.numeric_power,
        equilibria=tuple(Equilibrium(e.equilibrium, e.position, e.arrays) for e in linear),
        stepped=stepped_equations(equations),
        variants=variants(equations, amplitude),
        components=(*names, *(f"{name}_dot" for name in names)),
        record=msgspec.structs.replace(record, seconds=time.perf_counter() - began),
        reads=reads,
    )
