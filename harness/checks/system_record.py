"""Record of a system: everything that a report shows about its physics."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeAlias, cast

import sympy as sp

from physics_crosscheck.harness.records import system as records
from physics_crosscheck.harness.records.base import number, numbers, record_of, rows
from physics_crosscheck.harness.render.terminal.typeset import Latex, SumTerms, latex_name
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.dynamics.derive import LONG_OPERATIONS, Equations
from physics_crosscheck.reference.dynamics.errata import EquationCheck, errata
from physics_crosscheck.reference.dynamics.linearize import (
    TaylorLinearization,
    classify,
    modes,
    poles,
    s,
    transfer_functions,
)
from physics_crosscheck.reference.mechanism.assemble import TreeSystem
from physics_crosscheck.reference.mechanism.declaration import Coordinate, Input
from physics_crosscheck.reference.mechanism.sketch import Angle, Body, Link, Shape, expressions
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.linearity import linearity
from physics_crosscheck.reference.solving.segments import Motion, Segments


def system_record(
    folder: Path,
    equations: Equations,
    linear: tuple[TaylorLinearization, ...],
    motions: Mapping[str, Motion],
    *,
    described: bool,
) -> records.SystemResult:
    """Build the record of a system.

    Args:
        linear: linearizations about each equilibrium.
        motions: motions of every scenario, by name.
        described: whether to include the derivation as formulas. They take longer than all the
            rest, and only a report shows them.
    """
    system = equations.system
    latex = Latex(system.q, system.v, system.a)
    return records.SystemResult(
        name=system.name,
        folder=str(folder),
        title=system.title,
        source=system.source,
        kind=cast(
            Literal["SISO", "SIMO", "MISO", "MIMO", "autonomous"],
            classify(len(system.inputs), len(system.outputs)),
        ),
        coordinates=quantities(system.coordinates),
        constants=constants(system),
        inputs=quantities(system.inputs),
        outputs=tuple(
            record_of(records.OutputFormula, o, formula=_formula(o.expression, latex))
            for o in system.outputs
        ),
        scenarios=_scenarios(system, motions),
        derivation=_derivation(equations, linear, latex) if described else None,
        sketch=sketch_record(system),
    )


TREE_METHOD = "recursion along the tree; Gauss collocation of order 16, checked by DOP853"


def tree_record(
    folder: str, system: TreeSystem, drawn: Segments, scenario: str, motion: float = 0.0
) -> records.SystemResult:
    """Return the record of a tree: its joints, the sampled states and its motion.

    Args:
        folder: the system folder, or the file.
        system: the tree.
        drawn: the sampled states.
        scenario: name of the states.
        motion: duration of a motion from rest, seconds; 0 for none.
    """
    count = len(drawn.start)
    return records.SystemResult(
        name=system.name,
        folder=folder,
        title=system.title,
        source=system.source,
        kind="autonomous",
        coordinates=quantities(system.coordinates),
        constants=(),
        inputs=(),
        outputs=(),
        scenarios=(
            records.ReferenceMotion(
                name=scenario,
                description=f"{counted(count, 'state')}, each under its own forces"
                + (f"; and a motion of {motion:g} s from rest" if motion else ""),
                duration=drawn.length,
                inputs={},
                segments=count,
                method=TREE_METHOD,
                bound=number(float(drawn.bound.max())),
                global_bound=None,
            ),
        ),
    )


def quantities(declared: tuple[Coordinate, ...] | tuple[Input, ...]) -> tuple[records.Symbol, ...]:
    """Build the records of coordinates or inputs."""
    return tuple(record_of(records.Symbol, each, latex=latex_name(each.name)) for each in declared)


def constants(system: System) -> tuple[records.ConstantValue, ...]:
    """Build the records of a system's constants."""
    return tuple(
        record_of(records.ConstantValue, c, latex=latex_name(c.name), value=float(c.value))
        for c in system.constants
    )


def motion_terms(equations: Equations) -> tuple[tuple[SumTerms, SumTerms], ...]:
    """Return both sides of each row of M a = f: accelerations; internal forces, then the inputs."""
    system = equations.system
    sides: list[tuple[SumTerms, SumTerms]] = []
    for row, force in zip(equations.mass.tolist(), equations.force, strict=True):
        if sp.count_ops(force) > LONG_OPERATIONS:  # an order that needs no comparison of long terms
            parts = list(sp.Add.make_args(force))
        else:
            parts = sp.expand(force).as_ordered_terms()
        parts.sort(key=lambda term: bool(term.free_symbols & {*system.u}))
        accelerations = list(zip(row, system.a, strict=True))
        sides.append((accelerations, [(term, sp.Integer(1)) for term in parts]))
    return tuple(sides)


