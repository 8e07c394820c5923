"""Forces that switch: contacts, joint limits, dry friction, buffers and saturated drives.

A system folder declares them beside its energies. Gaps and slips are expressions of the
coordinates, as energies are. `reference.laws.modes` derives the equations of each mode.
"""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import TypeAlias

import sympy as sp

from .declaration import Coordinate, Declaration, DeclarationError, about
from .real import check_real, expression_of
from .units import TIME, Dimension
from .validation import check_dimension, check_symbols, dimensions

Expression: TypeAlias = sp.Expr | float


@dataclass(frozen=True)
class Contact:
    """A contact of two bodies that cannot overlap, with Coulomb friction and Newton's restitution.

    Attributes:
        name: unique among the interactions.
        gap: distance of the bodies, m; the bodies touch at zero.
        slip: sliding velocity along the contact, m/s; 0 for a contact without friction.
        mu: friction coefficient.
        e: restitution: speed of separation over speed of approach.
    """

    name: str
    _: KW_ONLY
    gap: Expression
    slip: Expression
    mu: Expression
    e: Expression


@dataclass(frozen=True)
class Limit:
    """A range of a coordinate, with restitution `e` at both ends; None for an open end."""

    name: str
    _: KW_ONLY
    on: Coordinate
    lower: Expression | None
    upper: Expression | None
    e: Expression

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The limits as contacts without friction."""
        gaps: dict[str, sp.Expr] = {}
        if self.lower is not None:
            gaps["lower"] = self.on.q - self.lower
        if self.upper is not None:
            gaps["upper"] = self.upper - self.on.q
        return tuple(
            Contact(f"{self.name} {side}", gap=gap, slip=0, mu=0, e=self.e)
            for side, gap in gaps.items()
        )


@dataclass(frozen=True)
class DryFriction:
    """Dry friction against a sliding velocity `slip`, up to `force` (N or N m)."""

    name: str
    _: KW_ONLY
    slip: Expression
    force: Expression


@dataclass(frozen=True)
class Buffer:
    """A spring with damper that pushes, and never pulls, where the gap is negative.

    Attributes:
        gap: distance to the undeformed buffer, m or rad.
        stiffness: N/m or N m/rad.
        damping: N s/m or N m s/rad.
    """

    name: str
    _: KW_ONLY
    gap: Expression
    stiffness: Expression
    damping: Expression


@dataclass(frozen=True)
class Drive:
    """A drive whose force is limited.

    Attributes:
        on: factors of the force on each coordinate.
        force: force without the limit, an expression of the state and of `t`.
        limit: largest magnitude of the force.
    """

    name: str
    _: KW_ONLY
    on: Mapping[Coordinate, Expression] = field(hash=False)
    force: Expression
    limit: Expression


Interaction: TypeAlias = Contact | Limit | DryFriction | Buffer | Drive


def check_interactions(system: Declaration, interactions: tuple[Interaction, ...]) -> None:
    """Check names, symbols and units of a system's interactions.

    Raises:
        DeclarationError: with one sentence that names the wrong entry.
    """
    symbols, names = dimensions(system), set[str]()
    nominal = {constant.symbol: constant.value for constant in system.constants}
    for item in interactions:
        place = f"system {system.name!r}: the interaction {item.name}"
        with about(type(item).__name__, item.name):
            if item.name in names:
                raise DeclarationError(f"{place} is declared twice")
            names.add(item.name)
            for label, (stated, unit) in _quantities(item, symbols).items():
                where = f"{place}: {label}"
                expression = expression_of(stated, where)
                check_real(expression, where)
                check_symbols(expression, symbols, where)
                if expression != 0 and unit is not None:
                    check_dimension(expression, unit, symbols, where)
                value = sp.sympify(expression.xreplace(nominal))
                _check_range(item, label, expression, value, where)


_SIZES = ("mu", "e", "stiffness", "damping", "limit")


def _check_range(
    item: Interaction, label: str, expression: sp.Expr, value: sp.Expr, where: str
) -> None:
    """Refuse negative sizes, and gaps that bodies can't close since they never change their sign.

    Raises:
        DeclarationError: with the number or the factor.
    """
    is_size = label in _SIZES or (label == "force" and isinstance(item, DryFriction))
    if is_size and value.is_number and value < 0:
        raise DeclarationError(f"{where} is {float(value):g}; write a number of at least 0")
    if label == "gap":
        for factor, power in sp.factor_list(expression)[1]:
            if power % 2 == 0:
                raise DeclarationError(
                    f"{where} has the factor ({factor})**{power}, which is never negative; write a "
                    "distance that is negative where the bodies overlap"
                )


def _quantities(
    item: Interaction, symbols: Mapping[sp.Symbol, Dimension]
) -> dict[str, tuple[Expression, Dimension | None]]:
    """Return the expressions of an interaction, each with its dimension; None for any."""
    number = TIME / TIME
    if isinstance(item, Contact):
        return {
            "gap": (item.gap, None),
            "slip": (item.slip, None),
            "mu": (item.mu, number),
            "e": (item.e, number),
        }
    if isinstance(item, Limit):
        unit = symbols[item.on.q]
        ends = {"lower": item.lower, "upper": item.upper}
        return {
            "e": (item.e, number),
            **{side: (end, unit) for side, end in ends.items() if end is not None},
        }
    if isinstance(item, DryFriction):
        return {"slip": (item.slip, None), "force": (item.force, None)}
    if isinstance(item, Buffer):
        return {
            "gap": (item.gap, None),
            "stiffness": (item.stiffness, None),
            "damping": (item.damping, None),
        }
    factors = {f"the factor of {c.name}": (f, None) for c, f in item.on.items()}
    return {"force": (item.force, None), "limit": (item.limit, None), **factors}
