"""What a system folder declares: the physics, complete, with a unit and a source at every number.

`System` is checked as it is made: whatever is missing, unknown, dimensionally impossible or not
differentiable is refused with a sentence that names it. Nothing has a silent default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy as sp

from reference.sketch import Shape

t = sp.Symbol("t", real=True)
"""Time, in seconds: the variable of inputs and of explicitly time-dependent energies."""


class DeclarationError(ValueError):
    """A system is declared incompletely or inconsistently; the message names what and how."""


class _Operand:
    """Lets a declared quantity stand in an expression as its symbol."""

    symbol: sp.Symbol

    def _sympy_(self) -> sp.Symbol:
        return self.symbol

    def __add__(self, other: Any) -> sp.Expr:
        return self.symbol + other

    def __radd__(self, other: Any) -> sp.Expr:
        return other + self.symbol

    def __sub__(self, other: Any) -> sp.Expr:
        return self.symbol - other

    def __rsub__(self, other: Any) -> sp.Expr:
        return other - self.symbol

    def __mul__(self, other: Any) -> sp.Expr:
        return self.symbol * other

    def __rmul__(self, other: Any) -> sp.Expr:
        return other * self.symbol

    def __truediv__(self, other: Any) -> sp.Expr:
        return self.symbol / other

    def __rtruediv__(self, other: Any) -> sp.Expr:
        return other / self.symbol

    def __pow__(self, other: Any) -> sp.Expr:
        return self.symbol**other

    def __neg__(self) -> sp.Expr:
        return -self.symbol


@dataclass(frozen=True)
class Constant(_Operand):
    """A constant of the mechanism: its value in SI units, and where that value comes from."""

    name: str
    value: float
    unit: str
    description: str
    source: str

    @cached_property
    def symbol(self) -> sp.Symbol:
        """Its symbol in expressions."""
        # Positive where it is: simplification may then take roots. Others are plain reals.
        return sp.Symbol(self.name, positive=True) if self.value > 0 else _real(self.name)


@dataclass(frozen=True)
class Coordinate:
    """A generalized coordinate, with the symbols of its position and velocity."""

    name: str
    unit: str
    description: str

    @cached_property
    def q(self) -> sp.Symbol:
        """Position."""
        return _real(self.name)

    @cached_property
    def v(self) -> sp.Symbol:
        """Velocity."""
        return _real(f"{self.name}_dot")

    @cached_property
    def a(self) -> sp.Symbol:
        """Acceleration."""
        return _real(f"{self.name}_ddot")


@dataclass(frozen=True)
class Input(_Operand):
    """A known force or torque u; it adds `on[coordinate] * u` to that generalized force."""

    name: str
    unit: str
    description: str
    on: Mapping[Coordinate, sp.Expr | float] = field(hash=False)

    @cached_property
    def symbol(self) -> sp.Symbol:
        """Its symbol in expressions."""
        return _real(self.name)


@dataclass(frozen=True)
class Output:
    """What is observed, as an expression of positions, velocities and constants."""

    name: str
    expression: sp.Expr
    unit: str
    description: str


@dataclass(frozen=True)
class Equilibrium:
    """A rest position without input: stated exactly, or searched for near a guess.

    With `search=False` the position must satisfy the equations as it stands (to rounding);
    with `search=True` it is where Newton's iteration starts.
    """

    name: str
    at: Mapping[Coordinate, sp.Expr | float] = field(hash=False)
    search: bool
    description: str


@dataclass(frozen=True)
class Scenario:
    """A motion to compare: start, inputs as expressions of `t`, and duration in seconds."""

    name: str
    description: str
    q: Mapping[Coordinate, sp.Expr | float] = field(hash=False)
    v: Mapping[Coordinate, sp.Expr | float] = field(hash=False)
    inputs: Mapping[Input, sp.Expr | float] = field(hash=False)
    duration: float


@dataclass(frozen=True)
class PublishedEquation:
    """A numbered equation of the source as its transcript has it.

    `text` is `left = right`. A prime is a time derivative; `±` marks a place where the transcript
    has lost a sign. `states` says what the equation claims to be: `motion` (up to a nonzero
    factor, of coordinate `of` where one is named), `T`, `V`, `D`, `L`, or `linear` (the motion
    linearized about the equilibrium that `of` names). `driven` says whether the source's equation
    has the inputs; without, it is compared with the inputs set to zero.
    """

    number: str
    text: str
    states: str
    of: str
    driven: bool
    note: str


@dataclass(frozen=True)
class System:
    """A mechanism: everything from which its equations of motion follow.

    T, V and D are the kinetic energy, the potential energy and Rayleigh's dissipation function,
    as sympy expressions of the coordinates' `q` and `v`, the constants and `t`. A sketch may show
    what it looks like.

    Raises:
        DeclarationError: with one sentence that names what is missing or wrong.
    """

    name: str
    title: str
    source: str
    coordinates: tuple[Coordinate, ...]
    constants: tuple[Constant, ...]
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    T: sp.Expr
    V: sp.Expr
    D: sp.Expr
    equilibria: tuple[Equilibrium, ...]
    scenarios: tuple[Scenario, ...]
    printed: tuple[PublishedEquation, ...]
    sketch: tuple[Shape, ...] = ()

    def __post_init__(self) -> None:
        for name in ("T", "V", "D"):
            object.__setattr__(self, name, sp.sympify(getattr(self, name)))
        # Imported late: the checks speak of the classes above.
        from reference.validation import check

        check(self)

    @property
    def q(self) -> tuple[sp.Symbol, ...]:
        """Position symbols, in the order of the coordinates."""
        return tuple(c.q for c in self.coordinates)

    @property
    def v(self) -> tuple[sp.Symbol, ...]:
        """Velocity symbols."""
        return tuple(c.v for c in self.coordinates)

    @property
    def a(self) -> tuple[sp.Symbol, ...]:
        """Acceleration symbols."""
        return tuple(c.a for c in self.coordinates)

    @property
    def u(self) -> tuple[sp.Symbol, ...]:
        """Input symbols."""
        return tuple(i.symbol for i in self.inputs)

    @property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """The constants' values, exactly as the doubles that they are."""
        return {c.symbol: sp.Rational(c.value) for c in self.constants}

    def forces(self) -> tuple[sp.Expr, ...]:
        """Generalized forces Q of the inputs, one per coordinate."""
        return tuple(
            sp.Add(*(sp.sympify(i.on.get(c, 0)) * i.symbol for i in self.inputs))
            for c in self.coordinates
        )

    def scenario(self, name: str) -> Scenario:
        """Return the scenario of that name; KeyError with the known ones otherwise."""
        for scenario in self.scenarios:
            if scenario.name == name:
                return scenario
        known = ", ".join(s.name for s in self.scenarios)
        raise KeyError(f"{self.name} has no scenario {name!r}; it has {known}")


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)
