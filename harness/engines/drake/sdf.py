"""SDFormat for Drake, whose parser reads over `<mimic>` and has an element of its own for it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from physics_crosscheck.harness.engines.sdf import mimic_of

SPACE = "http://drake.mit.edu"

ET.register_namespace("drake", SPACE)  # its parser knows its elements by that prefix


def without_own(model: ET.Element) -> None:
    """Leave out what only Drake reads of a joint, such as inertias of rotors."""
    for joint in model.findall("joint"):
        for part in list(joint):
            if part.tag.startswith(f"{{{SPACE}}}"):
                joint.remove(part)


def own_mimics(model: ET.Element) -> None:
    """Write `<mimic>` as `<drake:mimic>`."""
    for joint in model.findall("joint"):
        mimic = mimic_of(joint)
        if mimic is not None:
            told = {
                "joint": mimic.leader,
                "multiplier": repr(mimic.multiplier),
                "offset": repr(mimic.offset),
            }
            ET.SubElement(joint, f"{{{SPACE}}}mimic", told)


def weightless(model: ET.Element) -> tuple[str, ...]:
    """Return the names of links that gravity is not to pull on: Drake ignores `<gravity>`."""
    return tuple(
        link.get("name", "")
        for link in model.findall("link")
        if (link.findtext("gravity") or "").strip().lower() in ("0", "false")
    )


def weight_cause(names: Sequence[str]) -> str:
    """Return what a diagnosis calls it."""
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return f"Drake's ignoring of <gravity>false</gravity> ({listed})"
