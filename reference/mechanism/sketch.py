"""How a mechanism looks: shapes in a plane, their places as expressions of its coordinates.

A sketch is optional and nothing is computed from it; it lets a person see what moves. Lengths are
in metres, x to the right and y up; angles in radians, counterclockwise from x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp

Point: TypeAlias = tuple[Any, Any]
"""(x, y), each a number or an expression of positions and constants."""

LINKS = ("spring", "damper", "rod", "line", "wall", "measure")
BODIES = ("block", "disc", "spiral")


@dataclass(frozen=True)
class Link:
    """What reaches from one point to another.

    Attributes:
        kind: one of `LINKS`; a wall has its ground on the right of the way from start to end, a
            measure is an arrow that tells a coordinate, a line is dashed.
        start, end: its ends.
        label: the symbol written at it, or nothing.
    """

    kind: str
    start: Point
    end: Point
    label: str = ""


@dataclass(frozen=True)
class Body:
    """What has a place, a size and an angle.

    Attributes:
        kind: one of `BODIES`; a disc has a mark on its radius, a spiral is a torsional spring.
        at: its centre.
        width, height: of a block; a disc has its diameter as both.
        angle: by which it is turned.
        label: the symbol written at it, or nothing.
    """

    kind: str
    at: Point
    width: Any
    height: Any
    angle: Any = 0
    label: str = ""


@dataclass(frozen=True)
class Angle:
    """An arc with an arrow that tells an angle, from `start` to `end`, about a point."""

    at: Point
    radius: Any
    start: Any
    end: Any
    label: str = ""


Shape: TypeAlias = Link | Body | Angle


def expressions(shape: Shape) -> dict[str, sp.Expr]:
    """Every expression of a shape, by what it says."""
    match shape:
        case Link():
            given = _point("start", shape.start) | _point("end", shape.end)
        case Body():
            given = _point("at", shape.at)
            given |= {"width": shape.width, "height": shape.height, "angle": shape.angle}
        case Angle():
            given = _point("at", shape.at)
            given |= {"radius": shape.radius, "start": shape.start, "end": shape.end}
    return {name: sp.sympify(value) for name, value in given.items()}


def _point(name: str, point: Point) -> dict[str, Any]:
    x, y = point
    return {f"{name} x": x, f"{name} y": y}
