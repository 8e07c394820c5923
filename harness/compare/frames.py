"""Poses of frames with the same name in both files, such as a tool frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.alignment import SAME
from physics_crosscheck.harness.compare.candidate import Candidate, Facts
from physics_crosscheck.harness.compare.property import Property, make_property
from physics_crosscheck.harness.engines.protocol import Array

POSE_ACCURACY = 1e-9
"""Accuracy of frames from engines, relative to the size of the mechanism."""


@dataclass(frozen=True)
class FramesTask:
    """Input of a worker: frames of a model, as `kind:name`, and positions, (nz,)."""

    candidate: Candidate
    places: tuple[str, ...]
    z: Array


def frames(task: FramesTask) -> tuple[Array, Array]:
    """Return origins (F, 3), m, and rotations (F, 3, 3) in the engine's world.

    Raises:
        EngineError: with file, place and remedy.
    """
    origins, turns = task.candidate.load().poses(task.places, task.z[None])
    return origins[0], turns[0]


def shared_frames(a: Facts, b: Facts) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return massless frames of A and of B with equal names: sites, and links on fixed joints.

    The frame of a link with mass is a convention.
    """
    frames_a, frames_b = _frames(a), _frames(b)
    names = [name for name in frames_a if name in frames_b]
    return tuple(frames_a[name] for name in names), tuple(frames_b[name] for name in names)


def _frames(facts: Facts) -> dict[str, str]:
    parts = () if facts.robot is None else facts.robot.parts
    massless = {part.name for part in parts if part.mass == 0.0 and not part.inertia.any()}
    places: dict[str, str] = {}
    for place in facts.places:
        kind, _, name = place.partition(":")
        if kind == "site" or (kind in ("body", "link") and name in massless):
            places.setdefault(name, place)
    return places


def frame_properties(
    places: Sequence[str], a: tuple[Array, Array], b: tuple[Array, Array], size: float
) -> tuple[Property, ...]:
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
                make_property(
                    "frame",
                    name,
                    message,
                    far / size + turn,
                    moves=False,
                    relative=far / size + turn,
                )
            )
    return tuple(differences)


def _angle(rotation: Array) -> float:
    """Return the angle of a rotation, rad, accurate for small and large angles."""
    odd = rotation - rotation.T
    sine = float(np.linalg.norm([odd[2, 1], odd[0, 2], odd[1, 0]])) / 2
    return float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
