"""Comparison of the source's published equations with the derived ones.

The transcript of the source has lost signs. Each lost sign is entered as `±` and tried both ways.
An equation *agrees*, *agrees up to signs* that the transcript leaves open, or *differs* for every
choice of signs.
"""

import ast
import itertools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import sympy as sp
from sympy.parsing.sympy_parser import parse_expr

from physics_crosscheck.reference.mechanism.declaration import (
    Coordinate,
    DeclarationError,
    PublishedEquation,
    about,
    t,
)
from physics_crosscheck.reference.mechanism.system import System
from .derive import Equations, simplify_bounded
from .linearize import TaylorLinearization, taylor

Names: TypeAlias = dict[str, sp.Expr | Callable[..., sp.Expr]]
"""The meaning of each word of a text."""

ENERGIES = ("T", "V", "D", "L")

MAX_DEGREE = 400
"""Largest degree of a side: its number of terms, counting powers by their exponents."""

MAX_SIGNS = 8
"""Largest number of signs `±` in an equation; every combination is tried."""

_FUNCTIONS = {
    name: getattr(sp, name)
    for name in ("sin", "cos", "tan", "exp", "sqrt", "pi", "Integer", "Float", "Rational", "Symbol")
}


EquationReading = tuple[tuple[sp.Expr, ...], sp.Expr]
"""Sides of an equation with one choice of its lost signs, and the expansion point of a linear part;
zero for other claims."""


def readings(
    published: PublishedEquation, system: System, coordinate: Coordinate | None = None
) -> list[EquationReading]:
    """Return every reading of an equation, in the order of its signs, minus first.

    Args:
        published: the equation.
        system: the system whose names it uses.
        coordinate: replaces q and Q in an equation for every coordinate.

    Raises:
        DeclarationError: for a text that can't be parsed, or an undeclared name.
    """
    with about("PublishedEquation", published.number):
        return _readings(published, system, coordinate)


def _readings(
    published: PublishedEquation, system: System, coordinate: Coordinate | None
) -> list[EquationReading]:
    where = f"system {system.name!r}, Eq. {published.number}"
    count = published.text.count("±")
    if count > MAX_SIGNS:
        raise DeclarationError(f"{where}: {count} signs ±; at most {MAX_SIGNS} are allowed")
    signs = sp.symbols(f"sign_:{count}") if count else ()
    names = _names(system, coordinate) | {str(sign): sign for sign in signs}
    names |= {f"{c.name}0": _point(c) for c in system.coordinates if c.name == published.of}
    text = _spelled(published.text, system, coordinate)
    equation, *settings = _split(text)
    try:
        for setting in settings:
            _set(setting, names, system)
        sides = tuple(_parsed(side, names) for side in equation.split("="))
    except Exception as error:
        raise DeclarationError(f"{where}: can't read {published.text!r}: {error}") from None
    _check_names(sides, system, {*signs, *map(_point, system.coordinates)}, where)
    chain = published.states in ("value", "linear part")
    if len(sides) < 2 or (len(sides) > 2 and not chain):
        raise DeclarationError(f"{where}: {published.text!r} has {len(sides)} sides; expected two")
    point = sp.sympify(names.get(f"{published.of}0", 0))
    return [
        (tuple(side.subs(choice) for side in sides), point.subs(choice))
        for values in itertools.product((-1, 1), repeat=count)
        for choice in [dict(zip(signs, values, strict=True))]
    ]


def names_what_is_derived(published: PublishedEquation, system: System) -> bool:
    """Return whether the left side is one energy, quantity or derivative, unused on other sides.

    Otherwise the equation would be compared with itself.
    """
    named = "|".join((*ENERGIES, *(q.name for q in system.quantities)))
    derivative = rf"d(?:{named})/d\w+'?"
    left_side, _, rest = published.text.partition("=")
    left_side = left_side.strip()
    forms = rf"(?:{named})(?:'*\(\w+\))?|{derivative}|d/dt\((?:{named}|{derivative})\)"
    again = rf"(?<!\w){re.escape(left_side)}(?![\w'(])"
    return bool(re.fullmatch(forms, left_side)) and not re.search(again, rest)


