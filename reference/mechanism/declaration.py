"""What a system folder declares: the physics, complete, with a unit and a source at every number.

The words of a declaration, and `Declaration` that holds them together. `mechanism.system.System` is
one that is checked; nothing has a silent default.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from numbers import Number
from pathlib import Path
from typing import Any

import sympy as sp

from physics_crosscheck.reference.mechanism.pose import Pose
from physics_crosscheck.reference.mechanism.sketch import Shape

t = sp.Symbol("t", real=True)
"""Time, in seconds: the variable of inputs and of explicitly time-dependent energies."""


class LocatedError(Exception):
    """What is wrong with a declaration.

    Attributes:
        about: what it is wrong with, as it is declared: ("Scenario", its name); None if unknown.
        file, line: where it stands, counted from 1; None if unknown.
        kind: which kind of failure a case reports.
    """

    kind = "declaration"

    about: tuple[str, str] | None = None
    file: Path | None = None
    line: int | None = None


class DeclarationError(LocatedError, ValueError):
    """A system is declared incompletely or inconsistently; the message names what and how."""


@contextmanager
def about(kind: str, name: str) -> Iterator[None]:
    """Say of what is found wrong meanwhile that it is about this, unless it is known better."""
    try:
        yield
    except LocatedError as error:
        error.about = error.about or (kind, name)
        raise


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
        # What is no number is refused where the system is checked.
        positive = isinstance(self.value, (int, float)) and self.value > 0
        return sp.Symbol(self.name, positive=True) if positive else _real(self.name)


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
    _: KW_ONLY
    q: Mapping[Coordinate, sp.Expr | float] = field(hash=False)
    v: Mapping[Coordinate, sp.Expr | float] = field(hash=False)
    inputs: Mapping[Input, sp.Expr | float] = field(hash=False)
    duration: float


@dataclass(frozen=True)
class Quantity:
    """What equations of the source name besides: a force, a point's place, a part's energy.

    It is found here from first principles (a sum of forces, an integral over a body, a derivative
    of a place), of positions, velocities, accelerations, inputs and constants, so that what the
    source says of it is compared with something that the source did not say.
    """

    name: str
    expression: sp.Expr
    unit: str
    description: str


CLAIMS = ("motion", "linear", "linear part", "value")
"""What a published equation may claim; see `PublishedEquation`."""


@dataclass(frozen=True)
class PublishedEquation:
    """A numbered equation of the source as its transcript has it.

    `text` is `left = right`, or a chain of such, and then, after commas, what stands in it for
    what: `T_M = M*v^2/2, v = x'`. A prime is a time derivative; `±` marks a place where the
    transcript has lost a sign. T, V, D and L = T - V are the system's energies unless a declared
    name is one of these; `dL/dx'` and `d/dt(dL/dx')` are derivatives; a quantity of one coordinate
    may be written as its function, `f(theta0)`, `f'(theta0)`. `states` says what is claimed:

    - `motion`: an equation of motion, up to a nonzero factor: that of the coordinate `of`, or,
      where `of` is empty, that of every coordinate, which q and Q (its force) then stand for.
    - `linear`: one of those linearized about the equilibrium that `of` names.
    - `linear part`: the right side is the Taylor series to first order of the left one, in the
      coordinate `of`, about the point that is called as it is with a 0 behind, such as `theta0`.
    - `value`: the right side is what the left side names: an energy, a derivative, a quantity.

    `driven` says whether the source's equation has the inputs; without, it is compared with the
    inputs set to zero.
    """

    number: str
    text: str
    states: str
    _: KW_ONLY
    of: str
    driven: bool
    note: str


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """A mechanism as it is declared, not yet checked.

    T, V and D are the kinetic energy, the potential energy and Rayleigh's dissipation function,
    as sympy expressions of the coordinates' `q` and `v`, the constants and `t`. A sketch may show
    what it looks like; quantities are for published equations alone; frames say where bodies and
    points are in the world, so that model files can be held against that too.
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
    published: tuple[PublishedEquation, ...]
    sketch: tuple[Shape, ...] = ()
    quantities: tuple[Quantity, ...] = ()
    frames: tuple[Pose, ...] = ()

    def __post_init__(self) -> None:
        for name in ("T", "V", "D"):
            energy = getattr(self, name)
            if isinstance(energy, (Number, _Operand)):
                object.__setattr__(self, name, sp.sympify(energy))

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


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)
