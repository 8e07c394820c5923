"""Comparison of the contents of both files in the position in which they draw the mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.solving.segments import Segments
from .alignment import SAME
from .candidate import Candidate, Facts
from .execute import ask
from .explained import weighed
from .prepared import PreparedComparison
from .properties import properties
from .property import make_property
from .side import JointPair, ModelSide, model_side, pairs_of

POSE_ACCURACY = 1e-9
"""Accuracy of frames from engines, relative to the size of the mechanism."""


@dataclass(frozen=True, kw_only=True)
class FileComparison:
    """Comparison of two files.

    Attributes:
        sides: A and B; None if a file is not a tree of hinges and slides.
        properties: differences that affect motions first, then frames, then the rest.
        turned: reversed joints of the comparison.
    """

    sides: tuple[ModelSide, ModelSide] | None
    properties: tuple[ComparedProperty, ...]
    turned: tuple[str, ...]

    @property
    def moving(self) -> bool:
        """True if a difference affects motions."""
        return any(one.moves for one in self.properties)


def compare_files(
    executor: Executor, prepared: PreparedComparison, home: Array, runs: Segments | None
) -> FileComparison:
    """Compare both files at one position.

    Args:
        executor: runs the engines, which compute frames.
        prepared: both models.
        home: positions of the source, (nz,).
        runs: of A, with forces on its own coordinates, to weigh differences; None if unknown.

    Raises:
        FailureError: if an engine fails.
    """
    source_facts = prepared.facts[0 if prepared.match.source == "A" else 1]
    pairs = pairs_of(prepared.match, source_facts.coordinates)
    z = home, prepared.match.value(home[None])[0]
    z = z if prepared.match.source == "A" else z[::-1]
    sides = _sides(prepared, z)
    if sides is None:
        return FileComparison(
            sides=None, properties=_compare_frames(executor, prepared, z, 1.0), turned=()
        )
    differences, opposite = properties(*sides, pairs)
    turned = tuple(p.a if prepared.match.source == "B" else p.b for p in pairs if p.a in opposite)
    if opposite:
        of_a = dict(zip(prepared.facts[0].coordinates, z[0].tolist(), strict=True))
        # Compare again in corresponding positions.
        pairs = tuple(_turned(p) if p.a in opposite else p for p in pairs)
        z = z[0], _posed(z[1], prepared.facts, pairs, of_a)
        again = _sides(prepared, z)
        assert again is not None
        differences, _ = properties(*again, pairs)
    size = max(one.placed.size for one in sides)
    rows = weighed(differences, sides[0], runs)
    moving = [row for row in rows if row.moves]
    rest = [row for row in rows if not row.moves]
    placed = [
        structs.replace(row, where_a=sides[0].frame_line(row.about),
                        where_b=sides[1].frame_line(row.about))
        for row in _compare_frames(executor, prepared, z, size)
    ]  # fmt: skip
    every = (*moving, *placed, *rest)
    return FileComparison(sides=sides, properties=every, turned=turned)


def _sides(
    prepared: PreparedComparison, z: tuple[Array, Array]
) -> tuple[ModelSide, ModelSide] | None:
    side_a = model_side(prepared.facts[0], z[0])
    side_b = model_side(prepared.facts[1], z[1])
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


def _compare_frames(
    executor: Executor, prepared: PreparedComparison, z: tuple[Array, Array], size: float
) -> tuple[ComparedProperty, ...]:
    places = shared_frames(*prepared.facts)
    if not places[0] or prepared.models[0] == prepared.models[1]:
        return ()
    frames_a, frames_b = (
        ask(executor, candidate, partial(frames, places=its, z=at), candidate)
        for candidate, its, at in zip(prepared.models, places, z, strict=True)
    )
    return frame_properties(places[0], frames_a, frames_b, size)


def frames(candidate: Candidate, places: tuple[str, ...], z: Array) -> tuple[Array, Array]:
    """Return origins (F, 3), m, and rotations (F, 3, 3) of frames in the engine's world.

    Args:
        candidate: the model.
        places: the frames, as `kind:name`.
        z: positions, (nz,).

    Raises:
        EngineError: with file, place and remedy.
    """
    origins, turns = candidate.load().poses(places, z[None])
    return origins[0], turns[0]


def shared_frames(a: Facts, b: Facts) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return massless frames of A and of B with equal names: sites, and links on fixed joints.

    The frame of a link with mass is a convention.
    """
    frames_a, frames_b = _massless_frames(a), _massless_frames(b)
    names = [name for name in frames_a if name in frames_b]
    return tuple(frames_a[name] for name in names), tuple(frames_b[name] for name in names)


def _massless_frames(facts: Facts) -> dict[str, str]:
    parts = () if facts.robot is None else facts.robot.parts
    massless = {part.name for part in parts if not part.link.mass and not any(part.link.inertia)}
    places: dict[str, str] = {}
    for place in facts.places:
        kind, _, name = place.partition(":")
        if kind == "site" or (kind in ("body", "link") and name in massless):
            places.setdefault(name, place)
    return places


def frame_properties(
    places: Sequence[str], a: tuple[Array, Array], b: tuple[Array, Array], size: float
) -> tuple[ComparedProperty, ...]:
    """Return frames whose poses differ between the files."""
    differences = []
    for i, place in enumerate(places):
        name = place.partition(":")[2]
        apart = b[0][i] - a[0][i]
        far = float(np.linalg.norm(apart))
        turn = _angle(a[1][i].T @ b[1][i])
        parts = []
        if far > max(POSE_ACCURACY, SAME) * size:
            x, y, z = (f"{value + 0.0:.4g}" for value in apart)
            parts.append(f"in B {far:.4g} m away, by ({x}, {y}, {z}) in the world")
        if turn > 10 * SAME:
            parts.append(f"turned by {turn:.4g} rad")
        if parts:
            message = f"frame {name}: {' and '.join(parts)}"
            differences.append(
                make_property("frame", name, message, moves=False, relative=far / size + turn)[0]
            )
    return tuple(differences)


def _angle(rotation: Array) -> float:
    """Return the angle of a rotation, rad, accurate for small and large angles."""
    odd = rotation - rotation.T
    sine = float(np.linalg.norm([odd[2, 1], odd[0, 2], odd[1, 0]])) / 2
    return float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
