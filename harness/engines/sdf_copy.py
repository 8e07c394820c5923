"""An SDFormat model rewritten for an engine to load: the user's own file stays as it is."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Sequence

from physics_crosscheck.harness.engines.sdf import SdfFile
from physics_crosscheck.harness.engines.sdf_check import OPAQUE, has_automatic
from physics_crosscheck.harness.engines.urdf_copy import Change, changed

VERSION = "1.6"
"""The last version before frames, which older parsers read."""


def sdf_text(file: SdfFile, changes: Sequence[Change]) -> str:
    """The model alone, without its world, with changes of the `<model>`."""
    root = ET.Element("sdf", {"version": file.source.root.get("version", VERSION)})
    root.append(changed(file.model, changes))
    return ET.tostring(root, encoding="unicode")


def sdf_without_shapes(model: ET.Element) -> None:
    """Leave out what is seen, touches, senses, is lit or loaded: no mesh and no code is looked for.

    Shapes of which an automatic inertia is made stay.
    """
    for holder in (model, *model.findall("link"), *model.findall("joint")):
        for part in list(holder):
            if part.tag in OPAQUE or (part.tag == "collision" and not has_automatic(holder)):
                holder.remove(part)


def sdf_without_bounds(model: ET.Element) -> None:
    """No limits of positions at all."""
    for joint in model.findall("joint"):
        sdf_without_bounds_of(joint)


def sdf_without_bounds_of(joint: ET.Element) -> None:
    """None of one joint."""
    for limit in joint.findall("axis/limit"):
        for part in list(limit):
            if part.tag in ("lower", "upper"):
                limit.remove(part)


def sdf_without_friction(model: ET.Element) -> None:
    """No dry friction of joints."""
    for dynamics in model.findall("joint/axis/dynamics"):
        for part in dynamics.findall("friction"):
            dynamics.remove(part)


def sdf_with_held(names: Sequence[str]) -> Change:
    """Make joints stand still where they are drawn."""

    def hold(model: ET.Element) -> None:
        for joint in model.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
                for axis in joint.findall("axis"):
                    joint.remove(axis)

    return hold


def sdf_mimics_of(followers: Collection[str]) -> Change:
    """Let all joints that follow others move on their own, but for these."""

    def change(model: ET.Element) -> None:
        for joint in model.findall("joint"):
            for axis in joint.findall("axis") if joint.get("name") not in followers else ():
                for mimic in axis.findall("mimic"):
                    axis.remove(mimic)

    return change