def pole_records(linearization: TaylorLinearization) -> tuple[records.Pole, ...]:
    """Build the records of a linearization's poles."""
    return tuple(
        record_of(records.Pole, p, real=number(p.value.real), imaginary=number(p.value.imag))
        for p in poles(linearization)
    )


def mode_records(linearization: TaylorLinearization) -> tuple[records.Mode, ...]:
    """Build the records of a linearization's undamped modes."""
    return tuple(record_of(records.Mode, mode) for mode in modes(linearization))


def linearity_records(
    equations: Equations, linearization: TaylorLinearization
) -> tuple[records.Linearity, ...]:
    """Build the records of a linearization's range of validity, by mode."""
    every = linearity(equations, linearization)
    return tuple(record_of(records.Linearity, one) for one in every)


def errata_records(
    equations: Equations, linear: tuple[TaylorLinearization, ...]
) -> tuple[tuple[str, records.Erratum], ...]:
    """Build the records of every published equation, with the equation that it claims to be."""
    return tuple(_erratum(found) for found in errata(equations, linear))


def _erratum(check: EquationCheck) -> tuple[str, records.Erratum]:
    published = check.published
    claimed = published.states + (f" of {published.of}" if published.of else "")
    if published.states == "linear":
        claimed = f"linear about {published.of}"
    return claimed, records.Erratum(
        number=published.number,
        published=published.text,
        verdict=cast(Literal["agrees", "agrees up to signs", "differs"], check.verdict),
        derived=check.derived,
        difference=check.difference,
        note=published.note,
    )


def _formula(expression: sp.Expr | float, latex: Latex) -> records.Formula:
    expression = sp.sympify(expression)
    return records.Formula(text=sp.sstr(expression), latex=latex.math(expression))


def _derivation(
    equations: Equations, linear: tuple[TaylorLinearization, ...], latex: Latex
) -> records.Derivation:
    system = equations.system
    inertial = equations.mass * sp.Matrix(system.a)
    energies = {"T": system.T, "V": system.V, "D": system.D, "L": system.T - system.V}
    return records.Derivation(
        energies={name: _formula(energy, latex) for name, energy in energies.items()},
        equations=tuple(
            records.Formula(
                text=sp.sstr(sp.Eq(a, f, evaluate=False)),
                latex=f"{latex.sum(inertia)} = {latex.sum(forces)}",
            )
            for a, f, (inertia, forces) in zip(
                inertial, equations.force, motion_terms(equations), strict=True
            )
        ),
        linearizations=tuple(
            _linearization(linearization, system, latex) for linearization in linear
        ),
        linearity=tuple(
            e for linearization in linear for e in linearity_records(equations, linearization)
        ),
        errata=tuple(erratum for _, erratum in errata_records(equations, linear)),
    )


def _linearization(
    linearization: TaylorLinearization, system: System, latex: Latex
) -> records.Linearization:
    functions = transfer_functions(linearization)
    return records.Linearization(
        equilibrium=linearization.equilibrium,
        position=numbers(linearization.position),
        formula=_linear_equations(linearization, system, latex),
        matrices={name: rows(array) for name, array in linearization.arrays.items()},
        poles=pole_records(linearization),
        modes=mode_records(linearization),
        transfer_functions=tuple(
            records.TransferFunction(
                output=o.name,
                input=i.name,
                formula=records.Formula(
                    text=sp.sstr(functions[row, column]),
                    latex=latex.rational(functions[row, column], s),
                ),
            )
            for row, o in enumerate(system.outputs)
            for column, i in enumerate(system.inputs)
        ),
    )


