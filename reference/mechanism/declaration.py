"""The declaration of a system folder: complete physics, with a unit and source for every number.

This module defines the parts of a declaration, and `Declaration`, which holds them.
`mechanism.system.System` is a checked declaration. There are no hidden defaults.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from numbers import Number
from pathlib import Path
from typing import Any

import sympy as sp

from .sketch import Shape

WORLD = "world"
"""Reserved frame name: a sidecar uses it for the pose of an engine's world."""


@dataclass(frozen=True)
class Pose:
    """A frame fixed to a body, or a point of a body, in the world's axes.

    Attributes:
        name: sidecars use it to map the frame to a model file.
        position: position of its origin, (x, y, z), expressions of positions and constants, m.
        description: a few words about it.
        rotation: 3 x 3 with its axes as columns, or a unit quaternion (w, x, y, z); None for a
            point.
    """

    name: str
    position: tuple[Any, Any, Any]
    description: str
    rotation: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", tuple(map(_number, self.position)))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", _matrix(self.rotation))

    @property
    def entries(self) -> tuple[sp.Expr, ...]:
        """The position, and for a frame also its matrix row by row: 3 or 12 expressions."""
        turn = () if self.rotation is None else tuple(self.rotation)
        return (*self.position, *turn)


def _matrix(rotation: Any) -> sp.ImmutableMatrix:
    """Return a rotation matrix, from a matrix or a quaternion; both may be unnormalized."""
    if isinstance(rotation, (tuple, list)):
        rotation = [_row(row) for row in rotation]
    elif isinstance(rotation, (str, bytes)):
        raise _text(rotation)
    if not isinstance(rotation, list) or len(rotation) != 4:
        return sp.ImmutableMatrix(rotation)
    w, x, y, z = rotation
    return sp.ImmutableMatrix(
        [
            [w**2 + x**2 - y**2 - z**2, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w**2 - x**2 + y**2 - z**2, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w**2 - x**2 - y**2 + z**2],
        ]
    )


def _row(row: Any) -> Any:
    return [_number(entry) for entry in row] if isinstance(row, (tuple, list)) else _number(row)


def _number(value: Any) -> Any:
    if isinstance(value, (str, bytes)):
        raise _text(value)
    return sp.sympify(value)


def _text(value: str | bytes) -> ValueError:
    """Return the error for a string, which sympy would execute as code."""
    return ValueError(f"a pose contains the text {value[:60]!r}; write a number or an expression")


t = sp.Symbol("t", real=True)
"""Time, in seconds: the variable of inputs and of explicitly time-dependent energies."""


class LocatedError(Exception):
    """An error in a declaration.

    Attributes:
        about: the faulty entry as declared, such as ("Scenario", its name); None if unknown.
        file, line: its location, lines counted from 1; None if unknown.
        kind: the kind of failure that a case reports.
    """

    kind = "declaration"

    about: tuple[str, str] | None = None
    file: Path | None = None
    line: int | None = None


class DeclarationError(LocatedError, ValueError):
    """An incomplete or inconsistent declaration; the message names the entry and the problem."""


@contextmanager
def about(kind: str, name: str) -> Iterator[None]:
    """Attach an entry to errors raised within the block, unless they already name one."""
    try:
        yield
    except LocatedError as error:
        error.about = error.about or (kind, name)
        raise


class _Operand:
    """Arithmetic for declared quantities: each acts as its symbol in expressions."""

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
    """A constant of the mechanism: its value in SI units and the source of that value."""

    name: str
    value: float
    unit: str
    description: str
    source: str

    @cached_property
    def symbol(self) -> sp.Symbol:
        """Its symbol in expressions."""
        # A positive symbol lets simplification take roots; others are real. Values that are not
        # numbers are rejected when the system is checked.
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
    """An observed quantity: an expression of positions, velocities and constants."""

    name: str
    expression: sp.Expr
    unit: str
    description: str


@dataclass(frozen=True)
class Equilibrium:
    """A rest position without input: exact, or an initial guess for a search.

    With `search=False` the position must satisfy the equations as given, to rounding. With
    `search=True` it is the starting point of Newton's method.
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
    """A further quantity in the source's equations: a force, a point's position, an energy.

    Derive it from first principles: a sum of forces, an integral over a body, a derivative of a
    position. It may depend on positions, velocities, accelerations, inputs and constants. The
    source's equation is then compared with an independent expression.
    """

    name: str
    expression: sp.Expr
    unit: str
    description: str


CLAIMS = ("motion", "linear", "linear part", "value")
"""The claims of a published equation; see `PublishedEquation`."""


@dataclass(frozen=True)
class PublishedEquation:
    """A numbered equation of the source, as its transcript has it.

    `text` is `left = right`, or a chain of equalities. Definitions of symbols may follow after
    commas: `T_M = M*v^2/2, v = x'`. A prime is a time derivative; `±` marks a sign that the
    transcript has lost. T, V, D and L = T - V are the system's energies unless a declared name
    replaces one. `dL/dx'` and `d/dt(dL/dx')` are derivatives. A quantity of one coordinate may be
    written as a function: `f(theta0)`, `f'(theta0)`. `states` is the claim:

    - `motion`: an equation of motion, up to a nonzero factor. `of` names the coordinate. If `of` is
    empty, the equation holds for every coordinate; q is the coordinate and Q its force.
    - `linear`: an equation of motion linearized about the equilibrium `of`.
    - `linear part`: the right side is the first-order Taylor series of the left side in the
    coordinate `of`. The expansion point is the coordinate's name with a 0, such as `theta0`.
    - `value`: the right side equals the energy, derivative or quantity on the left side.

    `driven` is true if the source's equation includes the inputs; otherwise they are set to zero.
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
    """A mechanism as declared, before its checks.

    T, V and D are the kinetic energy, the potential energy and Rayleigh's dissipation function, as
    sympy expressions of the coordinates' `q` and `v`, the constants and `t`. A sketch is for
    display. Quantities are only for published equations. Frames give world poses of bodies and
    points, so that model files can be compared with them.
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
        """The constants' values, as exact rationals of their doubles."""
        return {c.symbol: sp.Rational(c.value) for c in self.constants}


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)
