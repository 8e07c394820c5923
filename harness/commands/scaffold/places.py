"""Places of bodies, joints and force elements in model files, for comments next to numbers."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError

Key = tuple[str, ...]
"""Kind, name and part: `("body", "rod")`, `("body", "rod", "mass")`."""

_BODIES, _JOINTS = ("link", "body"), ("joint", "freejoint")
_PULLS = ("tendon", "actuator")
"""Elements that contain force elements."""


def places(files: Iterable[Path]) -> Mapping[Key, str]:
    """Return `robot.urdf:93` of the first element of each name, and of its parts."""
    lines: dict[Key, str] = {}
    for file in files:
        try:
            document = Document(file)
        except LocationError:
            continue  # not well-formed XML, though an engine may read it
        for key, element in _named(document.root):
            lines.setdefault(key, f"{file.name}:{document.line(element)}")
    return lines


def _named(element: XmlElement) -> Iterator[tuple[Key, XmlElement]]:
    """Yield the named elements in and below an element."""
    name, kind = element.attributes.get("name", ""), _kind(element)
    if name and kind:
        yield (kind, name), element
        for label, part in _within(element):
            yield (kind, name, label), part
    if element.tag == "gazebo" and "reference" in element.attributes:
        for part in element.children:
            yield ("joint", element.attributes["reference"], part.tag), part
    for child in element.children:
        yield from _named(child)


def _kind(element: XmlElement) -> str:
    if element.tag in _BODIES:
        return "body"
    if element.tag in _JOINTS:
        return "joint"
    return "pull" if element.parent is not None and element.parent.tag in _PULLS else ""


def _within(element: XmlElement) -> Iterator[tuple[str, XmlElement]]:
    """Yield parts with numbers, except visual and collision geometry and other bodies."""
    for child in element.children:
        if child.tag == "inertial":
            yield child.tag, child
            yield from ((f"inertial/{part.tag}", part) for part in child.children)
        elif child.tag in ("origin", "axis", "dynamics", "limit"):
            yield child.tag, child
