"""The source's printed equations held against the derived ones: a table that is computed.

The transcript of the source has lost signs. Each place where one is missing is entered as `±` and
tried both ways: an equation *agrees*, *agrees up to signs* that the transcript can't decide, or
*differs* whatever the signs were.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import sympy as sp
from sympy.parsing.sympy_parser import parse_expr

from reference.derive import Equations
from reference.linearize import Linearization
from reference.system import DeclarationError, PublishedEquation, System

AGREES = "agrees"
UP_TO_SIGNS = "agrees up to signs"
DIFFERS = "differs"

_FUNCTIONS = {
    name: getattr(sp, name)
    for name in ("sin", "cos", "tan", "exp", "sqrt", "pi", "Integer", "Float", "Rational", "Symbol")
}


@dataclass(frozen=True)
class Erratum:
    """One printed equation and its class.

    Attributes:
        derived: what the derivation has in its place, as an equation in plain text.
        difference: printed minus derived under the signs that leave least, "" where it agrees.
    """

    printed: PublishedEquation
    verdict: str
    derived: str
    difference: str


def errata(equations: Equations, linearizations: tuple[Linearization, ...]) -> tuple[Erratum, ...]:
    """Compare every printed equation with the derived one.

    Motions are compared up to a nonzero factor that may depend on constants alone; potential
    energies up to a constant; the other energies exactly.

    Raises:
        DeclarationError: for an equation that can't be read, or that names what is not there.
    """
    return tuple(
        _compare(printed, equations, linearizations) for printed in equations.system.printed
    )


def _compare(
    printed: PublishedEquation, equations: Equations, linearizations: tuple[Linearization, ...]
) -> Erratum:
    candidates = _candidates(printed, equations, linearizations)
    if not printed.driven:
        still = dict.fromkeys(equations.system.u, sp.Integer(0))
        candidates = [sp.sympify(candidate).xreplace(still) for candidate in candidates]
    readings = _readings(printed, equations.system)
    motion = printed.states in ("motion", "linear")
    variables = {*equations.system.q, *equations.system.v, *equations.system.a, *equations.system.u}
    best: tuple[int, sp.Expr, sp.Expr] | None = None  # the fewest, then the plainest terms
    for reading in readings:
        for candidate in candidates:
            left = _left_over(reading, candidate, variables, motion, printed.states == "V")
            size = 0 if left == 0 else len(sp.sstr(sp.expand(left)))
            if best is None or size < best[0]:
                best = (size, candidate, left)
    assert best is not None  # there is always a reading and a candidate
    size, candidate, left = best
    agreement = UP_TO_SIGNS if "±" in printed.text else AGREES
    verdict = DIFFERS if size else agreement
    shown = f"{sp.sstr(candidate)} = 0" if motion else sp.sstr(candidate)
    return Erratum(printed, verdict, shown, sp.sstr(sp.expand(left)) if size else "")


def _candidates(
    printed: PublishedEquation, equations: Equations, linearizations: tuple[Linearization, ...]
) -> list[sp.Expr]:
    system = equations.system
    where = f"system {system.name!r}, Eq. {printed.number}"
    if printed.states in ("T", "V", "D"):
        return [getattr(system, printed.states)]
    if printed.states == "L":
        return [system.T - system.V]
    if printed.states == "motion":
        names = [c.name for c in system.coordinates]
        if printed.of not in names:
            raise DeclarationError(f"{where}: {printed.of!r} is no coordinate")
        return [equations.residual[names.index(printed.of)]]
    for linearization in linearizations:
        if linearization.equilibrium == printed.of:
            deviation = sp.Matrix(system.q) - sp.Matrix(linearization.at)
            rows = (
                linearization.mass * sp.Matrix(system.a)
                + linearization.damping * sp.Matrix(system.v)
                + linearization.stiffness * deviation
                - linearization.input * sp.Matrix(len(system.u), 1, system.u)
            )
            return list(rows)
    raise DeclarationError(f"{where}: {printed.of!r} is no equilibrium")


def _left_over(
    reading: sp.Expr, candidate: sp.Expr, variables: set[sp.Symbol], motion: bool, potential: bool
) -> sp.Expr:
    difference = sp.simplify(reading - candidate)
    if difference == 0 or not motion:
        constant = potential and not difference.free_symbols & variables
        return sp.Integer(0) if constant else difference
    # Scale by the coefficient of an acceleration that both have; any other common factor would
    # leave that term unequal.
    for variable in sorted(variables, key=str):
        ours = sp.expand(candidate).coeff(variable)
        theirs = sp.expand(reading).coeff(variable)
        if ours != 0 and theirs != 0 and str(variable).endswith("_ddot"):
            factor = sp.simplify(ours / theirs)
            if not factor.free_symbols & variables:
                return sp.simplify(sp.expand(factor * reading - candidate))
    return difference


def _readings(printed: PublishedEquation, system: System) -> list[sp.Expr]:
    names = {str(symbol): symbol for symbol in (*system.q, *system.v, *system.a, *system.u)}
    names |= {c.name: c.symbol for c in system.constants}
    count = printed.text.count("±")
    signs = sp.symbols(f"sign_:{count}") if count else ()
    numbered = iter(range(count))
    text = re.sub("±", lambda _: f"+ sign_{next(numbered)}*", printed.text)
    for coordinate in system.coordinates:
        text = re.sub(rf"\b{coordinate.name}''", f"{coordinate.name}_ddot", text)
        text = re.sub(rf"\b{coordinate.name}'", f"{coordinate.name}_dot", text)
    sides = text.replace("^", "**").split("=")
    try:
        parsed = [
            parse_expr(side, local_dict=names | {str(s): s for s in signs}, global_dict=_FUNCTIONS)
            for side in sides
        ]
    except Exception as error:
        where = f"system {system.name!r}, Eq. {printed.number}"
        raise DeclarationError(f"{where}: can't read {printed.text!r}: {error}") from None
    expression = parsed[0] - parsed[1] if len(parsed) == 2 else parsed[0]
    known = {*names.values(), *signs}
    for symbol in sorted(expression.free_symbols - known, key=str):
        raise DeclarationError(
            f"system {system.name!r}, Eq. {printed.number}: {symbol} is declared nowhere"
        )
    return [
        expression.subs(dict(zip(signs, values, strict=True)))
        for values in itertools.product((-1, 1), repeat=count)
    ]
