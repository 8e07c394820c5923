"""SDFormat for Drake, whose parser ignores `<mimic>` and defines its own element."""

from __future__ import annotations

from collections.abc import Sequence

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.sdf import mimic_of

PREFIX = "drake:"
"""The prefix of elements that only Drake reads."""

SPACE = {"xmlns:drake": "http://drake.mit.edu"}


def without_own(model: XmlElement) -> None:
    """Remove joint elements that only Drake reads, such as rotor inertias."""
    for joint in model.findall("joint"):
        for part in list(joint):
            if part.tag.startswith(PREFIX):
                joint.remove(part)


def own_mimics(model: XmlElement) -> None:
    """Write `<mimic>` as `<drake:mimic>`."""
    for joint in model.findall("joint"):
        mimic = mimic_of(joint)
        if mimic is not None:
            attributes = {
                "joint": mimic.leader,
                "multiplier": repr(mimic.multiplier),
                "offset": repr(mimic.offset),
            }
            joint.add(f"{PREFIX}mimic", SPACE | attributes)


def weightless_links(model: XmlElement) -> tuple[str, ...]:
    """Return the names of links with `<gravity>false</gravity>`, which Drake ignores."""
    return tuple(
        link.get("name", "")
        for link in model.findall("link")
        if link.findtext("gravity").strip().lower() in ("0", "false")
    )


def weight_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return f"Drake's ignoring of <gravity>false</gravity> ({listed})"
