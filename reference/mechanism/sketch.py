"""Sketch of a mechanism: plane shapes whose positions are expressions of its coordinates.

A sketch is optional and only for display. Lengths are in metres, x to the right and y up; angles
are in radians, counterclockwise from x.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp

Point: TypeAlias = tuple[Any, Any]
"""(x, y), each a number or an expression of positions and constants."""

LINKS = ("spring", "damper", "rod", "line", "wall", "measure")
BODIES = ("block", "disc", "spiral")


@dataclass(frozen=True)
class Link:
    """A shape between two points.

    Attributes:
        kind: one of `LINKS`. A wall has its ground on the right, seen from start to end; a measure
            is an arrow for a coordinate; a line is dashed.
        start, end: its end points.
        label: symbol next to it, or empty.
    """

    kind: str
    start: Point
    end: Point
    label: str = ""


@dataclass(frozen=True)
class Body:
    """A shape with a position, a size and an angle.

    Attributes:
        kind: one of `BODIES`; a disc has a mark on its radius, a spiral is a torsional spring.
        at: its centre.
        width, height: size of a block; a disc has its diameter as both.
        angle: its rotation.
        label: symbol next to it, or empty.
    """

    kind: str
    at: Point
    width: Any
    height: Any
    angle: Any = 0
    label: str = ""


@dataclass(frozen=True)
class Angle:
    """An arc with an arrow for an angle, from `start` to `end`, about a point."""

    at: Point
    radius: Any
    start: Any
    end: Any
    label: str = ""


Shape: TypeAlias = Link | Body | Angle


def expressions(shape: Shape) -> dict[str, sp.Expr]:
    """Return every expression of a shape, by field name."""
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
