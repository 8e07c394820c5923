"""A URDF for engines: its links and joints, and remarks about ignored elements.

Ambiguous files are refused. PyBullet ends its process with a segmentation fault on two root links,
on a link with two parents, on a cycle and on a duplicate joint name. It reads "abc" as 0 and "1,5"
as 1. MuJoCo accepts two root links, and treats a duplicate joint name as no name. Of two equal or
different elements, such as `<axis>`, MuJoCo refuses the second, and all others take the first.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.read import SdfFile
from physics_crosscheck.harness.documents.urdf import UrdfFile, UrdfJoint, read_urdf
from .protocol import Array, Sample
from .remark import Remark, friction_remark, limit_remarks
from .source import read_document, refuse_problems, refused

SETTINGS: Mapping[str, object] = MappingProxyType({"step": 0.002, "gravity": [0.0, 0.0, -9.81]})
"""Settings of a URDF without a sidecar, which the format can't state."""


ROUNDED, VISIBLE_LENGTH_ERROR = 1e-15, 1e-9
"""Tolerances of an axis' length: for rounding of numbers, and for the digits of the file."""


def load_urdf(path: Path) -> UrdfFile:
    """Read a URDF, as tolerantly as engines do.

    Raises:
        EngineError: for an invalid or ambiguous file; names file, line and remedy.
    """
    file = read_urdf(read_document(path))
    refuse_problems(file.document, unsupported=False)
    return file


def refuse_negative_masses(file: UrdfFile | SdfFile, title: str, *, floats: bool) -> None:
    """Refuse links of negative mass, which some engines can't represent.

    Args:
        file: the content of a file.
        title: of the engine.
        floats: whether its root link moves; the mass of a fixed root has no effect.

    Raises:
        EngineError: naming file, line and link.
    """
    for name, link in file.links.items():
        if link.body.mass < 0 and (floats or name != file.root):
            raise refused(
                link.element.find("inertial/mass") or link.element,
                f"the mass of link {name!r} is below zero, {link.body.mass:g} "
                f"kg, and {title} can't build such a body; write a positive mass",
            )


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
        stops_turns: its title, if it applies the limits of continuous joints.
        positive_limits: its title, if it fails for an effort or velocity below zero.
    """

    name: str
    no_inertial: str
    equal_bounds: bool = False
    no_friction: str = ""
    long_axes: str = ""
    no_stops: str = ""
    stops_turns: str = ""
    positive_limits: str = ""

    def refuse_limits(self, file: UrdfFile | SdfFile) -> None:
        """Refuse an effort or a velocity below zero if the engine can't represent it.

        Raises:
            EngineError: naming file, line and joint.
        """
        for name, joint in file.joints.items() if self.positive_limits else ():
            limit = joint.element.find("limit")
            for key in ("effort", "velocity"):
                if limit is not None and float(limit.get(key, "0")) < 0:
                    raise refused(
                        limit,
                        f"the {key} of joint {name!r} is {limit.get(key)}, and "
                        f"{self.positive_limits} refuses limits below zero; write a positive one",
                    )


def urdf_remarks(
    reader: UrdfReader, file: UrdfFile, joints: Sequence[str], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield remarks about a URDF in an engine along the states (z, w) of its joints."""
    robot = file.document.root
    moved = {one.child for one in file.joints.values() if one.element.get("type") != "fixed"}
    for name, link in file.links.items():
        if name in moved and link.element.find("inertial") is None:
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
    for name, joint in file.joints.items():
        if name in joints:
            i = joints.index(name)
            yield from _limits(reader, joint.element, z[:, i], w[:, i])
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
    if quick >= velocity >= 0 and joint.get("type") != "continuous":
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
    turns = joint.get("type") == "continuous"
    if turns and reader.stops_turns and lower <= upper:
        yield Remark(
            kind="joint limit",
            message=(
                f"{name} is continuous, but {reader.stops_turns} applies its limits:"
                f" [{lower:g}, {upper:g}]"
            ),
            fault=True,
            address=f"robot/joint[{name}]/limit",
        )
    elif why := _why_ignored(reader, turns, lower, upper):
        yield Remark(
            kind="empty limit",
            message=f"the limits [{lower:g}, {upper:g}] of {name} have no effect: {why}",
            address=f"robot/joint[{name}]/limit",
        )
    elif not turns:
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


def _axis(reader: UrdfReader, joint: UrdfJoint) -> Iterator[Remark]:
    length = math.hypot(*joint.axis)
    if reader.long_axes and abs(length - 1) > ROUNDED:
        yield Remark(
            message=(
                f"the axis of {joint.name} has the length {length:.15g}: {reader.long_axes} "
                "does not normalize it, and accelerates a hinge by so much less"
            ),
            subject=(joint.name, reader.name, "axis length"),
            fault=abs(length - 1) > VISIBLE_LENGTH_ERROR,
            address=f"robot/joint[{joint.name}]/axis@xyz",
            value=length,
        )


def _friction(reader: UrdfReader, joint: UrdfJoint) -> Iterator[Remark]:
    if joint.friction and reader.no_friction:
        yield friction_remark(
            "<dynamics friction>",
            joint.name,
            joint.friction,
            reader.no_friction,
            f"robot/joint[{joint.name}]",
        )


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
