"""Checks of a declared system: completeness, consistency, dimensions, differentiability."""

from collections.abc import Container, Mapping
from dataclasses import fields, is_dataclass
from typing import TypeVar

import sympy as sp

from .declaration import (
    CLAIMS,
    Constant,
    Coordinate,
    Declaration,
    DeclarationError,
    Input,
    Output,
    Quantity,
    Scenario,
    about,
    t,
)
from .real import SWITCHES, check_plain, check_real, expression_of, number_of
from .sketch import BODIES, LINKS, Angle, Body, Link, expressions
from .units import ENERGY, POWER, TIME, Dimension, UnitError, dimension_of, parse_unit

Item = TypeVar("Item", Coordinate, Input)

MIN_DURATION_SECONDS = 1e-12
"""Shortest duration of a scenario, s."""

_NONSMOOTH_FUNCTIONS = (
    sp.Abs, sp.sign, sp.Heaviside, sp.DiracDelta, sp.Piecewise, sp.Max, sp.Min,
    sp.floor, sp.ceiling, sp.Mod, sp.re, sp.im, sp.arg, sp.conjugate,
)  # fmt: skip


def check(system: Declaration, *, equilibria: bool = True) -> None:
    """Check that a system is complete and consistent.

    Args:
        system: the system.
        equilibria: whether it needs an equilibrium.

    Raises:
        DeclarationError: with one sentence that names the missing or wrong entry.
    """
    where = f"system {system.name!r}"
    _check_texts(system, where)
    _check_names(system, where, equilibria=equilibria)
    _check_values(system, where)
    _check_smooth(system, where)
    _check_units(system, where)
    mass = _check_energies(system, where)
    _check_maps(system, mass, where)
    _check_sketch(system, where)


def _check_texts(part: object, where: str) -> None:
    """Check that all strings are valid Unicode, without unpaired surrogates."""
    if isinstance(part, str):
        if any("\ud800" <= c <= "\udfff" for c in part):
            raise DeclarationError(f"{where}: {part!a} is not Unicode text; type it again")
    elif isinstance(part, tuple):
        for item in part:
            _check_texts(item, where)
    elif is_dataclass(part) and not isinstance(part, type):
        for field in fields(part):
            _check_texts(getattr(part, field.name), where)


def _check_names(system: Declaration, where: str, *, equilibria: bool) -> None:
    needed = ("coordinates", "outputs", "scenarios", *(("equilibria",) if equilibria else ()))
    for kind in needed:
        if not getattr(system, kind):
            raise DeclarationError(f"{where} declares no {kind}")
    _check_symbol_names(system, where)
    for kind, named in (
        ("output", system.outputs),
        ("scenario", system.scenarios),
        ("equilibrium", system.equilibria),
    ):
        names = [item.name for item in named]
        for name in names:
            if names.count(name) > 1:
                raise DeclarationError(f"{where} has two {kind} entries named {name!r}")
            if not name.isprintable():
                raise DeclarationError(
                    f"{where}: the {kind} name {name!r} has unprintable characters"
                )
    for constant in system.constants:
        with about("Constant", constant.name):
            _check_constant(constant, where)


def _check_symbol_names(system: Declaration, where: str) -> None:
    """Check that names in expressions and equations are unique identifiers with a description."""
    seen = {"t": "the time", **{f"{c.name}_dot": "a velocity" for c in system.coordinates}}
    seen |= {f"{c.name}_ddot": "an acceleration" for c in system.coordinates}
    for kind, items in (
        ("coordinate", system.coordinates),
        ("constant", system.constants),
        ("input", system.inputs),
        ("quantity", system.quantities),
    ):
        for item in items:
            if not item.name.isidentifier():
                raise DeclarationError(
                    f"{where}: the {kind} name {item.name!r} is not an identifier"
                )
            if item.name in seen:
                raise DeclarationError(f"{where}: {item.name!r} is {seen[item.name]} and a {kind}")
            seen[item.name] = f"a {kind}"
            if not item.description:
                raise DeclarationError(f"{where}: the {kind} {item.name} has no description")


def _check_constant(constant: Constant, where: str) -> None:
    place = f"{where}: the constant {constant.name}"
    if not constant.source:
        raise DeclarationError(f"{place} has no source")
    check_plain(constant.value, place)


def _check_values(system: Declaration, where: str) -> None:
    """Check that every value is a number or an expression, and real as far as that is decidable."""
    for name in ("T", "V", "D"):
        place = f"{where}: {name}"
        # `_check_smooth` reports functions that are not differentiable.
        allowed = (*_NONSMOOTH_FUNCTIONS, sp.core.function.AppliedUndef)
        check_real(expression_of(getattr(system, name), place), place, also=allowed)
    for pushed in system.inputs:
        for coordinate, factor in pushed.on.items():
            place = f"{where}: the input {pushed.name} on {getattr(coordinate, 'name', coordinate)}"
            with about("Input", pushed.name):
                check_real(expression_of(factor, place), place)
    for kind, items in (("output", system.outputs), ("quantity", system.quantities)):
        for item in items:
            place = f"{where}: the {kind} {item.name}"
            with about(kind.capitalize(), item.name):
                check_real(expression_of(item.expression, place), place)


