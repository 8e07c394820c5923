"""Axes of a URDF's joints that are no unit vectors: PyBullet takes their length into the motion.

`btMultiBody::setupRevolute` and `setupPrismatic` take the axis as it is, and a velocity is then of
the axis' length. Six printed digits of a slanted axis are off a unit vector by 1e-7.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

import numpy as np

from physics_crosscheck.harness.engines.source import finite_numbers
from physics_crosscheck.harness.engines.urdf import ROUNDED

UNIT: Mapping[str, object] = {"unit_axes": True}
"""The adapter's setting that loads the file with axes of unit length."""

MOVING = ("revolute", "continuous", "prismatic")


def _long(robot: ET.Element) -> Iterator[tuple[ET.Element, ET.Element, list[float], float]]:
    """Joints with such an axis, the axis, its numbers and its length."""
    for joint in robot.findall("joint"):
        axis = joint.find("axis")
        if axis is None or joint.get("type") not in MOVING:
            continue
        numbers = finite_numbers(axis.get("xyz", "")) or []
        length = float(np.linalg.norm(numbers))
        if len(numbers) == 3 and length > 0 and abs(length - 1) > ROUNDED:
            yield joint, axis, numbers, length


def long_axes(robot: ET.Element) -> dict[str, float]:
    """By how much the axis of each joint is longer than 1, where it is not a unit vector."""
    return {joint.get("name", ""): length - 1 for joint, _, _, length in _long(robot)}


def unit_axes(robot: ET.Element) -> None:
    """Make each a unit vector."""
    for _, axis, numbers, length in _long(robot):
        axis.set("xyz", " ".join(repr(number / length) for number in numbers))


def length_cause(lengths: Mapping[str, float]) -> str:
    """What a diagnosis calls it."""
    worst = max(map(abs, lengths.values()))
    return f"PyBullet's own length of the axes of {', '.join(lengths)}, up to {worst:.1e} off 1"