def _names(system: System, coordinate: Coordinate | None) -> Names:
    """Return the meaning of each name; declared names override energies."""
    names: Names = {"T": system.T, "V": system.V, "D": system.D, "L": system.T - system.V}
    if coordinate is not None:
        names["Q"] = system.forces()[system.coordinates.index(coordinate)]
    names |= {str(x): x for x in (*system.q, *system.v, *system.a, *system.u)}
    names |= {c.name: c.symbol for c in system.constants}
    names |= {q.name: _tidied(sp.sympify(q.expression)) for q in system.quantities}

    def rate(expression: sp.Expr) -> sp.Expr:
        """Return the time derivative along any motion."""
        each = zip(system.q, system.v, system.a, strict=True)
        summands = (sp.diff(expression, q) * v + sp.diff(expression, v) * a for q, v, a in each)
        return sp.Add(sp.diff(expression, t), *summands)

    def value(function: sp.Expr, order: int, argument: sp.Expr) -> sp.Expr:
        """Return a function of one coordinate, or its derivative, at the argument."""
        variables = [q for q in system.q if function.has(q)]
        if len(variables) != 1:
            raise ValueError(f"{function} is not a function of one coordinate")
        return sp.diff(function, variables[0], int(order)).subs(variables[0], argument)

    def partial(expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        return sp.factor_terms(sp.diff(expression, variable))

    return names | {"_rate": rate, "_partial": partial, "_value": value}


@cache
def _tidied(expression: sp.Expr) -> sp.Expr:
    """Return a simplified quantity; the cache serves all equations of a system."""
    return simplify_bounded(expression)


def _spelled(text: str, system: System, coordinate: Coordinate | None) -> str:
    """Translate notation to parser names: `_rate(...)` for d/dt(...), `x_dot` for x'."""
    numbered = itertools.count()
    text = re.sub("±", lambda _: f"+ sign_{next(numbered)}*", text)
    quantities = [q.name for q in system.quantities]
    text = re.sub(r"\bd/dt\(", "_rate(", text)
    text = re.sub(rf"\bd({'|'.join((*ENERGIES, *quantities))})/d(\w+'?)", r"_partial(\1, \2)", text)
    if quantities:
        text = re.sub(
            rf"\b({'|'.join(quantities)})('*)\(",
            lambda match: f"_value({match[1]}, {len(match[2])}, ",
            text,
        )
    if coordinate is not None:
        text = re.sub(r"\bq\b", coordinate.name, text)
    for c in system.coordinates:
        text = re.sub(rf"\b{c.name}''", f"{c.name}_ddot", text)
        text = re.sub(rf"\b{c.name}'", f"{c.name}_dot", text)
    return text.replace("^", "**")


def _split(text: str) -> list[str]:
    """Split a text into the equation and its definitions, at commas outside parentheses."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _set(setting: str, names: Names, system: System) -> None:
    """Define a name, or its square, for this equation: `v_m^2 = v_x^2 + v_y^2`."""
    left_side, right_side = setting.split("=")
    match = re.fullmatch(r"(\w+)(\*\*2)?", left_side.strip())
    if match is None:
        raise ValueError(f"{left_side.strip()!r} is not a name")
    name = match[1]
    # The Lagrangian's own definition is a claim; redefining another word would change its meaning.
    if name != "L" and name in names and not any(name == f"{c.name}0" for c in system.coordinates):
        raise ValueError(f"{name} is declared already")
    expression = _parsed(right_side, names)
    names[name] = sp.sqrt(expression) if match[2] else expression


_HUGE = re.compile(r"(?<![\w.])[\d._]+e[+-]?[\d_]{4,}", re.IGNORECASE)
"""Numbers whose digits sympy would write out, for minutes."""


def _parsed(text: str, names: Names) -> sp.Expr:
    if huge := _HUGE.search(text):
        raise ValueError(f"{huge[0]} has an exponent of four digits or more; use at most three")
    _check_size(ast.parse(text.strip(), mode="eval").body)
    expression = parse_expr(text, local_dict=names, global_dict=_FUNCTIONS)
    if not isinstance(expression, sp.Expr):
        raise ValueError(f"{text.strip()!r} is not an expression")
    return expression


def _check_size(node: ast.expr) -> int:
    """Return the degree of a side, after checking that it is plain arithmetic.

    Raises:
        ValueError: for anything but numbers, names, arithmetic and functions, and for powers that
            would take too long to expand.
    """
    match node:
        case ast.Constant(value=int() | float()) | ast.Name():
            degree = 1
        case ast.UnaryOp(operand=operand):
            degree = _check_size(operand)
        case ast.BinOp(op=ast.Pow(), left=base, right=exponent):
            degree = math.ceil(_check_size(base) * max(1.0, abs(_exponent(exponent))))
        case ast.BinOp(left=left, right=right):
            degree = _check_size(left) + _check_size(right)
        case ast.Call(func=ast.Name(), args=given, keywords=[]):
            degree = sum(map(_check_size, given))
        case _:
            raise ValueError(f"{ast.unparse(node)} is not a number, a name or arithmetic")
    if degree > MAX_DEGREE:
        raise ValueError("its powers are too large to compute")
    return degree


def _exponent(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return _exponent(operand)
        case ast.BinOp(
            op=ast.Div(),
            left=ast.Constant(value=int() as over),
            right=ast.Constant(value=int() as by),
        ) if by:
            return over / by
    raise ValueError(f"{ast.unparse(node)} is not an exponent: write a plain number, such as 2")


def _check_names(
    sides: tuple[sp.Expr, ...], system: System, further: set[sp.Symbol], where: str
) -> None:
    declared = {*system.q, *system.v, *system.a, *system.u, t, *system.values, *further}
    for expression in sides:
        for symbol in sorted(expression.free_symbols - declared, key=str):
            raise DeclarationError(f"{where}: {symbol} is not declared")


def _point(coordinate: Coordinate) -> sp.Symbol:
    return sp.Symbol(f"{coordinate.name}0", real=True)


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
    for sides, point in readings(published, system):
        derived = taylor(sides[0], {coordinate.q: point}, 1)
        choices.append([(derived, _left_over(expression, derived)) for expression in sides[1:]])
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
    for sides, _ in readings(published, system):
        derived = _undriven(sides[0], published, equations)
        comparisons = []
        for expression in sides[1:]:
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
    left_side, right_side = reading[0]
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
