"""Rules of SDFormat: the links that frames are attached to, and shapes that define an inertia.

A joint's parent and child may be frames, which are attached to links, joints or other frames
(http://sdformat.org/tutorials?tut=pose_frame_semantics). For `<inertial auto="true">` the format
computes a link's mass, center and moments from its collision shapes and their densities
(http://sdformat.org/tutorials?tut=auto_inertial_params_proposal).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement

MODEL, WORLD = "__model__", "world"
"""Names of frames that no file declares."""

WATER = 1000.0
"""The default density of a shape, kg/m^3."""

SIZES: Mapping[str, Mapping[str, tuple[float, ...]]] = MappingProxyType({
    "box": {"size": (1.0, 1.0, 1.0)},
    "sphere": {"radius": (1.0,)},
    "ellipsoid": {"radii": (1.0, 1.0, 1.0)},
    "cylinder": {"radius": (1.0,), "length": (1.0,)},
    "capsule": {"radius": (0.5,), "length": (1.0,)},
    "cone": {"radius": (0.5,), "length": (1.0,)},
})  # fmt: skip
"""The sizes of each shape that has moments, m, with their defaults."""

Solid = tuple[float, float, tuple[float, float, float]]
"""Volume, m^3; height of the center along z, m; moments about it per kg, m^2."""


def is_automatic(inertial: XmlElement) -> bool:
    """Return whether the attribute `auto` of an `<inertial>` selects the shapes' inertia."""
    return inertial.get("auto").strip().lower() in ("1", "true")


def has_automatic(link: XmlElement) -> bool:
    """Return whether a link's inertia follows from its collision shapes."""
    return any(map(is_automatic, link.findall("inertial")))


def attached(name: str, named: Mapping[str, XmlElement], model: XmlElement) -> str:
    """Return the link, or `world`, that a frame is attached to, or an empty text.

    Args:
        name: of a link, joint or frame, or `__model__`.
        named: links, joints and frames by name.
        model: the model, which is attached to its canonical link: by default the first.
    """
    passed: set[str] = set()
    while name not in passed:
        passed.add(name)
        if name == MODEL:
            first = next((key for key, one in named.items() if one.tag == "link"), "")
            name = model.get("canonical_link") or first
        element = named.get(name)
        if element is None or element.tag == "link":
            return name if element is not None or name == WORLD else ""
        name = child_of(element) if element.tag == "joint" else carrier(element)
    return ""


def child_of(joint: XmlElement) -> str:
    """Return the text of a joint's `<child>`."""
    return joint.findtext("child").strip()


def carrier(frame: XmlElement) -> str:
    """Return the frame that a `<frame>` is attached to."""
    return frame.get("attached_to") or MODEL


def solid(shape: str, sizes: Sequence[float]) -> Solid:
    """Return the volume, center and moments of a solid shape.

    Args:
        shape: one of `SIZES`.
        sizes: its sizes, in the order of `SIZES`, m.
    """
    if shape == "box":
        return _box(*sizes)
    if shape == "cone":
        return _cone(*sizes)
    if shape == "cylinder":
        return _round(sizes[0], sizes[1], 0.0)
    if shape == "capsule":
        return _round(sizes[0], sizes[1], sizes[0])
    a, b, c = sizes if shape == "ellipsoid" else (*sizes, *sizes, *sizes)
    moments = ((b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5)
    return 4 / 3 * math.pi * a * b * c, 0.0, moments


def _box(x: float, y: float, z: float) -> Solid:
    moments = ((y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12)
    return x * y * z, 0.0, moments


def _cone(radius: float, length: float) -> Solid:
    """Return those of a cone whose tip is on +z; its center is at a quarter of its length."""
    across = 3 / 80 * (4 * radius**2 + length**2)
    volume = math.pi * radius**2 * length / 3
    return volume, -length / 4, (across, across, 0.3 * radius**2)


def _round(radius: float, length: float, cap: float) -> Solid:
    """Return those of a cylinder with half a ball of radius `cap` on each end."""
    cylinder, ball = math.pi * radius**2 * length, 4 / 3 * math.pi * cap**3
    across = cylinder * (length**2 / 12 + radius**2 / 4)
    across += ball * (0.4 * cap**2 + length**2 / 4 + 3 / 8 * length * cap)
    along = cylinder * radius**2 / 2 + ball * 0.4 * cap**2
    volume = cylinder + ball
    return volume, 0.0, (across / volume, across / volume, along / volume)
