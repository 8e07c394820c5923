"""Comparison of the contents of both files in the position in which they draw the mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.compare.candidate import Facts
from physics_crosscheck.harness.compare.execute import Execute, ask
from physics_crosscheck.harness.compare.frames import (
    FramesTask,
    frame_properties,
    frames,
    shared_frames,
)
from physics_crosscheck.harness.compare.prepared import PreparedComparison
from physics_crosscheck.harness.compare.properties import properties
from physics_crosscheck.harness.compare.property import Property
from physics_crosscheck.harness.compare.side import JointPair, ModelSide, model_side, pairs_of
from physics_crosscheck.harness.engines.protocol import Array


@dataclass(frozen=True, kw_only=True)
class FileComparison:
    """Comparison of two files.

    Attributes:
        sides: A and B; None if a file is not a tree of hinges and slides.
        properties: differences that affect motions first, then frames, then the rest.
        turned: reversed joints of the comparison.
    """

    sides: tuple[ModelSide, ModelSide] | None
    properties: tuple[Property, ...]
    turned: tuple[str, ...]

    @property
    def moving(self) -> bool:
        """True if a difference affects motions."""
        return any(one.moves for one in self.properties)


def compare_files(execute: Execute, prepared: PreparedComparison, home: Array) -> FileComparison:
    """Compare both files at one position.

    Args:
        execute: runs the engines, which compute frames.
        prepared: both models.
        home: positions of the source, (nz,).

    Raises:
        FailureError: if an engine fails.
    """
    source_facts = prepared.facts[0 if prepared.match.source == "A" else 1]
    pairs = pairs_of(prepared.match, source_facts.coordinates)
    z = home, prepared.match.value(home[None])[0]
    z = z if prepared.match.source == "A" else z[::-1]
    sides = _sides(prepared, z)
    if sides is None:
        return FileComparison(sides=None, properties=_frames(execute, prepared, z, 1.0), turned=())
    differences = properties(*sides, pairs)
    turned = tuple(
        p.a if prepared.match.source == "B" else p.b for p in pairs if p.a in differences.turned
    )
    if differences.turned:
        of_a = dict(zip(prepared.facts[0].coordinates, z[0].tolist(), strict=True))
        # Compare again in corresponding positions.
        pairs = tuple(_turned(p) if p.a in differences.turned else p for p in pairs)
        z = z[0], _posed(z[1], prepared.facts, pairs, of_a)
        again = _sides(prepared, z)
        assert again is not None
        differences = properties(*again, pairs)
    size = max(one.placed.size for one in sides)
    moving = [one for one in differences.differences if one.moves]
    rest = [one for one in differences.differences if not one.moves]
    every = (*moving, *_frames(execute, prepared, z, size), *rest)
    return FileComparison(sides=sides, properties=every, turned=turned)


def _sides(
    prepared: PreparedComparison, z: tuple[Array, Array]
) -> tuple[ModelSide, ModelSide] | None:
    side_a = model_side(prepared.a, prepared.facts[0], prepared.still[0], z[0])
    side_b = model_side(prepared.b, prepared.facts[1], prepared.still[1], z[1])
    return None if side_a is None or side_b is None else (side_a, side_b)


def _turned(pair: JointPair) -> JointPair:
    return replace(pair, slope=-pair.slope, offset=-pair.offset)


def _posed(
    z: Array, facts: tuple[Facts, Facts], pairs: tuple[JointPair, ...], of_a: Mapping[str, float]
) -> Array:
    """Return B's positions for given positions of A."""
    posed = np.array(z)
    for pair in pairs:
        posed[facts[1].coordinates.index(pair.b)] = pair.slope * of_a[pair.a] + pair.offset
    return posed


def _frames(
    execute: Execute, prepared: PreparedComparison, z: tuple[Array, Array], size: float
) -> tuple[Property, ...]:
    places = shared_frames(*prepared.facts)
    if not places[0] or prepared.a == prepared.b:
        return ()
    frames_a, frames_b = (
        ask(execute, candidate, frames, FramesTask(candidate, its, at))
        for candidate, its, at in zip((prepared.a, prepared.b), places, z, strict=True)
    )
    return frame_properties(places[0], frames_a, frames_b, size)
