"""A system as a page to read: what `crosscheck derive` prints, computed from its declaration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
import sympy as sp

from harness.text.typeset import Style, deviation, style_of
from reference.derive import Equations, derive
from reference.errata import Erratum, errata
from reference.linearity import linearity
from reference.linearize import Linearization, classify, linearize, taylor, to_array
from reference.modes import Mode, Pole, damped_shapes, modes, poles, s, transfer_functions
from reference.numeric import Array
from reference.solve import is_linear
from reference.system import System

ORDER = 3
"""Order of the Taylor series: the first in which an odd force such as the sine bends."""


def describe(system: System, style: Literal["text", "latex"] = "text") -> str:
    """Return everything that is derived from a system, without integrating a scenario.

    Equations of motion, class, linearizations with poles, modes and transfer functions, Taylor
    series, the reach of the linear equations, and the errata of the source.

    Raises:
        DeclarationError: for an equilibrium that is none, or an erratum that can't be read.
    """
    page = style_of(system, style)
    equations = derive(system)
    linear = is_linear(equations)
    linearizations = tuple(linearize(equations, e) for e in system.equilibria)
    blocks = [*_declared(system, page), *_motion(equations, page, linear)]
    for linearization in linearizations:
        blocks += _equilibrium(equations, linearization, page, linear)
    blocks += _reach(equations, linearizations, page, linear)
    blocks += _errata(errata(equations, linearizations), system, page)
    return "\n\n".join(blocks) + "\n"


def _declared(system: System, page: Style) -> Iterator[str]:
    yield page.heading(system.title, 1)
    yield page.words(system.source)

    def symbol(x: sp.Symbol) -> str:
        return page.inline(page.math(x))

    rows = [(symbol(c.q), c.unit, "coordinate", c.description) for c in system.coordinates]
    rows += [(symbol(i.symbol), i.unit, "input", i.description) for i in system.inputs]
    yield page.table(
        ("symbol", "unit", "kind", "meaning"),
        [(name, *map(page.words, rest)) for name, *rest in rows],
    )
    yield page.heading("Constants", 2)
    sources = list(dict.fromkeys(c.source for c in system.constants))
    yield page.table(
        ("symbol", "value", "unit", "meaning", "source"),
        [
            (
                symbol(c.symbol),
                page.inline(page.number(c.value)),
                page.words(c.unit),
                page.words(c.description),
                str(sources.index(c.source) + 1),
            )
            for c in system.constants
        ],
    )
    yield page.table(("", "source"), [(str(i), page.words(x)) for i, x in enumerate(sources, 1)])


def _motion(equations: Equations, page: Style, linear: bool) -> Iterator[str]:
    system = equations.system
    yield page.heading("Energies, dissipation and generalized forces", 2)
    formulas = [(name, page.math(getattr(system, name))) for name in ("T", "V", "D")]
    formulas += [
        (page.subscript("Q", page.math(c.q)), page.math(force))
        for c, force in zip(system.coordinates, system.forces(), strict=True)
    ]
    yield page.display(formulas)
    yield page.heading("Equations of motion", 2)
    formulas = []
    for row, force in zip(equations.mass.tolist(), equations.force, strict=True):
        terms = sp.expand(force).as_ordered_terms()
        # The motion's own forces first, then the inputs.
        terms.sort(key=lambda term: bool(term.free_symbols & {*system.u}))
        left = page.sum(list(zip(row, system.a, strict=True)))
        formulas.append((left, page.sum([(term, sp.Integer(1)) for term in terms])))
    yield page.display(formulas)
    kind = classify(len(system.inputs), len(system.outputs))
    inputs, outputs = (
        ", ".join(page.inline(page.math(sp.sympify(x))) for x in found) or "none"
        for found in (system.u, [o.expression for o in system.outputs])
    )
    shape = "linear" if linear else "nonlinear"
    yield f"{kind}, {shape}. Inputs: {inputs}. Outputs: {outputs}."


def _equilibrium(
    equations: Equations, linearization: Linearization, page: Style, linear: bool
) -> Iterator[str]:
    system = equations.system
    (declared,) = (e for e in system.equilibria if e.name == linearization.equilibrium)
    remark = f": {declared.description}" if declared.description else ""
    yield page.heading(f"Equilibrium {declared.name}{remark}", 2)
    yield page.display(
        [(page.math(q), page.math(at)) for q, at in zip(system.q, linearization.at, strict=True)]
    )
    state = ", ".join(page.math(x) for x in (*system.q, *system.v))
    yield (
        f"Linearized: {page.inline(page.linear)}, or {page.inline(page.first_order)}"
        f" with {page.inline(f'y = ({state})')}"
    )
    yield "\n".join(_matrices(linearization, system, page))
    yield page.heading("Poles", 3)
    yield page.table(
        ("1/s", "rad/s", "Hz", "damping ratio", "times", ""),
        [_pole(pole, page) for pole in poles(linearization)],
    )
    yield page.heading("Modes without damping, largest entry 1", 3)
    yield page.table(
        ("rad/s", "Hz", *(page.inline(page.math(q)) for q in system.q), ""),
        [_mode(mode, page) for mode in modes(linearization)],
    )
    if any(linearization.damping) and len(system.q) > 1:
        yield page.heading("Modes with damping: share and phase of each coordinate", 3)
        yield page.table(
            ("1/s", *(page.inline(page.math(q)) for q in system.q)),
            [
                (
                    page.inline(page.complex_number(value)),
                    *(page.inline(page.polar(complex(z))) for z in shape),
                )
                for value, shape in damped_shapes(linearization)
            ],
        )
    if system.inputs:
        yield page.heading("Transfer functions", 3)
        yield page.display(_transfers(linearization, system, page))
    if not linear:
        yield page.heading(f"Taylor series of the equations of motion to order {ORDER}", 3)
        yield from _series(equations, linearization, page)


def _matrices(linearization: Linearization, system: System, page: Style) -> Iterator[str]:
    inverse = linearization.mass.inv() if len(system.q) < 3 else None
    symbolic: dict[str, sp.Matrix] = {
        "M": linearization.mass,
        "C": linearization.damping,
        "K": linearization.stiffness,
    }
    if inverse is not None:
        n = len(system.q)
        zero, one = sp.zeros(n), sp.eye(n)
        below = (-inverse * linearization.stiffness).row_join(-inverse * linearization.damping)
        symbolic["A"] = zero.row_join(one).col_join(below)
        if system.inputs:
            pushed = inverse * linearization.input
            symbolic["B"] = sp.zeros(n, len(system.u)).col_join(pushed)
    for name in ("M", "C", "K", "A", "B"):
        numbers = to_array(linearization.exact[name])
        if not numbers.size:
            continue
        forms = [[[page.number(value + 0.0) for value in row] for row in numbers]]
        if name in symbolic and any(e.free_symbols for e in symbolic[name]):
            tidy = symbolic[name].applyfunc(sp.factor if name in "AB" else sp.expand)
            forms.insert(0, [[page.math(e) for e in row] for row in tidy.tolist()])
        yield page.matrix(name, forms)


def _pole(pole: Pole, page: Style) -> tuple[str, ...]:
    if pole.frequency == 0:
        remark = "rigid body" if pole.multiplicity > 1 else "drifts"
    elif pole.value.imag == 0 and pole.multiplicity > 1 and pole.value.real < 0:
        remark = "critically damped"
    else:
        remark = "grows" if pole.value.real > 0 else ""
    damping = "" if np.isnan(pole.damping) else page.inline(page.number(pole.damping))
    return (
        page.inline(page.complex_number(pole.value, pair=True)),
        page.inline(page.number(pole.frequency)),
        page.inline(page.number(pole.frequency / (2 * np.pi))),
        damping,
        str(pole.multiplicity),
        remark,
    )


def _mode(mode: Mode, page: Style) -> tuple[str, ...]:
    if mode.rigid:
        remark = "rigid body"
    elif mode.growth > 0:
        remark = f"grows, {mode.growth:.6g} 1/s"
    else:
        remark = ""
    return (
        page.inline(page.number(mode.frequency)),
        page.inline(page.number(mode.frequency / (2 * np.pi))),
        *(page.inline(page.number(float(x))) for x in _clean(mode.shape)),
        remark,
    )


def _clean(shape: Array) -> Array:
    """Return a shape with what is rounding set to zero."""
    return np.where(np.abs(shape) < 1e-12, 0.0, shape)


def _transfers(linearization: Linearization, system: System, page: Style) -> list[tuple[str, str]]:
    functions = transfer_functions(linearization)
    formulas = []
    for i, output in enumerate(system.outputs):
        for j, u in enumerate(system.u):
            above, below = sp.fraction(sp.together(functions[i, j]))
            if sp.Poly(below, s).LC().could_extract_minus_sign():
                above, below = -above, -below
            name = page.math(sp.Symbol(output.name))
            left = page.fraction(name, page.math(u))
            right = (
                "0"
                if above == 0
                else page.fraction(
                    page.polynomial(sp.expand(above), s), page.polynomial(sp.expand(below), s)
                )
            )
            formulas.append((left, right))
    return formulas


def _series(equations: Equations, linearization: Linearization, page: Style) -> Iterator[str]:
    system = equations.system
    shifted = {q: deviation(q) for q, at in zip(system.q, linearization.at, strict=True) if at != 0}
    if shifted:
        yield page.display(
            [
                (page.math(d), page.math(q - linearization.at[system.q.index(q)]))
                for q, d in shifted.items()
            ]
        )
    place = dict(zip(system.q, linearization.at, strict=True))
    rest: Mapping[sp.Symbol, sp.Expr] = place | dict.fromkeys(
        (*system.v, *system.a, *system.u), sp.Integer(0)
    )
    formulas = []
    for row in equations.residual:
        series = taylor(row, rest, ORDER)
        moved = series.subs({q: d + place[q] for q, d in shifted.items()}, simultaneous=True)
        variables = [*system.a, *system.v, *(shifted.get(q, q) for q in system.q), *system.u]
        terms = sp.Poly(sp.expand(moved), *variables).terms()
        # Linear terms first; acceleration, velocity, position within each degree.
        terms.sort(key=lambda term: (sum(term[0]), [-power for power in term[0]]))
        driven = [_term(t, variables) for t in terms if any(t[0][len(system.q) * 3 :])]
        free = [_term(t, variables) for t in terms if not any(t[0][len(system.q) * 3 :])]
        formulas.append((page.sum(free), page.sum([(-c, f) for c, f in driven])))
    yield page.display(formulas)


def _term(
    term: tuple[tuple[int, ...], sp.Expr], variables: Sequence[sp.Symbol]
) -> tuple[sp.Expr, sp.Expr]:
    powers, coefficient = term
    factors = (x**p for x, p in zip(variables, powers, strict=True))
    return coefficient, sp.Mul(*factors)


def _reach(
    equations: Equations, linearizations: tuple[Linearization, ...], page: Style, linear: bool
) -> Iterator[str]:
    if linear:
        return
    yield page.heading("How far the linear equations hold", 2)
    yield page.words(
        "Largest error of a position over one period of the mode, released at rest in its shape,\n"
        "relative to the amplitude (the shape's largest entry)."
    )
    for linearization in linearizations:
        found = linearity(equations, linearization)
        if not found:
            yield page.words(
                f"{linearization.equilibrium}: unstable, the motion leaves at any amplitude."
            )
            continue
        header = [
            f"{linearization.equilibrium}, mode {f.mode + 1} of {f.period:.6g} s" for f in found
        ]
        rows = zip(found[0].amplitudes, *(f.errors for f in found), strict=True)
        yield page.table(
            ("amplitude", *map(page.words, header)),
            [
                (f"{amplitude:g}", *(page.words(f"{100 * e:.3g} %") for e in errors))
                for amplitude, *errors in rows
            ],
        )


def _errata(table: tuple[Erratum, ...], system: System, page: Style) -> Iterator[str]:
    if not table:
        return
    yield page.heading("The source's equations against these", 2)
    worst = sum(row.verdict == "differs" for row in table)
    said = f"{worst} of {len(table)} differs" if worst else f"none of {len(table)} differs"
    yield page.words(f"Computed, each missing sign (±) tried both ways: {said}.")
    for row in table:
        claim = row.published.states + (f" of {row.published.of}" if row.published.of else "")
        if row.published.states == "linear":
            claim = f"linear about {row.published.of}"
        rows = [
            ("published", page.code(row.published.text)),
            ("derived", page.code(_plain(row.derived, system))),
        ]
        if row.difference:
            rows.append(("left over", page.code(_plain(row.difference, system))))
        if row.published.note:
            rows.append(("note", page.words(row.published.note)))
        title = page.words(f"Eq. {row.published.number}")
        yield page.table((title, page.words(f"{claim}: {row.verdict}")), rows)


def _plain(text: str, system: System) -> str:
    """Return what the errata print, with primes and carets as the declaration writes them."""
    for c in sorted(system.coordinates, key=lambda c: -len(c.name)):
        text = text.replace(f"{c.name}_ddot", f"{c.name}''").replace(f"{c.name}_dot", f"{c.name}'")
    return text.replace("**", "^")
