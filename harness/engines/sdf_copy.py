"""Copies of an SDFormat model that engines load; the user's file does not change."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.sdf import SdfFile
from physics_crosscheck.harness.engines.sdf_check import OPAQUE, has_automatic
from physics_crosscheck.harness.engines.urdf_copy import Change, with_changes

VERSION = "1.6"
"""The last version without frames, which older parsers read."""


def sdf_text(file: SdfFile, changes: Sequence[Change]) -> str:
    """Return the model as text, without its world, after changes of the `<model>`."""
    root = XmlElement("sdf", {"version": VERSION} | file.source.root.attributes)
    root.append(with_changes(file.model, changes))
    return root.written().decode()


def sdf_without_shapes(model: XmlElement) -> None:
    """Remove visuals, contacts, sensors, lights and plugins, so that no mesh or code is loaded.

    Shapes that define an automatic inertia stay.
    """
    for holder in (model, *model.findall("link"), *model.findall("joint")):
        for part in list(holder):
            if part.tag in OPAQUE or (part.tag == "collision" and not has_automatic(holder)):
                holder.remove(part)


def sdf_without_bounds(model: XmlElement) -> None:
    """Remove all position limits."""
    for joint in model.findall("joint"):
        sdf_without_bounds_of(joint)


def sdf_without_bounds_of(joint: XmlElement) -> None:
    """Remove the position limits of one joint."""
    for limit in joint.findall("axis/limit"):
        for part in list(limit):
            if part.tag in ("lower", "upper"):
                limit.remove(part)


def sdf_without_friction(model: XmlElement) -> None:
    """Remove the dry friction of joints."""
    for dynamics in model.findall("joint/axis/dynamics"):
        for part in dynamics.findall("friction"):
            dynamics.remove(part)


def sdf_with_held(names: Sequence[str]) -> Change:
    """Return a change that fixes joints at their drawn positions."""

    def hold(model: XmlElement) -> None:
        for joint in model.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
                for axis in joint.findall("axis"):
                    joint.remove(axis)

    return hold


def sdf_mimics_of(followers: Collection[str]) -> Change:
    """Return a change that releases all mimic joints except these."""

    def change(model: XmlElement) -> None:
        for joint in model.findall("joint"):
            for axis in joint.findall("axis") if joint.get("name") not in followers else ():
                for mimic in axis.findall("mimic"):
                    axis.remove(mimic)

    return change
