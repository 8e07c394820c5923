"""A URDF for engines: refusal by line, Gazebo's joint springs, mimic joints, ignored elements.

Files are refused that engines read differently or crash on. PyBullet ends its process with a
segmentation fault on two root links, on a link with two parents, on a cycle and on a duplicate
joint name. It reads "abc" as 0, "1,5" as 1, and the first of two elements, which MuJoCo refuses
even if they are equal. MuJoCo accepts two root links, and treats a duplicate joint name as no name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Sample
from physics_crosscheck.harness.engines.remark import Remark, limit_remarks
from physics_crosscheck.harness.engines.source import (
    XmlSource,
    finite_numbers,
    read_source,
    read_xml,
)

_COUNTS = {
    **dict.fromkeys((("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")), 3),
    **{("inertia", key): 1 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")},
    **{("limit", key): 1 for key in ("lower", "upper", "velocity", "effort")},
    **{("dynamics", key): 1 for key in ("damping", "friction")},
    **{("mimic", key): 1 for key in ("multiplier", "offset")},
    ("mass", "value"): 1,
}
"""How many numbers an attribute has."""

_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""Elements that may occur once."""


def check_urdf(source: XmlSource) -> None:
    """Refuse a file that is not an unambiguous URDF.

    Raises:
        EngineError: naming file and line.
    """
    root = source.root
    if root.tag != "robot":
        raise source.refused(root, f"the root is <{root.tag}>, not <robot>: not a URDF")
    for element in (*root.findall("link"), *root.findall("joint")):
        for part in element.iter():
            _check_numbers(source, part)
            _check_once(source, part)
    for robot in root.findall("robot"):
        raise source.refused(robot, "every engine ignores a <robot> inside the <robot>")
    links = source.named(root.findall("link"), "link")
    joints = source.named(root.findall("joint"), "joint")
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        ends = [_end(source, joint, name, tag, links) for tag in ("parent", "child")]
        if ends[1] in parents:
            raise source.refused(joint, f"link {ends[1]!r} has a second parent, by joint {name!r}")
        parents[ends[1]] = ends[0]
        _check_joint(source, joint, name)
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        names = ", ".join(map(repr, roots))
        raise source.refused(
            links[roots[1]],
            f"it has {len(roots)} root links, {names}: every root except one needs a joint",
        )
    for name in links:
        if not _reaches_root(name, parents):
            raise source.refused(
                links[name], f"link {name!r} is its own ancestor through its joints"
            )


def _check_numbers(source: XmlSource, element: XmlElement) -> None:
    for key, words in element.attributes.items():
        count = _COUNTS.get((element.tag, key))
        if count is None:
            continue
        numbers = finite_numbers(words)
        if numbers is None or len(numbers) != count:
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise source.refused(element, f"<{element.tag} {key}> is {words!r}; expected {wanted}")


def _check_once(source: XmlSource, element: XmlElement) -> None:
    for tag in _ONCE.get(element.tag, ()):
        elements = element.findall(tag)
        for other in elements[1:]:
            if other.content != elements[0].content:
                raise source.refused(other, f"a second <{tag}> in one <{element.tag}>")


def _end(
    source: XmlSource, joint: XmlElement, name: str, tag: str, links: dict[str, XmlElement]
) -> str:
    end = joint.find(tag)
    link = "" if end is None else end.get("link", "")
    if link not in links:
        raise source.refused(joint, f"the {tag} of joint {name!r} is {link!r}, which is not a link")
    return link


def _check_joint(source: XmlSource, joint: XmlElement, name: str) -> None:
    axis, mimic = joint.find("axis"), joint.find("mimic")
    moves = joint.get("type") in ("revolute", "continuous", "prismatic")
    if moves and axis is not None and not any(finite_numbers(axis.get("xyz", "1 0 0")) or ()):
        raise source.refused(axis, f"the axis of joint {name!r} has no length")
    if mimic is not None and mimic.get("joint") == name:
        raise source.refused(mimic, f"joint {name!r} mimics itself")


def _reaches_root(name: str, parents: dict[str, str]) -> bool:
    """Return whether the chain of parents from a link ends."""
    for _ in range(len(parents) + 1):
        if name not in parents:
            return True
        name = parents[name]
    return False


SETTINGS: Mapping[str, object] = MappingProxyType({"step": 0.002, "gravity": [0.0, 0.0, -9.81]})
"""Settings of a URDF without a sidecar, which the format can't state."""


ROUNDED, VISIBLE_LENGTH_ERROR = 1e-15, 1e-9
"""Tolerances of an axis' length: for rounding of numbers, and for the digits of the file."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: joint = multiplier * leader + offset."""

    joint: str
    leader: str
    multiplier: float
    offset: float


def read_urdf(path: Path) -> XmlElement:
    """Return the `<robot>` of an unambiguous URDF.

    Raises:
        EngineError: naming file and line.
    """
    return read_urdf_source(path).root


def read_urdf_source(path: Path) -> XmlSource:
    """Parse an unambiguous URDF, with entity expansion off, as tolerantly as engines do.

    Raises:
        EngineError: naming file and line.
    """
    source = read_xml(read_source(path, tolerant=True), path)
    check_urdf(source)
    return source


