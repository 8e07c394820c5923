"""Displaced bases: a mechanism moved, or rotated about the vertical."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake

UP = 1.0
"""Height by which a base is raised, metres; gravity is the same at any height."""

_QUARTER = "1.5707963267948966"
_ORIENTED = ("quat", "euler", "axisangle", "xyaxes", "zaxis")


def bases(subject: Subject) -> Iterator[Mistake]:
    """Yield the first body attached to the ground, raised, and rotated by 90 degrees."""
    hung = _hung(subject)
    if hung is None:
        return
    element, where = hung
    key, turned = "pos", ("quat", "0.7071067811865476 0 0 0.7071067811865476")
    if subject.suffix == ".urdf":
        key, turned = "xyz", ("rpy", f"0 0 {_QUARTER}")
    with suppress(ValueError):
        x, y, z = map(float, element.attributes.get(key, "0 0 0").split())
        raised = Attribute(element.start, key, f"{x!r} {y!r} {z + UP!r}")
        yield Mistake("base moved", where, Edit(attributes=(raised,)), audit_words="moved by")
    if not any(map(float, element.attributes.get("rpy", "0").split())) and not any(
        one in element.attributes for one in _ORIENTED
    ):
        edit = Edit(attributes=(Attribute(element.start, *turned),))
        yield Mistake("plane of motion turned", where, edit, audit_words="turned")


def _hung(subject: Subject) -> tuple[XmlElement, str] | None:
    """Return the element that places the first moving body on the ground, and the joint's name."""
    for name, joint in subject.joints():
        body = joint.parent
        if subject.suffix == ".xml":
            if body is not None and body.parent is not None and body.parent.tag == "worldbody":
                return body, name
        else:
            origin = next((c for c in joint.children if c.tag == "origin"), None)
            if origin is not None:
                return origin, name
    return None
