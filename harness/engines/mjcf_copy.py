"""An MJCF rewritten for a parser that takes a part of it: bodies, joints, and what they weigh.

What is seen and touches, and what adapters add themselves, is left out, so that no file is looked
for and nothing is warned of in vain; classes of defaults stay for the parser to resolve. Several
`<compiler>` are one, in which the last value of each attribute counts, as in MuJoCo: parsers read
the first element alone. Of several top-level `<default>` each class has what stands before it, so
that they are written into each element.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from physics_crosscheck.harness.engines.compiled import CompiledBody, Numbers
from physics_crosscheck.harness.engines.mjcf_declared import DeclaredMjcf
from physics_crosscheck.harness.engines.mjcf_defaults import Defaults, body_names, shaped
from physics_crosscheck.harness.engines.mjcf_inertias import is_aligned
from physics_crosscheck.harness.engines.mjcf_joints import FREE, JOINTS, MjcfJoint
from physics_crosscheck.harness.engines.source import finite_numbers

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
    gone |= {"damping"} if source.disabled("damper") else set()
    gone |= {"childclass"} if resolved else set()
    gone |= set() if refs else {"ref"}
    compilers = source.root.findall("compiler")
    if compilers:
        whole = {key: value for one in compilers for key, value in one.attrib.items()}
        _shallow(root, ET.Element("compiler", whole), gone)
    for one in () if resolved else source.root.findall("default"):
        _default(root, one, gone)
    world = ET.SubElement(root, "worldbody")
    joints = {joint.element: joint for joint in declared.joints}
    defaults = declared.defaults if resolved else None
    copy = _Copy(declared, joints, gone, defaults)
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
        declared: DeclaredMjcf,
        joints: Mapping[ET.Element, MjcfJoint],
        gone: set[str],
        defaults: Defaults | None,
    ) -> None:
        self._source, self._inertias = declared.source, declared.inertias
        self._names = body_names(declared.source)
        self._joints, self._gone, self._defaults = joints, gone, defaults
        root = declared.root
        self._aligned = root.body if root and is_aligned(self._source, root) else None

    def body(self, parent: ET.Element, body: ET.Element, inherited: str) -> None:
        """A body and what it carries, under a `childclass`."""
        inherited = body.get("childclass", inherited)
        own = _shallow(parent, body, self._gone)
        own.set("name", self._names[body])
        weighing = "geom" if shaped(self._source, body) else "inertial"
        if compiled := self._inertias.get(body):
            weighing = ""
            _state_inertia(own, compiled)
            if body is self._aligned:
                _place(own, compiled.at, compiled.turn)
        if inherited and self._defaults is None:
            own.set("childclass", inherited)
        for one in body:
            if one.tag in JOINTS and one in self._joints:
                self._joint(own, one, self._joints[one], inherited)
            elif one.tag == weighing and not _weightless(one):
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


def _state_inertia(body: ET.Element, compiled: CompiledBody) -> None:
    """Give a body in the copy the inertia that another engine has compiled."""
    if compiled.mass:
        own = ET.SubElement(body, "inertial", mass=repr(compiled.mass))
        own.set("diaginertia", _words(compiled.moments))
        _place(own, compiled.centre, compiled.principal)


def _place(element: ET.Element, at: Numbers, turn: Numbers) -> None:
    for key in POSE:
        element.attrib.pop(key, None)
    element.set("pos", _words(at))
    element.set("quat", _words(turn))


def _words(numbers: Numbers) -> str:
    return " ".join(map(repr, numbers))


def _weightless(one: ET.Element) -> bool:
    """Return whether it is an `<inertial>` without mass and moments, which parsers refuse."""
    return one.tag == "inertial" and not any(finite_numbers(one.get("mass", "")) or [1.0])


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
