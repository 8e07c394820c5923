"""Classification of wrong poses: kinds of mistakes, tried in order from the simplest."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.checks.placed_frames import Placed
from physics_crosscheck.reference.mechanism.numeric import Array

SHARE = 1e-3
"""Share of a pose error that a kind may leave unexplained, if rounding allows less."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Miss:
    """One frame at K positions, in the equations and in the engine.

    Attributes:
        at, turn: in the equations, (K, 3) and (K, 3, 3).
        found_at, found_turn: in the engine.
        flipped: the equations' poses with the sign of one coordinate changed, by its name.
        point: whether it is a point, so that its rotation has no meaning.
        near: distance below which poses are equal, m and rad.
    """

    at: Array
    turn: Array
    found_at: Array
    found_turn: Array
    flipped: Mapping[str, tuple[Array, Array]]
    point: bool
    near: tuple[float, float]

    @staticmethod
    def of(
        f: int,
        expected: Placed,
        measured: Placed,
        flipped: Mapping[str, Placed],
        *,
        point: bool,
        uncertainty: tuple[float, float],
    ) -> Miss:
        """Select frame `f`."""
        far, turned = (float(np.max(each[:, f])) for each in expected.miss(measured))
        return Miss(
            at=expected.at[:, f],
            turn=expected.turn[:, f],
            found_at=measured.at[:, f],
            found_turn=measured.turn[:, f],
            flipped={name: (one.at[:, f], one.turn[:, f]) for name, one in flipped.items()},
            point=point,
            near=(max(uncertainty[0], SHARE * far), max(uncertainty[1], SHARE * turned)),
        )

    def is_at(self, position: Array) -> bool:
        """Return whether the engine has the origin at this place."""
        return bool(np.max(np.linalg.norm(self.found_at - position, axis=-1)) <= self.near[0])

    def is_turned(self, turn: Array) -> bool:
        """Return whether the engine has this rotation; false for a point."""
        chord = np.linalg.norm(self.found_turn - turn, axis=(-2, -1)) / np.sqrt(2)
        return self.point or bool(np.max(chord) <= self.near[1])


def kind_of(miss: Miss) -> str:
    """Return the kind of a mistake in a few words; "" if no kind explains the error."""
    return next(_kinds(miss), "")


def _kinds(miss: Miss) -> Iterator[str]:
    yield from _shifted(miss)
    yield from _flipped(miss)
    if not miss.point:
        yield from _turned(miss)
    yield from _plane(miss)
    if miss.point:
        yield from _mirrored(miss)


def _flipped(miss: Miss) -> Iterator[str]:
    """Yield the coordinates with the opposite sign."""
    for name, (position, turn) in miss.flipped.items():
        moved = _mean(miss.found_at - position)
        if miss.is_at(position + moved) and miss.is_turned(turn):
            kind = f"as if {name} had the other sign: an axis is flipped"
            yield f"{kind}{_and_moved(moved, miss)}"


def _shifted(miss: Miss) -> Iterator[str]:
    """Yield a translation in the world or in the body."""
    if not miss.is_turned(miss.turn):
        return
    off = miss.found_at - miss.at
    if miss.is_at(miss.at + _mean(off)):
        yield f"moved by {_vector(_mean(off))} in the world"
    # For a point, only the engine has the rotation of its body.
    inside = _mean(np.einsum("kji,kj->ki", miss.found_turn, off))
    if miss.is_at(miss.at + miss.found_turn @ inside):
        yield f"offset by {_vector(inside)} in its body's axes"


def _turned(miss: Miss) -> Iterator[str]:
    """Yield a constant rotation in the world or in the body."""
    world = miss.found_turn[0] @ miss.turn[0].T
    if miss.is_turned(world @ miss.turn):
        moved = _mean(miss.found_at - miss.at @ world.T)
        if miss.is_at(miss.at @ world.T + moved):
            yield f"turned in the world by {_turn(world)}{_and_moved(moved, miss)}"
    body = miss.turn[0].T @ miss.found_turn[0]
    if miss.is_turned(miss.turn @ body):
        inside = _mean(np.einsum("kji,kj->ki", miss.turn, miss.found_at - miss.at))
        if miss.is_at(miss.at + miss.turn @ inside):
            near = np.linalg.norm(inside) <= miss.near[0]
            yield f"its axes are turned by {_turn(body)} in its body" + (
                "" if near else f", and offset by {_vector(inside)} there"
            )


def _plane(miss: Miss) -> Iterator[str]:
    """Yield a rotation of the plane of motion or of a joint axis."""
    for axes in _cube():
        if np.allclose(axes, np.eye(3)):
            continue
        moved = _mean(miss.found_at - miss.at @ axes.T)
        if miss.is_at(miss.at @ axes.T + moved) and miss.is_turned(axes @ miss.turn @ axes.T):
            yield f"its motion is turned by {_turn(axes)}{_and_moved(moved, miss)}"


def _mirrored(miss: Miss) -> Iterator[str]:
    for i, name in enumerate("xyz"):
        sign = np.ones(3)
        sign[i] = -1.0
        moved = _mean(miss.found_at - miss.at * sign)
        if miss.is_at(miss.at * sign + moved):
            yield f"mirrored in {name}{_and_moved(moved, miss)}"


def _cube() -> Iterator[Array]:
    """Yield the 24 rotations of a cube, quarter turns about an axis first."""
    turns = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0:
                turns.append(matrix)
    yield from sorted(turns, key=lambda matrix: -float(np.trace(matrix)))


def _mean(rows: Array) -> Array:
    mean: Array = rows.mean(axis=0)
    return mean


def _vector(v: Array) -> str:
    size = np.linalg.norm(v)
    shown = [0.0 if abs(x) < 1e-6 * size else x for x in v]
    return f"({', '.join(f'{x:.4g}' for x in shown)}) m"


def _and_moved(moved: Array, miss: Miss) -> str:
    near = np.linalg.norm(moved) <= miss.near[0]
    return "" if near else f", and moved by {_vector(moved)} in the world"


def _turn(matrix: Array) -> str:
    """Format a rotation as an angle about an axis."""
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    # The rotation keeps its axis: the largest column of the symmetric part.
    symmetric = matrix + matrix.T + (1 - np.trace(matrix)) * np.eye(3)
    axis = symmetric[:, int(np.argmax(np.linalg.norm(symmetric, axis=0)))]
    axis = axis / (np.linalg.norm(axis) or 1.0)
    skew = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    if angle < 1e-4:  # the rest of the symmetric part is rounding
        angle, axis = float(np.linalg.norm(skew)) / 2, skew / (np.linalg.norm(skew) or 1.0)
    elif axis @ skew < 0 or (not (axis @ skew > 0) and axis.sum() < 0):
        axis = -axis
    return f"{np.degrees(angle):.4g} degrees about {_axis(axis)}"


def _axis(axis: Array) -> str:
    i = int(np.argmax(np.abs(axis)))
    if abs(axis[i]) > 1 - 1e-9:
        return f"{'-' if axis[i] < 0 else ''}{'xyz'[i]}"
    return f"({', '.join(f'{x:.4g}' for x in axis)})"
