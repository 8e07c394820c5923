"""Comparison of the source's published equations with the derived ones.

The transcript of the source has lost signs. Each lost sign is entered as `±` and tried both ways.
An equation *agrees*, *agrees up to signs* that the transcript leaves open, or *differs* for every
choice of signs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import sympy as sp

from physics_crosscheck.reference.mechanism.declaration import (
    Coordinate,
    DeclarationError,
    PublishedEquation,
)
from .derive import Equations
from .linearize import TaylorLinearization, taylor
from .notation import EquationReading, names_what_is_derived, readings

AGREES = "agrees"
UP_TO_SIGNS = "agrees up to signs"
DIFFERS = "differs"

Comparison: TypeAlias = tuple[sp.Expr, sp.Expr]
"""A derived expression, and the difference of the published one, which is zero if they agree."""


@dataclass(frozen=True, kw_only=True)
class EquationCheck:
    """One published equation and its verdict.

    Attributes:
        derived: the derived result in plain text: equations for a motion, an expression for a
            value.
        difference: published minus derived for the signs with the smallest difference; "" if they
            agree.
    """

    published: PublishedEquation
    verdict: str
    derived: str
    difference: str


def errata(
    equations: Equations, linearizations: tuple[TaylorLinearization, ...]
) -> tuple[EquationCheck, ...]:
    """Compare every published equation with the derived one.

    Equations of motion are compared up to a nonzero factor of constants, potential energies up to a
    constant, and everything else exactly.

    Raises:
        DeclarationError: for an equation that can't be parsed, or that uses an unknown name.
    """
    return tuple(
        _compare(published, equations, linearizations) for published in equations.system.published
    )


def best_reading(
    published: PublishedEquation,
    equations: Equations,
    linearizations: tuple[TaylorLinearization, ...],
) -> list[Comparison]:
    """Return the derived expressions and what the nearest reading of an equation differs by.

    Raises:
        DeclarationError: as `errata`.
    """
    match published.states:
        case "motion":
            choices = _motions(published, equations)
        case "linear":
            choices = _linear(published, equations, linearizations)
        case "linear part":
            choices = _linear_parts(published, equations)
        case _:
            choices = _values(published, equations)
    return min(choices, key=_size)  # the fewest, then the simplest terms


def _compare(
    published: PublishedEquation,
    equations: Equations,
    linearizations: tuple[TaylorLinearization, ...],
) -> EquationCheck:
    best = best_reading(published, equations, linearizations)
    agreement = UP_TO_SIGNS if "±" in published.text else AGREES
    ending = " = 0" if published.states in ("motion", "linear") else ""
    # All sides of a chain are compared with one derived expression.
    derived = dict.fromkeys(f"{sp.sstr(expression)}{ending}" for expression, _ in best)
    return EquationCheck(
        published=published,
        verdict=DIFFERS if _size(best) else agreement,
        derived="; ".join(derived),
        difference="; ".join(
            sp.sstr(sp.expand(sp.simplify(difference))) for _, difference in best if difference != 0
        ),
    )


def _size(choice: Sequence[Comparison]) -> int:
    return sum(len(sp.sstr(difference)) for _, difference in choice if difference != 0)


def _motions(published: PublishedEquation, equations: Equations) -> list[list[Comparison]]:
    """Return the comparison of each reading, for one coordinate or for every coordinate."""
    system = equations.system
    concerned: list[tuple[int, Coordinate | None]]
    if published.of:
        names = [c.name for c in system.coordinates]
        if published.of not in names:
            raise DeclarationError(
                f"{_place(published, equations)}: {published.of!r} is not a coordinate"
            )
        concerned = [(names.index(published.of), None)]
    else:
        concerned = list(enumerate(system.coordinates))
    choices: list[list[Comparison]] = []
    for index, coordinate in concerned:
        derived = _undriven(equations.residual[index], published, equations)
        comparisons = [
            (derived, _motion_left_over(reading, derived, equations))
            for reading in readings(published, system, coordinate)
        ]
        choices = [
            [*c, f] for c, f in zip(choices or [[] for _ in comparisons], comparisons, strict=True)
        ]
    return choices


def _linear(
    published: PublishedEquation,
    equations: Equations,
    linearizations: tuple[TaylorLinearization, ...],
) -> list[list[Comparison]]:
    """Return the comparisons of each reading with each row of the linear equations."""
    system = equations.system
    for linearization in linearizations:
        if linearization.equilibrium == published.of:
            break
    else:
        raise DeclarationError(
            f"{_place(published, equations)}: {published.of!r} is not an equilibrium"
        )
    deviation = sp.Matrix(system.q) - sp.Matrix(linearization.symbolic_position)
    rows = (
        linearization.mass * sp.Matrix(system.a)
        + linearization.damping * sp.Matrix(system.v)
        + linearization.stiffness * deviation
        - linearization.input * sp.Matrix(len(system.u), 1, system.u)
    )
    return [
        [(derived, _motion_left_over(reading, derived, equations))]
        for reading in readings(published, system)
        for derived in (_undriven(row, published, equations) for row in rows)
    ]


def _linear_parts(published: PublishedEquation, equations: Equations) -> list[list[Comparison]]:
    """Return comparisons of each reading: the other sides with the first side's Taylor series."""
    system = equations.system
    for coordinate in system.coordinates:
        if coordinate.name == published.of:
            break
    else:
        raise DeclarationError(
            f"{_place(published, equations)}: {published.of!r} is not a coordinate"
        )
    choices = []
    for reading in readings(published, system):
        derived = taylor(reading.sides[0], {coordinate.q: reading.point}, 1)
        choices.append(
            [(derived, _left_over(expression, derived)) for expression in reading.sides[1:]]
        )
    return choices


