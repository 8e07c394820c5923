"""Shapes of the links of URDF and SDFormat files: `<visual>` and `<collision>`.

A shape that can't be read is left out, since no verdict depends on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.tree import FileLink
from physics_crosscheck.reference.mechanism.rotations import from_rpy
from physics_crosscheck.reference.mechanism.spatial_inertia import Place
from .robot import PlacedShape

_SIZES: Mapping[str, tuple[tuple[str, int, float], ...]] = MappingProxyType(
    {
        "box": (("size", 3, 0.5),),
        "sphere": (("radius", 1, 1.0),),
        "ellipsoid": (("radii", 3, 1.0),),
        "cylinder": (("radius", 1, 1.0), ("length", 1, 0.5)),
        "capsule": (("radius", 1, 1.0), ("length", 1, 0.5)),
    }
)
"""The sizes of each form: name, count of its numbers, and factor to half edges or half lengths."""


def placed_in(links: Mapping[str, FileLink], file: Path) -> tuple[PlacedShape, ...]:
    """Return the shapes of all links, by their names."""
    rows = (_shapes(name, link.element, file) for name, link in links.items())
    return tuple(shape for row in rows for shape in row)


def _shapes(name: str, link: XmlElement, file: Path) -> Iterator[PlacedShape]:
    """Yield the shapes of a link, visual ones first.

    Args:
        name: name of the link.
        link: its element.
        file: path of the file.
    """
    elements = (*link.findall("visual"), *link.findall("collision"))
    for index, element in enumerate(elements):
        place, form = _pose(element), element.find("geometry/*")
        size = None if form is None else _size(form)
        if form is None or place is None or size is None:
            continue
        stated = next(filter(None, map(element.find, ("origin", "pose"))), element)
        yield PlacedShape(
            name=f"{element.tag}:{name}#{index}",
            body=name,
            place=place,
            size=size,
            file=file,
            line=stated.place[1] or 0,
            size_place=(file, form.place[1] or 0),
            kind=form.tag,
            visual=element.tag == "visual",
            mesh=form.get("filename") or form.findtext("uri").strip(),
            scale=_scale(form),
        )


def _pose(element: XmlElement) -> Place | None:
    """Return the pose in the link: `<origin xyz rpy>`, or `<pose>x y z roll pitch yaw</pose>`."""
    origin, pose = element.find("origin"), element.find("pose")
    if pose is not None and pose.attributes:
        return None  # in another frame, or with another kind of angles
    texts = ("0 0 0", "0 0 0")
    if origin is not None:
        texts = origin.get("xyz", texts[0]), origin.get("rpy", texts[1])
    elif pose is not None and (words := pose.text.split()):
        texts = " ".join(words[:3]), " ".join(words[3:])
    position, angles = (read_numbers(text, 3) for text in texts)
    if position is None or angles is None:
        return None
    return Place(from_rpy(*angles), np.array(position))


def _scale(form: XmlElement) -> tuple[float, ...]:
    """Return the factors of a mesh's coordinates."""
    return read_numbers(form.get("scale") or form.findtext("scale"), 3) or (1.0, 1.0, 1.0)


def _size(form: XmlElement) -> tuple[float, ...] | None:
    """Return the half sizes of a form; None for an unknown form or sizes that are not numbers."""
    if form.tag == "mesh":
        return ()
    sizes: list[float] = []
    for key, count, factor in _SIZES.get(form.tag, (("", 0, 0.0),)):
        numbers = read_numbers(form.get(key) or form.findtext(key).strip(), count)
        if numbers is None or not count:
            return None
        sizes += [factor * value for value in numbers]
    return tuple(sizes)