def dimensions(system: Declaration) -> dict[sp.Symbol, Dimension]:
    """Return the dimension of every symbol of the system.

    Raises:
        UnitError: for a unit that can't be parsed.
    """
    result = {t: TIME}
    for coordinate in system.coordinates:
        unit = parse_unit(coordinate.unit)
        result |= {coordinate.q: unit, coordinate.v: unit / TIME, coordinate.a: unit / TIME / TIME}
    for constant in system.constants:
        result[constant.symbol] = parse_unit(constant.unit)
    for declared in system.inputs:
        result[declared.symbol] = parse_unit(declared.unit)
    return result


def _check_units(system: Declaration, where: str) -> None:
    try:
        symbols = dimensions(system)
    except UnitError as error:
        raise DeclarationError(f"{where}: {error}") from None
    wanted = {"T": (system.T, ENERGY), "V": (system.V, ENERGY), "D": (system.D, POWER)}
    for name, (expression, expected) in wanted.items():
        check_symbols(expression, symbols, f"{where}: {name}")
        check_dimension(expression, expected, symbols, f"{where}: {name}")
    for pushed in system.inputs:
        if not pushed.on:
            raise DeclarationError(f"{where}: the input {pushed.name} acts on no coordinate")
        for coordinate, factor in pushed.on.items():
            place = f"{where}: the input {pushed.name}"
            if coordinate not in system.coordinates:
                raise DeclarationError(f"{place} acts on an unknown coordinate {coordinate}")
            expected = ENERGY / symbols[coordinate.q]
            expression = sp.sympify(factor) * pushed.symbol
            check_symbols(expression, symbols, place)
            check_dimension(expression, expected, symbols, f"{place} on {coordinate.name}")
    for output in system.outputs:
        _check_formula(output, symbols, f"{where}: the output {output.name}")
    for quantity in system.quantities:
        _check_formula(quantity, symbols, f"{where}: the quantity {quantity.name}")


def _check_formula(
    item: Output | Quantity, symbols: Mapping[sp.Symbol, Dimension], place: str
) -> None:
    expression = sp.sympify(item.expression)
    check_symbols(expression, symbols, place)
    try:
        expected = parse_unit(item.unit)
    except UnitError as error:
        raise DeclarationError(f"{place}: {error}") from None
    check_dimension(expression, expected, symbols, place)


def check_symbols(expression: sp.Expr, declared: Container[sp.Symbol], place: str) -> None:
    """Check that an expression uses declared symbols only."""
    for symbol in sorted(expression.free_symbols, key=str):
        if symbol not in declared:
            raise DeclarationError(f"{place} uses {symbol}, which is not declared")


def check_dimension(
    expression: sp.Expr, expected: Dimension, symbols: Mapping[sp.Symbol, Dimension], place: str
) -> None:
    """Check the dimension of an expression."""
    try:
        dimension = dimension_of(expression, symbols)
    except UnitError as error:
        raise DeclarationError(f"{place}: {error}") from None
    if dimension is not None and dimension != expected:
        raise DeclarationError(f"{place} has the unit {dimension}; expected {expected}")


def _check_smooth(system: Declaration, where: str) -> None:
    for name in ("T", "V", "D"):
        for bad in (*_NONSMOOTH_FUNCTIONS, sp.core.function.AppliedUndef):
            for part in getattr(system, name).atoms(bad):
                raise DeclarationError(f"{where}: {name} is not differentiable: it has {part}")


def _check_energies(system: Declaration, where: str) -> sp.Matrix:
    """Check T, V and D; return the mass matrix, whose derivation is the most expensive step."""
    for name in ("T", "V", "D"):
        expression = getattr(system, name)
        allowed = {*system.q, t, *(c.symbol for c in system.constants)}
        if name != "V":
            allowed |= {*system.v}
        for symbol in sorted(expression.free_symbols - allowed, key=str):
            raise DeclarationError(f"{where}: {name} must not depend on {symbol}")
    rest = dict.fromkeys(system.v, sp.Integer(0))
    slope = [sp.diff(system.D, v).xreplace(rest) for v in system.v]
    if any(sp.simplify(g) != 0 for g in (*slope, system.D.xreplace(rest))):
        raise DeclarationError(f"{where}: D and its slope must be zero at rest")
    mass = sp.hessian(system.T, system.v)
    if mass.free_symbols & {*system.v}:
        raise DeclarationError(f"{where}: T must be quadratic in the velocities")
    if _always_singular(mass, system):
        names = ", ".join(c.name for c in system.coordinates)
        raise DeclarationError(
            f"{where}: the mass matrix of {names} is singular; T lacks an inertia"
        )
    return mass


def _always_singular(mass: sp.Matrix, system: Declaration) -> bool:
    """Return whether the mass matrix is singular at all of three positions, to fifty digits."""
    symbols = (*system.q, t)
    for shift in (1, 4, 9):
        # Generic positions, without symmetry.
        place = {s: sp.Rational(7 * i + shift, 13) for i, s in enumerate(symbols)}
        here = mass.xreplace(system.values).xreplace(place).evalf(50)
        size = sp.Mul(*(here[i, i] for i in range(here.rows)))
        if abs(here.det()) > sp.Float("1e-35") * abs(size):
            return False
    return True


