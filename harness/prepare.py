"""The reference side of a folder: derive, linearize, solve; everything that its cases share."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from harness.verdict import component_scale
from reference.derive import Equations, derive
from reference.errata import errata
from reference.linearity import linearity
from reference.linearize import Linearization, classify, linearize
from reference.load import load_system
from reference.modes import modes, poles, transfer_functions
from reference.motion import Motion
from reference.numeric import Array, NumericFunction
from reference.solve import solve
from reference.system import System
from reference.variants import Variants, variants


@dataclass(frozen=True)
class Equilibrium:
    """A linearization as plain arrays: `matrices` holds M, C, K, F, A, B, Cy and D."""

    name: str
    position: Array
    matrices: Mapping[str, Array]


@dataclass(frozen=True)
class Prepared:
    """A folder's physics, solved; picklable.

    Attributes:
        motions: reference motion by scenario.
        scales: what a defect is relative to, by scenario, (2n,) each.
        amplitude: largest magnitude over all scenarios, (2n,).
        push: largest input over all scenarios, (inputs,).
        power: (energy, supplied, dissipated) of (q, v, u, (t,)).
        components: names of the state's components, positions then velocities.
        variants: the equations with every constant and some missing terms free.
        record: the system's entry in results.json.
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
    variants: Variants
    record: Mapping[str, Any]


def prepare(folder: Path, described: bool = True) -> Prepared:
    """Load `folder/system.py`, derive, linearize and solve every scenario.

    Without `described` the record has names, constants and scenarios alone: formulas as text cost
    more than all the rest, and only a report shows them.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    began = time.perf_counter()
    system = load_system(folder)
    equations = derive(system)
    linear = tuple(linearize(equations, e) for e in system.equilibria)
    motions = {s.name: solve(equations, s) for s in system.scenarios}
    scales = {
        name: component_scale(motion, [m for other, m in motions.items() if other != name])
        for name, motion in motions.items()
    }
    names = [c.name for c in system.coordinates]
    pushes = [np.max(np.abs(m.inputs(m.t)), axis=0, initial=0.0) for m in motions.values()]
    push = np.max(pushes, axis=0)
    record = describe_system(equations, linear, motions) if described else _brief(system)
    record["seconds"] = time.perf_counter() - began
    return Prepared(
        folder=folder,
        system=system,
        motions=motions,
        scales=scales,
        amplitude=np.max([m.amplitude for m in motions.values()], axis=0),
        push=np.where(push > 0, push, 1.0),
        power=equations.numeric_power,
        equilibria=tuple(Equilibrium(e.equilibrium, e.position, e.arrays) for e in linear),
        variants=variants(equations, np.max([m.amplitude for m in motions.values()], axis=0)),
        components=(*names, *(f"{name}_dot" for name in names)),
        record=record,
    )


def describe_system(
    equations: Equations, linear: tuple[Linearization, ...], motions: Mapping[str, Motion]
) -> dict[str, Any]:
    """The entry of a system in results.json: everything the report says about its physics."""
    system = equations.system
    left = equations.mass * sp.Matrix(system.a)
    rows = [sp.Eq(a, f, evaluate=False) for a, f in zip(left, equations.force, strict=True)]
    return {
        "name": system.name,
        "title": system.title,
        "source": system.source,
        "kind": classify(len(system.inputs), len(system.outputs)),
        "coordinates": [_named(c) for c in system.coordinates],
        "constants": [
            {**_named(c), "value": float(c.value), "source": c.source} for c in system.constants
        ],
        "inputs": [_named(i) for i in system.inputs],
        "outputs": [{**_named(o), **_formula(o.expression)} for o in system.outputs],
        "energies": {name: _formula(getattr(system, name)) for name in ("T", "V", "D")},
        "equations": [_formula(row) for row in rows],
        "linearizations": [_linear_record(one, system) for one in linear],
        "linearity": [
            {"equilibrium": e.equilibrium, "mode": e.mode, "period": e.period,
             "amplitudes": list(e.amplitudes), "errors": list(e.errors)}
            for one in linear for e in linearity(equations, one)
        ],
        "errata": [
            {"number": e.printed.number, "printed": e.printed.text, "verdict": e.verdict,
             "derived": e.derived, "difference": e.difference, "note": e.printed.note}
            for e in errata(equations, linear)
        ],
        "scenarios": [
            {"name": s.name, "description": s.description, "duration": float(s.duration),
             "inputs": {i.name: sp.sstr(sp.sympify(s.inputs[i])) for i in system.inputs},
             "segments": len(motions[s.name].t), "method": motions[s.name].method,
             "bound": float(np.max(motions[s.name].bound))}
            for s in system.scenarios
        ],
    }  # fmt: skip


def _brief(system: System) -> dict[str, Any]:
    return {
        "name": system.name,
        "constants": [{**_named(c), "value": float(c.value)} for c in system.constants],
        "scenarios": [{"name": s.name} for s in system.scenarios],
    }


def _named(item: Any) -> dict[str, str]:
    return {"name": item.name, "unit": item.unit, "description": item.description}


def _formula(expression: Any) -> dict[str, str]:
    expression = sp.sympify(expression)
    return {"text": sp.sstr(expression), "latex": sp.latex(expression)}


def _linear_record(one: Linearization, system: System) -> dict[str, Any]:
    functions = transfer_functions(one)
    return {
        "equilibrium": one.equilibrium,
        "position": one.position.tolist(),
        "matrices": {name: array.tolist() for name, array in one.arrays.items()},
        "poles": [
            {"real": p.value.real, "imaginary": p.value.imag, "multiplicity": p.multiplicity,
             "frequency": p.frequency, "damping": p.damping}
            for p in poles(one)
        ],
        "modes": [
            {"frequency": float(m.frequency), "growth": float(m.growth), "shape": m.shape.tolist(),
             "rigid": m.rigid}
            for m in modes(one)
        ],
        "transfer_functions": [
            {"output": o.name, "input": i.name, **_formula(functions[row, column])}
            for row, o in enumerate(system.outputs)
            for column, i in enumerate(system.inputs)
        ],
    }  # fmt: skip