def _linear_equations(
    linearization: TaylorLinearization, system: System, latex: Latex
) -> records.Formula:
    """Format M a + C v + K q = F u, with the matrices written out and zero terms omitted."""
    symbols = (system.a, system.v, system.q)
    parts = zip(
        ("M", "C", "K"),
        (linearization.mass, linearization.damping, linearization.stiffness),
        symbols,
        strict=True,
    )
    left_terms = [
        (_readable(linearization, name, factor), of) for name, factor, of in parts if any(factor)
    ]
    driven = (
        [(_readable(linearization, "F", linearization.input), system.u)]
        if any(linearization.input)
        else []
    )
    sides = [[(m, sp.Matrix(of)) for m, of in side] for side in (left_terms, driven)]
    zero = _text(sp.zeros(len(system.q), 1))
    text = ", ".join(
        " + ".join(f"{_text(m)}*{_text(of)}" for m, of in side) or zero for side in sides
    )
    if len(system.q) == 1:
        written = [
            latex.sum([(m[0, i], of[i]) for m, of in side for i in range(m.cols)]) for side in sides
        ]
    else:
        written = [
            " + ".join(f"{_matrix(m, latex)} {_matrix(of, latex)}" for m, of in side) or "0"
            for side in sides
        ]
    return records.Formula(text=f"Eq({text})", latex=" = ".join(written))


def _readable(linearization: TaylorLinearization, name: str, matrix: sp.Matrix) -> sp.Matrix:
    """Return a matrix with its symbols, or with numbers where symbols would be too long to read."""
    if sum(sp.count_ops(entry) for entry in matrix) <= LONG_OPERATIONS:
        return matrix
    return sp.Matrix(linearization.arrays[name])


def _text(matrix: sp.Matrix) -> str:
    return f"Matrix({sp.sstr(matrix.tolist())})"


def _matrix(matrix: sp.Matrix, latex: Latex) -> str:
    return latex.matrix([[latex.math(entry) for entry in row] for row in matrix.tolist()])


def _scenarios(
    system: System, motions: Mapping[str, Motion]
) -> tuple[records.ReferenceMotion, ...]:
    return tuple(
        records.ReferenceMotion(
            name=each.name,
            description=each.description,
            duration=float(each.duration),
            inputs={i.name: sp.sstr(sp.sympify(each.inputs[i])) for i in system.inputs},
            segments=len(motions[each.name].t),
            method=motions[each.name].method,
            bound=number(float(motions[each.name].bound.max())),
            global_bound=number(float(motions[each.name].global_bound.max())),
        )
        for each in system.scenarios
    )


Kind: TypeAlias = Literal[
    "spring", "damper", "rod", "line", "wall", "measure", "block", "disc", "spiral"
]
"""Kinds of declared shapes, besides an angle."""


def sketch_record(system: System) -> records.Sketch | None:
    """Return the sketch of a system at the start of its first scenario; None if it has no
    sketch.
    """
    if not system.sketch:
        return None
    start = system.scenarios[0].q
    pose = [float(sp.sympify(start[c]).xreplace(system.values)) for c in system.coordinates]
    return records.Sketch(
        pose=numbers(pose), shapes=tuple(_shape(shape, system) for shape in system.sketch)
    )


def _shape(shape: Shape, system: System) -> records.Shape:
    trees = {name: tree(e, system) for name, e in expressions(shape).items()}
    match shape:
        case Link():
            return records.Shape(
                kind=cast(Kind, shape.kind),
                label=shape.label,
                start=[trees["start x"], trees["start y"]],
                end=[trees["end x"], trees["end y"]],
            )
        case Body():
            return records.Shape(
                kind=cast(Kind, shape.kind),
                label=shape.label,
                center=[trees["at x"], trees["at y"]],
                width=trees["width"],
                height=trees["height"],
                angle=trees["angle"],
            )
        case Angle():
            return records.Shape(
                kind="angle",
                label=shape.label,
                center=[trees["at x"], trees["at y"]],
                radius=trees["radius"],
                start=trees["start"],
                end=trees["end"],
            )


def tree(expression: sp.Expr, system: System) -> records.SketchTree:
    """Convert an expression of positions and constants to a tree, with the constants
    substituted.
    """
    places = {q: i for i, q in enumerate(system.q)}

    def walk(e: sp.Expr) -> records.SketchTree:
        if e in places:
            return ["q", places[e]]
        if e.is_number:
            return float(f"{float(e):.9g}")
        names = {sp.Add: "+", sp.Mul: "*", sp.Pow: "^", sp.sin: "sin", sp.cos: "cos", sp.tan: "tan"}
        return [names[e.func], *map(walk, e.args)]

    return walk(sp.sympify(expression).xreplace(system.values))
