"""Parser of the source's notation: text of a published equation to expressions of the system."""

from __future__ import annotations

import ast
import itertools
import math
import re
from collections.abc import Callable
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
from .simplify import simplify_bounded

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


@dataclass(frozen=True)
class EquationReading:
    """An equation with one choice of its lost signs.

    Attributes:
        sides: its sides, two or more.
        point: expansion point of a linear part; zero for other claims.
    """

    sides: tuple[sp.Expr, ...]
    point: sp.Expr


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
        EquationReading(tuple(side.subs(choice) for side in sides), point.subs(choice))
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