def refuse_negative_masses(source: XmlSource, title: str, *, floats: bool) -> None:
    """Refuse links of negative mass, which some engines can't represent.

    Args:
        source: of a URDF.
        title: of the engine.
        floats: whether its root link moves; the mass of a fixed root has no effect.

    Raises:
        EngineError: naming file, line and link.
    """
    still = "" if floats else root_link(source.root)
    for link in source.root.findall("link"):
        mass = link.find("inertial/mass")
        if mass is None or link.get("name") == still:
            continue
        weight = float(mass.get("value", "0"))
        if weight < 0:
            raise source.refused(
                mass,
                f"the mass of link {link.get('name')!r} is below zero, {weight:g} "
                f"kg, and {title} can't build such a body; write a positive mass",
            )


def joint_springs(robot: XmlElement, path: Path) -> dict[str, tuple[float, float]]:
    """Return the stiffness and rest position of each joint with a spring, in Gazebo's convention.

    `<gazebo reference="joint"><springStiffness>k</springStiffness>
    <springReference>rest</springReference></gazebo>` (SDFormat 1.x, URDF extensions).
    """
    springs = {}
    for element in robot.findall("gazebo"):
        stiffness = element.find("springStiffness")
        if stiffness is None:
            continue
        joint = element.get("reference")
        if not joint:
            raise EngineError(f"{path}: a <gazebo> with <springStiffness> has no reference=")
        rest = element.find("springReference")
        springs[joint] = (
            _number(stiffness.text, f"{path}: <springStiffness> of joint {joint!r}"),
            0.0 if rest is None else _number(rest.text, f"{path}: <springReference> of {joint!r}"),
        )
    return springs


def mimics(robot: XmlElement, path: Path) -> list[Mimic]:
    """Return every `<mimic>` of the file."""
    result = []
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        name = joint.get("name", "")
        place = f"{path}: <mimic> of joint {name!r}"
        result.append(
            Mimic(
                name,
                mimic.get("joint", ""),
                _number(mimic.get("multiplier", "1"), f"{place}, multiplier"),
                _number(mimic.get("offset", "0"), f"{place}, offset"),
            )
        )
    return result


def _number(text: str | None, place: str) -> float:
    numbers = finite_numbers(text or "")
    if numbers is None or len(numbers) != 1:
        raise EngineError(f"{place} is {text!r}; expected a finite number")
    return numbers[0]


@dataclass(frozen=True, kw_only=True)
class UrdfReader:
    """The behaviour of an engine that reads a URDF.

    Attributes:
        name: the engine's, as in sidecars.
        no_inertial: its inertia of a moving link without `<inertial>`.
        equal_bounds: whether a joint with equal bounds is fixed there, not free.
        no_friction: its title, if it ignores joint friction.
        long_axes: its title, if it does not normalize joint axes.
        no_stops: its title, if it ignores position limits.
    """

    name: str
    no_inertial: str
    equal_bounds: bool = False
    no_friction: str = ""
    long_axes: str = ""
    no_stops: str = ""


