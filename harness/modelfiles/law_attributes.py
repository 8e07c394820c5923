"""Attributes of the rows of laws: limits, dry friction, equalities, contacts and drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    Anchor,
    CompliantSurface,
    ContactParameters,
    HardJoint,
    HardSurface,
    Laws,
    Range,
    SoftEquality,
    SoftFriction,
    SoftLimit,
    Surface,
)


@dataclass(frozen=True, kw_only=True)
class ContactOptions:
    """The numbers that all contacts share."""

    elliptic: bool
    friction_ratio: float
    safe: bool

    @staticmethod
    def from_laws(laws: Laws) -> ContactOptions:
        """Return those of a file."""
        return ContactOptions(
            elliptic=laws.elliptic, friction_ratio=laws.friction_ratio, safe=laws.safe
        )


@dataclass(frozen=True, kw_only=True)
class JointForceLimit:
    """Limits of all drives of a joint, and whether they compensate its weight."""

    force: Range
    lifts: bool = False


Row = (
    ContactOptions | JointForceLimit | SoftLimit | SoftFriction | SoftEquality | Surface
    | ContactParameters | Actuator | HardJoint | HardSurface | CompliantSurface
)  # fmt: skip
"""The numbers of a row."""


def _soft(suffix: str = "") -> dict[str, tuple[str, ...]]:
    return {f"solref{suffix}": ("softness.reference",), f"solimp{suffix}": ("softness.impedance",)}


ATTRIBUTES: Mapping[type, Mapping[str, tuple[str, ...]]] = {
    ContactOptions: {"cone": ("elliptic",), "impratio": ("friction_ratio",), "refsafe": ("safe",)},
    SoftLimit: {"range": ("lower", "upper"), "margin": ("margin",), **_soft("limit")},
    SoftFriction: {"frictionloss": ("force",), **_soft("friction")},
    SoftEquality: {
        "polycoef": ("polynomial",), "torquescale": ("turn_scale",), "anchor": ("anchors",),
        **_soft(),
    },
    Surface: {
        "condim": ("dimension",), "friction": ("friction",), "priority": ("priority",),
        "solmix": ("mix",), "margin": ("margin",), **_soft(),
    },
    ContactParameters: {
        "condim": ("dimension",), "friction": ("friction",), "margin": ("margin",), **_soft(),
        "solreffriction": ("sliding",),
    },
    Actuator: {
        "ctrlrange": ("control_range",), "actrange": ("state_range",),
        "forcerange": ("force_range",),
    },
    JointForceLimit: {"actuatorfrcrange": ("force",), "actuatorgravcomp": ("lifts",)},
    HardJoint: {"range": ("lower", "upper"), "effort": ("effort",)},
    HardSurface: {
        "lateral_friction": ("friction",), "restitution": ("restitution",),
        "stiffness and damping": ("spring",), "friction_anchor": ("anchored",),
    },
    CompliantSurface: {name: (name,) for name in ("friction", "stiffness", "dissipation")},
}  # fmt: skip
"""Attributes of a row, each with the fields that it follows from.

Gains, biases and dynamics of drives act without limits too: motions compare them.
"""


def values_of(row: Row, attribute: str) -> tuple[float, ...]:
    """Return the numbers of a row's attribute, flat; none for a limit that does not limit."""
    flat: list[float] = []
    for path in ATTRIBUTES[type(row)][attribute]:
        value: Any = row
        for name in path.split("."):
            value = getattr(value, name)
        parts = value if isinstance(value, tuple) else () if value is None else (value,)
        for part in parts:
            flat += (*part.position, *part.turn) if isinstance(part, Anchor) else (part,)
    if attribute == "range" and flat[0] > flat[1]:
        return ()
    return tuple(flat)


def with_attribute(row: Row, attribute: str, other: Row) -> Row:
    """Return a row with an attribute of another row of its kind."""
    for path in ATTRIBUTES[type(row)][attribute]:
        name, _, below = path.partition(".")
        value = getattr(other, name)
        if below:
            value = replace(getattr(row, name), **{below: getattr(value, below)})
        row = replace(row, **{name: value})
    return row


def attributes(row: Row) -> dict[str, tuple[float, ...]]:
    """Return the numbers of all attributes of a row, without those that it lacks."""
    every = {name: values_of(row, name) for name in ATTRIBUTES[type(row)]}
    return {name: values for name, values in every.items() if values}
