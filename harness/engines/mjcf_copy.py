"""An MJCF rewritten for a parser that takes a part of it: bodies, joints, and what they weigh.

What is seen and touches, and what adapters add themselves, is left out, so that no file is looked
for and nothing is warned of in vain; classes of defaults stay for the parser to resolve.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from harness.engines.mjcf_declared import DeclaredMjcf
from harness.engines.mjcf_defaults import Defaults, bodies_of, shaped
from harness.engines.mjcf_joints import FREE, JOINTS, MjcfJoint
from harness.engines.mjcf_source import MjcfSource

POSE = ("pos", "quat", "axisangle", "euler", "xyaxes", "zaxis")

TOUCHES = ("contype", "conaffinity")
"""By which a geom touches others."""

LIMITS = ("range", "limited")

_KEPT = {
    "compiler": ("angle", "eulerseq", "autolimits"),
    "body": ("name", "childclass", *POSE),
    "joint": ("name", "class", "type", "axis", "pos", "ref", "damping", "armature", *LIMITS),
    "inertial": ("mass", "diaginertia", "fullinertia", *POSE),
    "geom": ("name", "class", "type", "size", "fromto", "mass", "density", *TOUCHES, *POSE),
}  # fmt: skip
"""Attributes that say something of bodies and joints."""


def body_name(i: int, body: ET.Element) -> str:
    """What a body is called in the copy, by its place among all."""
    return body.get("name") or f"body_{i}"


def copied(
    declared: DeclaredMjcf,
    *,
    limits: bool,
    touches: bool,
    resolved: bool,
    refs: bool = True,
) -> ET.Element:
    """The copy.

    Args:
        declared: the file.
        limits: whether those of positions are kept.
        touches: whether geoms say what they touch.
        refs: whether joints say what they are where the file draws them.
        resolved: whether each element says what its defaults add, and there are none.
    """
    source = declared.source
    root = ET.Element("mujoco", model=source.root.get("model", "") or "model")
    gone = {*(() if limits else ("autolimits", *LIMITS)), *(() if touches else TOUCHES)}
    gone |= {"childclass"} if resolved else set()
    gone |= set() if refs else {"ref"}
    for one in source.root.findall("compiler"):
        _shallow(root, one, gone)
    for one in () if resolved else source.root.findall("default"):
        _default(root, one, gone)
    world = ET.SubElement(root, "worldbody")
    names = {body: body_name(i, body) for i, (body, _) in enumerate(bodies_of(source))}
    joints = {joint.element: joint for joint in declared.joints}
    defaults = declared.defaults if resolved else None
    copy = _Copy(joints=joints, names=names, source=source, gone=gone, defaults=defaults)
    for one in source.root.findall("worldbody"):
        for body in one.findall("body"):
            copy.body(world, body, one.get("childclass", ""))
    return root


def without_pose(root: ET.Element) -> ET.Element:
    """Let bodies that float be drawn at the origin: they count from there."""
    for body in root.iter("body"):
        if body.find("freejoint") is not None:
            for key in POSE:
                body.attrib.pop(key, None)
    return root


class _Copy:
    """Copies bodies."""

    def __init__(
        self,
        joints: dict[ET.Element, MjcfJoint],
        names: dict[ET.Element, str],
        source: MjcfSource,
        gone: set[str],
        defaults: Defaults | None,
    ) -> None:
        self._joints, self._names, self._source, self._gone = joints, names, source, gone
        self._defaults = defaults

    def body(self, parent: ET.Element, body: ET.Element, inherited: str) -> None:
        """A body and what it carries, under a `childclass`."""
        inherited = body.get("childclass", inherited)
        own = _shallow(parent, body, self._gone)
        own.set("name", self._names[body])
        if inherited and self._defaults is None:
            own.set("childclass", inherited)
        weighing = ("geom",) if shaped(self._source, body) else ("inertial",)
        for one in body:
            if one.tag in JOINTS and one in self._joints:
                self._joint(own, one, self._joints[one], inherited)
            elif one.tag in weighing:
                self._element(own, one, inherited)
            elif one.tag == "body":
                self.body(own, one, inherited)

    def _element(self, body: ET.Element, one: ET.Element, inherited: str) -> ET.Element:
        if self._defaults is None or one.tag == "inertial":
            return _shallow(body, one, self._gone)
        whole = ET.Element(one.tag, dict(self._defaults.of(one, inherited)))
        return _shallow(body, whole, self._gone | {"class"})

    def _joint(
        self, body: ET.Element, element: ET.Element, joint: MjcfJoint, inherited: str
    ) -> None:
        if joint.kind == FREE:
            ET.SubElement(body, "freejoint", name=joint.name)
            return
        own = self._element(body, element, inherited)
        own.set("name", joint.name)
        # A range whose lower bound is above its upper is none.
        if "limited" not in self._gone and math.isinf(joint.limits[0]):
            own.attrib.pop("range", None)
            own.set("limited", "false")


def _default(parent: ET.Element, default: ET.Element, gone: set[str]) -> None:
    own = ET.SubElement(parent, "default", default.attrib)
    for one in default:
        if one.tag == "default":
            _default(own, one, gone)
        elif one.tag in ("joint", "geom"):
            _shallow(own, one, gone)


def _shallow(parent: ET.Element, one: ET.Element, gone: set[str]) -> ET.Element:
    """The element without its children, with what of its attributes says something here."""
    kept = {k: v for k, v in one.attrib.items() if k in _KEPT[one.tag] and k not in gone}
    for key in ("damping", "armature"):
        if key in kept:
            kept[key] = kept[key].split()[0]  # zeros follow
    return ET.SubElement(parent, one.tag, kept)
