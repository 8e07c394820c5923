"""An SDFormat file for engines: one model, its links and joints, and its couplings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf import WORLD
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Sample
from physics_crosscheck.harness.engines.remark import Remark, limit_remarks
from physics_crosscheck.harness.engines.sdf_check import CheckedJoint, check_sdf
from physics_crosscheck.harness.engines.source import (
    XmlSource,
    finite_numbers,
    read_source,
    read_xml,
)
from physics_crosscheck.harness.engines.urdf import Mimic, UrdfReader

ENDLESS = 1e16
"""The format's value for a missing bound, rad or m."""

Bounds = Mapping[str, tuple[float, float]]
"""Bounds of joints, by name."""


@dataclass(frozen=True)
class SdfFile:
    """An SDFormat file with one unambiguous model.

    Attributes:
        source: its elements with lines.
        model: the model.
        world: the world that contains it, or None.
        joints: by name; parents and children are links.
    """

    source: XmlSource
    model: XmlElement
    world: XmlElement | None
    joints: Mapping[str, CheckedJoint]

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Names of links, in the file's order."""
        return tuple(link.get("name", "") for link in self.model.findall("link"))

    @property
    def root(self) -> str:
        """The root link, or `world` if every link has a parent."""
        children = {joint.child for joint in self.joints.values()}
        return next((name for name in self.links if name not in children), WORLD)

    @property
    def settings(self) -> dict[str, object]:
        """The file's step and gravity, and whether its root moves freely."""
        result: dict[str, object] = {"floating": self.root != WORLD}
        if self.world is None:
            return result
        for key, tag in (("step", "physics/max_step_size"), ("gravity", "gravity")):
            numbers = finite_numbers(self.world.findtext(tag))
            if numbers:
                result[key] = numbers if key == "gravity" else numbers[0]
        return result

    @property
    def mimics(self) -> tuple[Mimic, ...]:
        """Joints that follow others: multiplier * (leader - reference) + offset."""
        parsed = (mimic_of(joint.element) for joint in self.joints.values())
        return tuple(one for one in parsed if one is not None)

    @property
    def bounds(self) -> Bounds:
        """Position limits of the file."""
        result = {}
        for joint in self.joints.values():
            limit = joint.element.find("axis/limit")
            if limit is None or joint.kind == "continuous":
                continue
            lower, upper = number(limit, "lower", -ENDLESS), number(limit, "upper", ENDLESS)
            if lower < upper and (lower > -ENDLESS or upper < ENDLESS):
                ends = (lower, -ENDLESS, -float("inf")), (upper, ENDLESS, float("inf"))
                low, high = (end if one in (none, end) else one for one, none, end in ends)
                result[joint.name] = (low, high)
        return result


def read_sdf(path: Path, model: object = "") -> SdfFile:
    """Parse an SDFormat file, with entity expansion off.

    Args:
        path: of the file.
        model: the setting that selects one of several moving models; empty for a single one.

    Raises:
        EngineError: naming file and line.
    """
    if not isinstance(model, str):
        raise EngineError(f"{path}.toml: [settings] model is {model!r}; expected a name")
    source = read_xml(read_source(path, tolerant=True), path)
    return SdfFile(source, *check_sdf(source, model))


def mimic_of(joint: XmlElement) -> Mimic | None:
    """Return the mimic of a joint, or None."""
    mimic = joint.find("axis/mimic")
    if mimic is None:
        return None
    ratio, offset = number(mimic, "multiplier", 1.0), number(mimic, "offset", 0.0)
    offset -= ratio * number(mimic, "reference", 0.0)
    return Mimic(joint.get("name", ""), mimic.get("joint", ""), ratio, offset)


def number(element: XmlElement, tag: str, default: float) -> float:
    """Return the number of a child that has been checked."""
    text = element.findtext(tag)
    return float(text) if text.strip() else default


def sdf_remarks(
    file: SdfFile, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield remarks about an SDFormat file along the states (z, w) of its joints."""
    for link in file.model.findall("link"):
        name = link.get("name", "")
        if link.find("inertial") is None:
            yield Remark(
                kind="inertial",
                message=(
                    f"link {name} has no <inertial>: the format, and {reader.name}, use "
                    "1 kg and 1 kg m^2"
                ),
                address=f"model/link[{name}]",
            )
    for name in joints:
        if name not in file.joints:
            continue
        i, element = joints.index(name), file.joints[name].element
        if not reader.no_stops and name in file.bounds:
            yield from limit_remarks(
                name,
                bounds=file.bounds[name],
                reached=(float(z[:, i].min()), float(z[:, i].max())),
                address=f"model/joint[{name}]",
            )
        dynamics = element.find("axis/dynamics")
        friction = 0.0 if dynamics is None else number(dynamics, "friction", 0.0)
        if friction and reader.no_friction:
            yield Remark(
                kind="dry friction",
                message=f"<friction> of {name} is {friction:g}; {reader.no_friction} ignores it",
                subject=(name, reader.name, "friction"),
                fault=True,
                address=f"joint[{name}]/axis/dynamics/friction",
                value=friction,
            )


SDF_NON_PHYSICAL: Mapping[str, str] = MappingProxyType(
    {
        r".*/(visual|material|light|scene|gui)/.*": "visual geometry",
        r".*/collision/(.*/)?surface/.*": "contact parameters",
        r".*/collision/.*": "collision shapes",
        r".*/limit/(lower|upper)": "joint limits",
        r".*/limit/velocity": "velocity limits",
        r".*/limit/effort": "actuator limits",
        r".*/limit/.*": "softness of joint limits",
        r".*/dynamics/friction": "dry friction",
        r".*/sensor/.*": "sensors",
        r".*/plugin/.*": "plugins",
        r"sdf@version": "format version",
        r".*/physics/(max_step_size|real_time.*)": "time step",
        r".*/physics/.*": "solver settings",
    }
)
"""Numbers of an SDFormat file that need not affect a smooth motion, by purpose."""

_INERTIA = "<inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia>"
_SAMPLE = f"""<sdf version="1.6"><world name="here"><gravity>0 0 -9.81</gravity>
<physics name="slow" type="ode"><max_step_size>0.004</max_step_size></physics>
<model name="sample">
<link name="a"><inertial><mass>2</mass>{_INERTIA}</inertial></link>
<link name="b"><pose>0 0 0.1 0 0 0</pose><inertial><pose>0 0 -0.5 0 0 0</pose><mass>0.7</mass>
{_INERTIA}</inertial></link>
<joint name="q1" type="prismatic"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz>
<limit><lower>-1e16</lower><upper>1e16</upper></limit><dynamics><damping>1.5</damping></dynamics>
</axis></joint>
<joint name="q2" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 -1 0</xyz>
<limit><lower>-1e16</lower><upper>1e16</upper></limit><dynamics><damping>0.1</damping></dynamics>
</axis></joint></model></world></sdf>
"""


def sample_sdf() -> Sample:
    """Return a pendulum on a damped slide, with its own step and gravity."""
    return Sample(file="sample.sdf", text=_SAMPLE)
