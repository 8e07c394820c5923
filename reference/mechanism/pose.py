"""Named poses of a mechanism's bodies and points in the world, as declared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

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
    """Return a number or an expression."""
    if isinstance(value, (str, bytes)):
        raise _text(value)
    return sp.sympify(value)


def _text(value: str | bytes) -> ValueError:
    """Return the error for a string, which sympy would execute as code."""
    return ValueError(f"a pose contains the text {value[:60]!r}; write a number or an expression")
