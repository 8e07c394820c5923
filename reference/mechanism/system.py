"""A declared system, checked on construction.

Missing, unknown, dimensionally inconsistent or non-differentiable entries are rejected with a
sentence that names them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from .declaration import WORLD, Declaration, DeclarationError, Pose, Scenario
from .interactions import Interaction, check_interactions
from .numeric import NumericFunction, compile_function
from .units import DIMENSIONLESS, LENGTH, Dimension, UnitError, dimension_of
from .validation import check, dimensions

ENTRIES = 12
"""Numbers per frame: three of its position, nine of its rotation."""

_DIGITS = 30
_ORTHONORMAL_TOLERANCE = sp.Float("1e-15")
"""Tolerance of orthonormality of a rotation; axes are known to 24 digits."""


def check_frames(system: Declaration) -> None:
    """Check the names, units and rotations of all frames.

    Raises:
        DeclarationError: with one sentence that names the problem.
    """
    symbols = dimensions(system)
    for frame in system.frames:
        if not isinstance(frame, Pose):
            raise DeclarationError(f"system {system.name!r}: {frame!r} in frames is not a Pose")
    names = [frame.name for frame in system.frames]
    for frame in system.frames:
        where = f"system {system.name!r}, frame {frame.name!r}"
        if names.count(frame.name) > 1:
            raise DeclarationError(f"{where}: two frames share this name")
        if not isinstance(frame.name, str) or frame.name in ("", WORLD):
            raise DeclarationError(f"{where}: a frame needs a name, and {WORLD!r} is taken")
        if not frame.description:
            raise DeclarationError(f"{where}: it has no description")
        if len(frame.position) != 3:
            raise DeclarationError(f"{where}: its position must be three expressions, (x, y, z)")
        for number, entry in enumerate(frame.entries):
            _check_entry(entry, "position" if number < 3 else "rotation", system, symbols, where)
        _check_rotation(frame, system, where)


def _check_entry(
    entry: sp.Expr,
    what: str,
    system: Declaration,
    symbols: Mapping[sp.Symbol, Dimension],
    where: str,
) -> None:
    """Check that an entry is a length or a number, of positions and constants only."""
    allowed = {*system.q, *(c.symbol for c in system.constants)}
    for symbol in sorted(entry.free_symbols - allowed, key=str):
        raise DeclarationError(f"{where}: it uses {symbol}; use only positions and constants")
    if not entry.is_real and entry.is_number:
        raise DeclarationError(f"{where}: its {what} has {entry}, which is not a real number")
    # A plain number in a sum is in metres, as in a sketch.
    summands = [one for one in sp.Add.make_args(entry) if not one.is_number]
    expected = LENGTH if what == "position" else DIMENSIONLESS
    try:
        dimension = dimension_of(sp.Add(*summands), symbols)
    except UnitError as error:
        raise DeclarationError(f"{where}: {error}") from None
    if dimension is not None and summands and dimension != expected:
        raise DeclarationError(f"{where}: its {what} has the unit {dimension}; expected {expected}")


def _check_rotation(frame: Pose, system: Declaration, where: str) -> None:
    """Check at two generic positions that a rotation is orthonormal and right-handed."""
    if frame.rotation is None:
        return
    if frame.rotation.shape != (3, 3):
        raise DeclarationError(f"{where}: its rotation must be a 3 x 3 matrix or a quaternion")
    for shift in (2, 5):
        place = {q: sp.Rational(5 * i + shift, 11) for i, q in enumerate(system.q)}
        here = frame.rotation.xreplace(system.values).xreplace(place).evalf(_DIGITS)
        off = (here.T * here - sp.eye(3)).norm()
        if not (off.is_number and off.is_finite and off < _ORTHONORMAL_TOLERANCE):
            raise DeclarationError(
                f"{where}: its rotation is not orthonormal; its columns are the frame's axes"
            )
        if here.det() < 0:
            raise DeclarationError(f"{where}: its rotation mirrors; its axes must be right-handed")


def frame_function(system: Declaration) -> NumericFunction:
    """Return position and rotation of every frame as a function of q, twelve numbers each.

    Points have the identity rotation.
    """
    values = {symbol: sp.Float(value, 17) for symbol, value in system.values.items()}
    entries: list[sp.Expr] = []
    for frame in system.frames:
        turn = () if frame.rotation is not None else tuple(sp.eye(3))
        entries += [sp.sympify(e).xreplace(values) for e in (*frame.entries, *turn)]
    return compile_function(entries, system.q)


@dataclass(frozen=True, kw_only=True)
class System(Declaration):
    """A mechanism: the complete data of its equations of motion.

    Attributes:
        interactions: forces that switch: contacts, joint limits, dry friction, buffers, drives.

    Raises:
        DeclarationError: with one sentence that names the missing or wrong entry.
    """

    interactions: tuple[Interaction, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self, equilibria=not self.interactions)
        check_frames(self)
        check_interactions(self, self.interactions)

    def forces(self) -> tuple[sp.Expr, ...]:
        """Return the generalized forces Q of the inputs, one per coordinate."""
        return tuple(
            sp.Add(*(sp.sympify(i.on.get(c, 0)) * i.symbol for i in self.inputs))
            for c in self.coordinates
        )

    def scenario(self, name: str) -> Scenario:
        """Return the scenario of that name; raise KeyError with the known names otherwise."""
        for scenario in self.scenarios:
            if scenario.name == name:
                return scenario
        names = ", ".join(s.name for s in self.scenarios)
        raise KeyError(f"{self.name} has no scenario {name!r}; it has {names}")