def _check_maps(system: Declaration, mass: sp.Matrix, where: str) -> None:
    constants = {c.symbol for c in system.constants}
    for equilibrium in system.equilibria:
        place = f"{where}, equilibrium {equilibrium.name!r}"
        with about("Equilibrium", equilibrium.name):
            _check_map(equilibrium.at, system.coordinates, constants, place)
            for coordinate, value in equilibrium.at.items():
                number_of(value, system.values, f"{place}: the value of {coordinate.name}")
    at_first = mass.xreplace(system.values | {t: sp.Integer(0)})
    for scenario in system.scenarios:
        with about("Scenario", scenario.name):
            _check_scenario(system, scenario, at_first, f"{where}, scenario {scenario.name!r}")
    for published in system.published:
        if published.states not in CLAIMS:
            raise DeclarationError(
                f"{where}, Eq. {published.number}: unknown states "
                f"{published.states!r}; expected one of {list(CLAIMS)}"
            )


def _check_scenario(system: Declaration, scenario: Scenario, mass: sp.Matrix, place: str) -> None:
    constants = {c.symbol for c in system.constants}
    for name, start in (("q", scenario.q), ("v", scenario.v)):
        _check_map(start, system.coordinates, constants, f"{place}, {name}")
        for coordinate, value in start.items():
            number_of(value, system.values, f"{place}, {name}: the value of {coordinate.name}")
    _check_map(scenario.inputs, system.inputs, constants | {t}, f"{place}, inputs")
    for pushed, value in scenario.inputs.items():
        input_place = f"{place}, input {pushed.name}"
        check_real(expression_of(value, input_place), input_place, also=SWITCHES)
    duration = number_of(scenario.duration, {}, f"{place}: the duration")
    if duration <= 0:
        raise DeclarationError(f"{place}: the duration is {scenario.duration}; it must be positive")
    if duration < MIN_DURATION_SECONDS:
        raise DeclarationError(
            f"{place}: the duration is {scenario.duration} s, shorter than "
            f"{MIN_DURATION_SECONDS:g} s, the least that engines can step; make it longer"
        )
    start_values = {
        c.q: sp.sympify(scenario.q[c]).xreplace(system.values) for c in system.coordinates
    }
    if not mass.xreplace(start_values).evalf().is_positive_definite:
        raise DeclarationError(f"{place}: the mass matrix there is not positive definite")
    start_values |= {
        c.v: sp.sympify(scenario.v[c]).xreplace(system.values) for c in system.coordinates
    }
    for name in ("T", "V", "D"):
        here = getattr(system, name).xreplace(start_values | {t: sp.Integer(0)})
        number_of(here, system.values, f"{place}: {name} at its start")


SKETCH_TYPES = (
    sp.Symbol,
    sp.Number,
    sp.NumberSymbol,
    sp.Add,
    sp.Mul,
    sp.Pow,
    sp.sin,
    sp.cos,
    sp.tan,
)
"""Expression types allowed in the positions of a sketch."""


def _check_sketch(system: Declaration, where: str) -> None:
    symbols = {*system.q, *(c.symbol for c in system.constants)}
    for number, shape in enumerate(system.sketch, 1):
        place = f"{where}, shape {number} of the sketch"
        if not isinstance(shape, (Link, Body, Angle)):
            raise DeclarationError(f"{place}: {shape!r} is not a Link, Body or Angle")
        kinds = () if isinstance(shape, Angle) else BODIES if isinstance(shape, Body) else LINKS
        if not isinstance(shape, Angle) and shape.kind not in kinds:
            raise DeclarationError(
                f"{place}: unknown kind {shape.kind!r}; expected one of {list(kinds)}"
            )
        try:
            entries = expressions(shape)
        except (TypeError, ValueError, sp.SympifyError) as error:
            raise DeclarationError(f"{place}: a point must be a pair (x, y): {error}") from None
        for name, expression in entries.items():
            check_symbols(expression, symbols, f"{place}, {name},")
            for part in sp.preorder_traversal(expression):
                if not isinstance(part, SKETCH_TYPES):
                    raise DeclarationError(f"{place}, {name}: {part} can't be drawn")


def _check_map(
    given: Mapping[Item, sp.Expr | float],
    wanted: tuple[Item, ...],
    allowed: set[sp.Symbol],
    place: str,
) -> None:
    for item in wanted:
        if item not in given:
            raise DeclarationError(f"{place}: no value is given for {item.name}")
    for item, value in given.items():
        if item not in wanted:
            raise DeclarationError(f"{place}: {getattr(item, 'name', item)!r} is unknown here")
        given_as = expression_of(value, f"{place}: the value of {item.name}")
        for symbol in sorted(given_as.free_symbols - allowed, key=str):
            raise DeclarationError(f"{place}: the value of {item.name} depends on {symbol}")