def urdf_remarks(
    reader: UrdfReader, file: Path, joints: Sequence[str], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield remarks about a URDF in an engine along the states (z, w) of its joints."""
    robot = read_urdf(file)
    moved = {
        child.get("link")
        for joint in robot.findall("joint")
        if joint.get("type") != "fixed" and (child := joint.find("child")) is not None
    }
    for link in robot.findall("link"):
        name = link.get("name", "")
        if name in moved and link.find("inertial") is None:
            yield Remark(
                kind="inertial",
                message=(
                    f"link {name} moves and has no <inertial>: {reader.name} uses "
                    f"{reader.no_inertial}"
                ),
                fault=True,
                address=f"robot/link[{name}]",
            )
    for tag in ("transmission", "joint/safety_controller"):
        for _ in robot.findall(tag)[:1]:
            yield Remark(
                kind="ignored",
                message=(
                    f"<{tag.split('/')[-1]}> has no effect here: it neither drives nor "
                    "holds a joint"
                ),
                address="",
            )
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        if name in joints:
            i = joints.index(name)
            yield from _limits(reader, joint, z[:, i], w[:, i])
            yield from _friction(reader, joint)
            yield from _axis(reader, joint)


def _limits(reader: UrdfReader, joint: XmlElement, z: Array, w: Array) -> Iterator[Remark]:
    limit, name = joint.find("limit"), joint.get("name", "")
    if limit is None:
        return
    # Without both bounds no engine enforces the limit, though their defaults differ.
    if "lower" in limit.attributes and "upper" in limit.attributes:
        bounds = float(limit.attributes["lower"]), float(limit.attributes["upper"])
        yield from _bounds(reader, joint, bounds, (float(z.min()), float(z.max())))
    velocity, quick = float(limit.get("velocity", "inf")), float(abs(w).max())
    if quick >= velocity and joint.get("type") != "continuous":
        yield Remark(
            kind="joint limit",
            message=(
                f"<limit velocity> of {name} is {velocity:g} and the motions reach "
                f"{quick:.4g}; {reader.name} does not enforce it here"
            ),
            subject=(name, reader.name, "velocity limit"),
            address=f"robot/joint[{name}]",
            value=velocity,
        )


def _bounds(
    reader: UrdfReader, joint: XmlElement, bounds: tuple[float, float], reached: tuple[float, float]
) -> Iterator[Remark]:
    (lower, upper), name = bounds, joint.get("name", "")
    if reader.no_stops:
        return
    why = _why_ignored(reader, joint.get("type") == "continuous", lower, upper)
    if why:
        yield Remark(
            kind="empty limit",
            message=f"the limits [{lower:g}, {upper:g}] of {name} have no effect: {why}",
            address=f"robot/joint[{name}]/limit",
        )
    elif joint.get("type") != "continuous":
        yield from limit_remarks(
            name, bounds=bounds, reached=reached, address=f"robot/joint[{name}]"
        )


def _why_ignored(reader: UrdfReader, continuous: bool, lower: float, upper: float) -> str:
    """Return why limits have no effect; empty if they have one, or state nothing."""
    if continuous:
        return "it is continuous" if lower or upper else ""
    if lower > upper:
        return "the lower is above the upper"
    held = lower < upper or reader.equal_bounds
    return "" if held else f"{reader.name} ignores equal limits, so the joint is free"


def _axis(reader: UrdfReader, joint: XmlElement) -> Iterator[Remark]:
    axis, name = joint.find("axis"), joint.get("name", "")
    stated = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
    length = math.hypot(*(finite_numbers(stated) or ()))
    if reader.long_axes and abs(length - 1) > ROUNDED:
        yield Remark(
            message=(
                f"the axis of {name} has the length {length:.15g}: {reader.long_axes} "
                "does not normalize it, and accelerates a hinge by so much less"
            ),
            subject=(name, reader.name, "axis length"),
            fault=abs(length - 1) > VISIBLE_LENGTH_ERROR,
            address=f"robot/joint[{name}]/axis@xyz",
            value=length,
        )


def _friction(reader: UrdfReader, joint: XmlElement) -> Iterator[Remark]:
    dynamics, name = joint.find("dynamics"), joint.get("name", "")
    friction = float(dynamics.get("friction", "0")) if dynamics is not None else 0.0
    if friction and reader.no_friction:
        yield Remark(
            kind="dry friction",
            message=f"<dynamics friction> of {name} is {friction:g}; {reader.no_friction} ignores"
            " it",
            subject=(name, reader.name, "friction"),
            fault=True,
            address=f"robot/joint[{name}]",
            value=friction,
        )


def root_link(robot: XmlElement) -> str:
    """Return the name of the root link."""
    children = {child.get("link") for child in robot.findall("joint/child")}
    links = [link.get("name", "") for link in robot.findall("link")]
    return next((link for link in links if link not in children), "")


def base_name(robot: XmlElement) -> str:
    """Return the name of a floating root's free joint: the root link's, unless a joint has it."""
    name = root_link(robot)
    joints = {joint.get("name") for joint in robot.findall("joint")}
    while name in joints:
        name += "_free"
    return name


URDF_NON_PHYSICAL: Mapping[str, str] = MappingProxyType(
    {
        r".*/(visual|material)/.*": "visual geometry",
        r".*/collision/.*": "collision shapes",
        r"robot/link/contact/.*": "contact parameters",
        r"robot/gazebo/(mu|kp|kd|fdir|maxVel|minDepth)\w*": "contact parameters",
        r".*/limit@(lower|upper)": "joint limits",
        r".*/limit@velocity": "velocity limits",
        r".*/limit@.*": "actuator limits",
        r".*/safety_controller@.*": "safety limits",
        r".*/(dynamics|joint_properties)@friction": "dry friction",
        r"robot/(.*/)?(transmission|actuator)/.*": "transmissions",
        r".*/sensor/.*": "sensors",
        r"robot/joint/mimic@.*": "joint couplings",
        r"robot/gazebo/(?!spring(Stiffness|Reference)).*": "Gazebo extensions",
        r"robot/(?!link/inertial/|joint/(origin|axis|dynamics)@|gazebo/).*": "elements not read",
    }
)
"""Numbers of a URDF that need not affect a smooth motion, by purpose."""

_SAMPLE = """<robot name="sample">
<link name="ground"><inertial><mass value="1"/>{inertia}</inertial></link>
<link name="a"><inertial><mass value="2"/>{inertia}</inertial></link>
<link name="b"><inertial><origin xyz="0 0 -0.5"/><mass value="0.7"/>{inertia}</inertial></link>
<joint name="q1" type="prismatic"><parent link="ground"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-1e6" upper="1e6" effort="0" velocity="0"/><dynamics damping="1.5"/></joint>
<joint name="q2" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/>
<dynamics damping="0.1"/></joint>
<gazebo reference="q1"><springStiffness>50</springStiffness></gazebo></robot>
"""


def sample_urdf() -> Sample:
    """Return a pendulum on a slide with a spring and a damper."""
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    settings = {**SETTINGS, "step": 0.004}
    return Sample(file="sample.urdf", text=_SAMPLE.format(inertia=inertia), settings=settings)
