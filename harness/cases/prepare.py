"""The reference side of a folder: derive, linearize, solve; everything that its cases share."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from harness.cases.sketch import sketch_record
from harness.cases.verdict import component_scale
from harness.text.mathml import equal, matrix, rational, writer
from harness.text.typeset import style_of
from reference.derive import Equations, derive
from reference.errata import errata
from reference.linearity import linearity
from reference.linearize import Linearization, classify, linearize
from reference.load import load_system
from reference.modes import modes, poles, s, transfer_functions
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
    write = writer(system)
    latex = style_of(system, "latex").math
    left = equations.mass * sp.Matrix(system.a)
    rows = [sp.Eq(a, f, evaluate=False) for a, f in zip(left, equations.force, strict=True)]

    def named(item: Any, symbol: Any) -> dict[str, str]:
        about = {"name": item.name, "unit": item.unit, "description": item.description}
        return {**about, "mathml": write(symbol)}

    def formula(expression: Any) -> dict[str, str]:
        expression = sp.sympify(expression)
        return {
            "text": sp.sstr(expression),
            "latex": latex(expression),
            "mathml": write(expression),
        }

    energies = {"T": system.T, "V": system.V, "D": system.D, "L": system.T - system.V}
    record = {
        "name": system.name,
        "title": system.title,
        "source": system.source,
        "kind": classify(len(system.inputs), len(system.outputs)),
        "coordinates": [named(c, c.q) for c in system.coordinates],
        "constants": [
            {**named(c, c.symbol), "value": float(c.value), "source": c.source}
            for c in system.constants
        ],
        "inputs": [named(i, i.symbol) for i in system.inputs],
        "outputs": [
            {"name": o.name, "unit": o.unit, "description": o.description, **formula(o.expression)}
            for o in system.outputs
        ],
        "energies": {name: formula(expression) for name, expression in energies.items()},
        "equations": [formula(row) for row in rows],
        "linearizations": [
            {
                **_linear_record(one),
                "mathml": _linear_mathml(one, system),
                "transfer_functions": [
                    {
                        "output": o.name,
                        "input": i.name,
                        **formula(function),
                        "mathml": equal(
                            f"<mfrac>{write(sp.Symbol(o.name))}{write(i.symbol)}</mfrac>",
                            rational(write, function, s),
                        ),
                    }
                    for (o, i), function in _transfers(one, system).items()
                ],
            }
            for one in linear
        ],
        "linearity": [
            {
                "equilibrium": e.equilibrium,
                "mode": e.mode,
                "period": e.period,
                "amplitudes": list(e.amplitudes),
                "errors": list(e.errors),
            }
            for one in linear
            for e in linearity(equations, one)
        ],
        "errata": [
            {
                "number": e.published.number,
                "printed": e.published.text,
                "verdict": e.verdict,
                "derived": e.derived,
                "difference": e.difference,
                "note": e.published.note,
            }
            for e in errata(equations, linear)
        ],
        "scenarios": [
            {
                "name": s.name,
                "description": s.description,
                "duration": float(s.duration),
                "inputs": {i.name: sp.sstr(sp.sympify(s.inputs[i])) for i in system.inputs},
                "segments": len(motions[s.name].t),
                "method": motions[s.name].method,
                "bound": float(np.max(motions[s.name].bound)),
            }
            for s in system.scenarios
        ],
    }
    sketch = sketch_record(system)
    return record if sketch is None else {**record, "sketch": sketch}


def _brief(system: System) -> dict[str, Any]:
    return {
        "name": system.name,
        "constants": [
            {"name": c.name, "unit": c.unit, "value": float(c.value)} for c in system.constants
        ],
        "scenarios": [{"name": s.name} for s in system.scenarios],
    }


def _linear_record(one: Linearization) -> dict[str, Any]:
    return {
        "equilibrium": one.equilibrium,
        "position": one.position.tolist(),
        "matrices": {name: array.tolist() for name, array in one.arrays.items()},
        "poles": [
            {
                "real": p.value.real,
                "imaginary": p.value.imag,
                "multiplicity": p.multiplicity,
                "frequency": p.frequency,
                "damping": p.damping,
            }
            for p in poles(one)
        ],
        "modes": [
            {
                "frequency": float(m.frequency),
                "growth": float(m.growth),
                "shape": m.shape.tolist(),
                "rigid": m.rigid,
            }
            for m in modes(one)
        ],
    }


def _transfers(one: Linearization, system: System) -> dict[tuple[Any, Any], Any]:
    functions = transfer_functions(one)
    return {
        (o, i): functions[row, column]
        for row, o in enumerate(system.outputs)
        for column, i in enumerate(system.inputs)
    }


def _linear_mathml(one: Linearization, system: System) -> str:
    """M a + C v + K q = F u, the matrices written out and terms of zeros left out."""
    write = writer(system)
    if len(system.q) == 1:
        left = one.mass[0] * system.a[0] + one.damping[0] * system.v[0]
        pushed = sum((f * u for f, u in zip(one.input, system.u, strict=True)), sp.Integer(0))
        return equal(write(left + one.stiffness[0] * system.q[0]), write(pushed))

    def column(symbols: Any) -> str:
        return matrix(write, [[symbol] for symbol in symbols])

    terms = [
        matrix(write, factor.tolist()) + column(symbols)
        for factor, symbols in (
            (one.mass, system.a),
            (one.damping, system.v),
            (one.stiffness, system.q),
        )
        if any(factor)
    ]
    driven = system.inputs and any(one.input)
    push = matrix(write, one.input.tolist()) + column(system.u) if driven else write(0)
    return equal(f"<mrow>{'<mo>+</mo>'.join(terms)}</mrow>", f"<mrow>{push}</mrow>")
