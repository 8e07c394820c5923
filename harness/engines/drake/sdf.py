"""SDFormat for Drake, whose parser ignores `<mimic>` and defines its own element."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from physics_crosscheck.harness.engines.sdf import mimic_of

SPACE = "http://drake.mit.edu"

ET.register_namespace("drake", SPACE)  # Drake's parser requires this prefix


def without_own(model: ET.Element) -> None:
    """Remove joint elements that only Drake reads, such as rotor inertias."""
    for joint in model.findall("joint"):
        for part in list(joint):
            if part.tag.startswith(f"{{{SPACE}}}"):
                joint.remove(part)


def own_mimics(model: ET.Element) -> None:
    """Write `<mimic>` as `<drake:mimic>`."""
    for joint in model.findall("joint"):
        mimic = mimic_of(joint)
        if mimic is not None:
            attributes = {
                "joint": mimic.leader,
                "multiplier": repr(mimic.multiplier),
                "offset": repr(mimic.offset),
            }
            ET.SubElement(joint, f"{{{SPACE}}}mimic", attributes)


def weightless_links(model: ET.Element) -> tuple[str, ...]:
    """Return the names of links with `<gravity>false</gravity>`, which Drake ignores."""
    return tuple(
        link.get("name", "")
        for link in model.findall("link")
        if (link.findtext("gravity") or "").strip().lower() in ("0", "false")
    )


def weight_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return f"Drake's ignoring of <gravity>false</gravity> ({listed})"
