"""Copies of an SDFormat model that engines load; the user's file does not change."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Sequence

from physics_crosscheck.harness.engines.sdf import SdfFile
from physics_crosscheck.harness.engines.sdf_check import OPAQUE, has_automatic
from physics_crosscheck.harness.engines.urdf_copy import Change, with_changes

VERSION = "1.6"
"""The last version without frames, which older parsers read."""


def sdf_text(file: SdfFile, changes: Sequence[Change]) -> str:
    """Return the model as text, without its world, after changes of the `<model>`."""
    root = ET.Element("sdf", {"version": file.source.root.get("version", VERSION)})
    root.append(with_changes(file.model, changes))
    return ET.tostring(root, encoding="unicode")


def sdf_without_shapes(model: ET.Element) -> None:
    """Remove visuals, contacts, sensors, lights and plugins, so that no mesh or code is loaded.

    Shapes that define an automatic inertia stay.
    """
    for holder in (model, *model.findall("link"), *model.findall("joint")):
        for part in list(holder):
            if part.tag in OPAQUE or (part.tag == "collision" and not has_automatic(holder)):
                holder.remove(part)


def sdf_without_bounds(model: ET.Element) -> None:
    """Remove all position limits."""
    for joint in model.findall("joint"):
        sdf_without_bounds_of(joint)


def sdf_without_bounds_of(joint: ET.Element) -> None:
    """Remove the position limits of one joint."""
    for limit in joint.findall("axis/limit"):
        for part in list(limit):
            if part.tag in ("lower", "upper"):
                limit.remove(part)


def sdf_without_friction(model: ET.Element) -> None:
    """Remove the dry friction of joints."""
    for dynamics in model.findall("joint/axis/dynamics"):
        for part in dynamics.findall("friction"):
            dynamics.remove(part)


def sdf_with_held(names: Sequence[str]) -> Change:
    """Return a change that fixes joints at their drawn positions."""

    def hold(model: ET.Element) -> None:
        for joint in model.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
                for axis in joint.findall("axis"):
                    joint.remove(axis)

    return hold


def sdf_mimics_of(followers: Collection[str]) -> Change:
    """Return a change that releases all mimic joints except these."""

    def change(model: ET.Element) -> None:
        for joint in model.findall("joint"):
            for axis in joint.findall("axis") if joint.get("name") not in followers else ():
                for mimic in axis.findall("mimic"):
                    axis.remove(mimic)

    return change
