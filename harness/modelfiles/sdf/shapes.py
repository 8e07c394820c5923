"""The inertia of an SDFormat link that follows from its collision shapes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.sdf import SIZES, WATER, solid
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.sdf.frames import SdfFrames, inverse, read_pose
from physics_crosscheck.reference.mechanism.spatial_inertia import NO_INERTIA, SpatialInertia


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
