"""Shapes that define the inertia of an SDFormat link.

For `<inertial auto="true">` the format computes a link's mass, center and moments from its
collision shapes and their densities
(http://sdformat.org/tutorials?tut=auto_inertial_params_proposal).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.reference.mechanism.spatial_inertia import NO_INERTIA, SpatialInertia
from ..document import Document
from ..elements import XmlElement
from ..errors import quote
from .frames import SdfFrames, inverse, read_pose

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


def automatic_inertia(
    document: Document, frames: SdfFrames, link: XmlElement, inertial: XmlElement, name: str
) -> SpatialInertia:
    """Return the inertia of an `<inertial auto="true">` from the shapes of a link, in the link's
    frame.

    A `<mass>` in it scales the densities; `<pose>` and `<inertia>` have no meaning there. Shapes
    without such an inertia are noted in the document.

    Args:
        document: the file.
        frames: of its model.
        link, inertial: the elements.
        name: of the link.
    """
    what, total = f"link {quote(name)}", NO_INERTIA
    collisions = [one for one in link.children if one.tag == "collision"]
    if not collisions:
        document.add_problem(
            inertial,
            f'<inertial auto="true"> of {what} has no <collision> to compute it from',
            "give the link a <collision>, or write its mass and inertia",
        )
    for collision in collisions:
        density = _positive(
            document,
            document.child(collision, "density") or document.child(inertial, "density"),
            (WATER,),
            what,
        )[0]
        for shape_inertia in _solid(document, collision, what, density):
            pose = read_pose(document, collision, f"a <collision> of {what}")
            place = pose.place
            if pose.relative_to:
                outer = inverse(frames.place(name)).compose(frames.place(pose.relative_to))
                place = outer.compose(place)
            total = total.combined(shape_inertia.in_frame(place))
    mass = document.child(inertial, "mass")
    if mass is None or not total.mass:
        return total
    ratio = _positive(document, mass, (total.mass,), what)[0] / total.mass
    return SpatialInertia(total.mass * ratio, total.center, total.inertia * ratio)


def _solid(
    document: Document, collision: XmlElement, what: str, density: float
) -> Iterator[SpatialInertia]:
    """Yield the inertia of a collision shape in its own frame, if it has one."""
    geometry = document.child(collision, "geometry")
    shape = next(iter(geometry.children), None) if geometry is not None else None
    if shape is None or shape.tag not in SIZES:
        label = "an empty <geometry>" if shape is None else f"a <{shape.tag}>"
        document.add_problem(
            shape or collision,
            f'<inertial auto="true"> of {what} is not computed from {label}',
            f"use {', '.join(SIZES)}, or write its mass and inertia",
        )
        return
    sizes = [
        size
        for tag, default in SIZES[shape.tag].items()
        for size in _positive(document, document.child(shape, tag), default, what)
    ]
    volume, height, moments = solid(shape.tag, sizes)
    mass = density * volume
    yield SpatialInertia(mass, np.array([0.0, 0.0, height]), mass * np.diag(moments))


def _positive(
    document: Document, element: XmlElement | None, default: tuple[float, ...], what: str
) -> tuple[float, ...]:
    values = document.text_numbers(element, default, what)
    if element is not None and min(values) <= 0:
        document.add_problem(
            element, f"<{element.tag}> of {what} is not positive", "write a positive number"
        )
        return default
    return values
