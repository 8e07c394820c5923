"""A copy of an MJCF for a parser of a subset: bodies, joints and inertias.

The copy leaves out visuals, contacts and elements that adapters add themselves, so that the parser
loads no files and prints no irrelevant warnings. Classes of defaults stay for the parser to
resolve. Several `<compiler>` become one, with the last value of each attribute, as in MuJoCo:
parsers read the first element only. In several top-level `<default>` each class includes the
earlier ones, so they are written into each element.
"""

import math
from collections.abc import Mapping, Sequence

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.bodies import Quaternion, RigidBody, Triple
from .mjcf_declared import DeclaredMjcf
from .mjcf_defaults import Defaults, body_names, has_shape_inertia
from .mjcf_inertias import is_aligned
from .mjcf_joints import FREE, JOINTS, MjcfJoint
from .mjcf_source import ORIENTATIONS

POSE = ("pos", *ORIENTATIONS)

TOUCHES = ("contype", "conaffinity")
"""Attributes by which geoms collide."""

LIMITS = ("range", "limited")

_KEPT = {
    "compiler": ("angle", "eulerseq", "autolimits"),
    "body": ("name", "childclass", *POSE),
    "joint": ("name", "class", "type", "axis", "pos", "ref", "damping", "armature", *LIMITS),
    "inertial": ("mass", "diaginertia", "fullinertia", *POSE),
    "geom": ("name", "class", "type", "size", "fromto", "mass", "density", *TOUCHES, *POSE),
}  # fmt: skip
"""Attributes that describe bodies and joints."""


def copy_mjcf(
    declared: DeclaredMjcf, *, limits: bool, touches: bool, resolved: bool, refs: bool = True
) -> XmlElement:
    """Return the copy.

    Args:
        declared: the file.
        limits: whether joint limits are kept.
        touches: whether geoms keep their contact attributes.
        resolved: whether defaults are written into each element and removed.
        refs: whether joints keep their positions in the drawn configuration.
    """
    source = declared.source
    root = XmlElement("mujoco", {"model": source.root.get("model") or "model"})
    gone = {*(() if limits else ("autolimits", *LIMITS)), *(() if touches else TOUCHES)}
    gone |= {"damping"} if source.disabled("damper") else set()
    gone |= {"childclass"} if resolved else set()
    gone |= set() if refs else {"ref"}
    compilers = source.root.findall("compiler")
    if compilers:
        whole = {key: value for element in compilers for key, value in element.attributes.items()}
        _shallow(root, XmlElement("compiler", whole), gone)
    for element in () if resolved else source.root.findall("default"):
        _default(root, element, gone)
    world = root.add("worldbody")
    joints = {joint.element: joint for joint in declared.joints}
    defaults = declared.defaults if resolved else None
    copy = _Copy(declared, joints, gone, defaults)
    for element in source.root.findall("worldbody"):
        for body in element.findall("body"):
            copy.body(world, body, element.get("childclass", ""))
    return root


def without_pose(root: XmlElement) -> XmlElement:
    """Place floating bodies at the origin, from which their coordinates count."""
    for body in root.iter("body"):
        if body.find("freejoint") is not None:
            for key in POSE:
                body.attributes.pop(key, None)
    return root


class _Copy:
    """A writer of copied bodies."""

    def __init__(
        self,
        declared: DeclaredMjcf,
        joints: Mapping[XmlElement, MjcfJoint],
        gone: set[str],
        defaults: Defaults | None,
    ) -> None:
        self._source, self._inertias = declared.source, declared.inertias
        self._names = body_names(declared.source)
        self._joints, self._gone, self._defaults = joints, gone, defaults
        self._aligned = [one.body for one in declared.frees if is_aligned(self._source, one)]

    def body(self, parent: XmlElement, body: XmlElement, inherited: str) -> None:
        """Copy a body and its children, under a `childclass`."""
        inherited = body.get("childclass", inherited)
        copy = _shallow(parent, body, self._gone)
        copy.set("name", self._names[body])
        weighing = "geom" if has_shape_inertia(self._source, body) else "inertial"
        if compiled := self._inertias.get(body):
            weighing = ""
            _state_inertia(copy, compiled)
            if body in self._aligned:
                _place(copy, compiled.position, compiled.quaternion)
        if inherited and self._defaults is None:
            copy.set("childclass", inherited)
        for child in body:
            if child.tag in JOINTS and child in self._joints:
                self._joint(copy, child, self._joints[child], inherited)
            elif child.tag == weighing and not _weightless(child):
                self._element(copy, child, inherited)
            elif child.tag == "body":
                self.body(copy, child, inherited)

    def _element(self, body: XmlElement, child: XmlElement, inherited: str) -> XmlElement:
        if self._defaults is None or child.tag == "inertial":
            return _shallow(body, child, self._gone)
        whole = XmlElement(child.tag, dict(self._defaults.attributes(child, inherited)))
        return _shallow(body, whole, self._gone | {"class"})

    def _joint(
        self, body: XmlElement, element: XmlElement, joint: MjcfJoint, inherited: str
    ) -> None:
        if joint.kind == FREE:
            body.add("freejoint", {"name": joint.name})
            return
        copy = self._element(body, element, inherited)
        copy.set("name", joint.name)
        # A range with lower above upper is not a limit.
        if "limited" not in self._gone and math.isinf(joint.limits[0]):
            copy.attributes.pop("range", None)
            copy.set("limited", "false")


def _state_inertia(body: XmlElement, compiled: RigidBody) -> None:
    """Write the inertia that another engine has compiled."""
    if compiled.mass:
        inertial = body.add("inertial", {"mass": repr(compiled.mass)})
        inertial.set("diaginertia", _words(compiled.inertia[:3]))
        _place(inertial, compiled.center, compiled.inertia_quaternion)


def _place(element: XmlElement, position: Triple, turn: Quaternion | None) -> None:
    for key in POSE:
        element.attributes.pop(key, None)
    element.set("pos", _words(position))
    element.set("quat", _words(turn or ORIENTATIONS["quat"]))


def _words(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))


def _weightless(element: XmlElement) -> bool:
    """Return whether the element is an `<inertial>` without mass, which parsers refuse."""
    return element.tag == "inertial" and not any(finite_numbers(element.get("mass", "")) or [1.0])


def _default(parent: XmlElement, default: XmlElement, gone: set[str]) -> None:
    copy = parent.add("default", default.attributes)
    for child in default:
        if child.tag == "default":
            _default(copy, child, gone)
        elif child.tag in ("joint", "geom"):
            _shallow(copy, child, gone)


def _shallow(parent: XmlElement, element: XmlElement, gone: set[str]) -> XmlElement:
    """Copy the element without its children, with the attributes that matter here."""
    wanted = set(_KEPT[element.tag]) - gone
    kept = {key: text for key, text in element.attributes.items() if key in wanted}
    for key in ("damping", "armature"):
        if key in kept:
            kept[key] = kept[key].split()[0]  # zeros follow
    return parent.add(element.tag, kept)
