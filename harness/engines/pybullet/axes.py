"""URDF joint axes that are not unit vectors: PyBullet scales the motion by their length.

`btMultiBody::setupRevolute` and `setupPrismatic` use the axis as given, so velocities are scaled by
its length. A slanted axis printed with six digits has a length that differs from 1 by 1e-7.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.source import finite_numbers
from physics_crosscheck.harness.engines.urdf import ROUNDED

UNIT: Mapping[str, object] = {"unit_axes": True}
"""The adapter's setting that normalizes the file's axes."""

MOVING = ("revolute", "continuous", "prismatic")


def _long(robot: XmlElement) -> Iterator[tuple[XmlElement, XmlElement, list[float], float]]:
    """Yield joints with such an axis, the axis, its numbers and its length."""
    for joint in robot.findall("joint"):
        axis = joint.find("axis")
        if axis is None or joint.get("type") not in MOVING:
            continue
        numbers = finite_numbers(axis.get("xyz", "")) or []
        length = float(np.linalg.norm(numbers))
        if len(numbers) == 3 and length > 0 and abs(length - 1) > ROUNDED:
            yield joint, axis, numbers, length


def long_axes(robot: XmlElement) -> dict[str, float]:
    """Return the excess length of each joint axis that is not a unit vector."""
    return {joint.get("name", ""): length - 1 for joint, _, _, length in _long(robot)}


def unit_axes(robot: XmlElement) -> None:
    """Normalize these axes."""
    for _, axis, numbers, length in _long(robot):
        axis.set("xyz", " ".join(repr(number / length) for number in numbers))


def length_cause(lengths: Mapping[str, float]) -> str:
    """Return the cause that a diagnosis reports."""
    worst = max(map(abs, lengths.values()))
    return f"PyBullet's own length of the axes of {', '.join(lengths)}, up to {worst:.1e} off 1"