def _values(published: PublishedEquation, equations: Equations) -> list[list[Comparison]]:
    """Return comparisons of each reading: the other sides with the quantity on the first side."""
    system = equations.system
    if not names_what_is_derived(published, system):
        raise DeclarationError(
            f"{_place(published, equations)}: the left side of "
            f"{published.text!r} must name only an energy, a quantity or a derivative "
            "of one"
        )
    variables = _variables(equations)
    choices = []
    for reading in readings(published, system):
        derived = _undriven(reading.sides[0], published, equations)
        comparisons = []
        for expression in reading.sides[1:]:
            difference = _left_over(expression, derived)
            # The zero of a potential energy is arbitrary.
            constant = derived == system.V and not difference.free_symbols & variables
            comparisons.append((derived, sp.Integer(0) if constant else difference))
        choices.append(comparisons)
    return choices


def _place(published: PublishedEquation, equations: Equations) -> str:
    return f"system {equations.system.name!r}, Eq. {published.number}"


def _variables(equations: Equations) -> set[sp.Symbol]:
    system = equations.system
    return {*system.q, *system.v, *system.a, *system.u}


def _undriven(derived: sp.Expr, published: PublishedEquation, equations: Equations) -> sp.Expr:
    """Return the derived expression, without inputs if the source has none."""
    if published.driven:
        return derived
    return derived.xreplace(dict.fromkeys(equations.system.u, sp.Integer(0)))


def _left_over(published: sp.Expr, derived: sp.Expr) -> sp.Expr:
    """Return the difference, simplified to exactly zero if the expressions are equal."""
    difference = sp.expand(published - derived)
    if difference == 0 or _is_something(difference):
        return difference
    return sp.simplify(difference)


def _is_something(expression: sp.Expr) -> bool:
    """Return whether a value at a generic point proves that an expression is nonzero."""
    symbols = sorted(expression.free_symbols, key=str)
    place = {symbol: sp.Rational(7 * i + 3, 11) for i, symbol in enumerate(symbols)}
    return bool(abs(sp.N(expression.xreplace(place), 30)) > 1e-12)


def _motion_left_over(reading: EquationReading, derived: sp.Expr, equations: Equations) -> sp.Expr:
    left_side, right_side = reading.sides
    published = left_side - right_side
    difference = _left_over(published, derived)
    if difference == 0:
        return difference
    # Scale by the coefficient of an acceleration in both; any other common factor would leave that
    # term unequal.
    variables = _variables(equations)
    for acceleration in sorted(equations.system.a, key=str):
        ours = sp.expand(derived).coeff(acceleration)
        theirs = sp.expand(published).coeff(acceleration)
        if ours != 0 and theirs != 0:
            factor = sp.simplify(ours / theirs)
            if not factor.free_symbols & variables:
                return _left_over(sp.expand(factor * published), derived)
    return difference
