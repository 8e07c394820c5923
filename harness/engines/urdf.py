"""What the adapters read from a URDF themselves: Gazebo's joint springs, and mimic joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import defusedxml.ElementTree
from defusedxml import DefusedXmlException

from harness.engines.protocol import EngineError


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: joint = multiplier * leader + offset."""

    joint: str
    leader: str
    multiplier: float
    offset: float


def read_urdf(text: str, path: Path) -> ET.Element:
    """Parse a URDF, entity expansion off.

    Raises:
        EngineError: naming file and line.
    """
    try:
        robot: ET.Element = defusedxml.ElementTree.fromstring(text, forbid_dtd=True)
    except ET.ParseError as error:
        line, column = error.position
        raise EngineError(f"{path}:{line}: no XML at column {column}: {error.msg}") from None
    except DefusedXmlException as error:
        raise EngineError(f"{path}: refused: it declares entities or a DTD ({error})") from None
    if robot.tag != "robot":
        raise EngineError(f"{path}:1: the root is <{robot.tag}>, not <robot>: no URDF")
    return robot


def joint_springs(robot: ET.Element, path: Path) -> dict[str, tuple[float, float]]:
    """Stiffness and rest position of each joint with a spring, in Gazebo's convention.

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


def mimics(robot: ET.Element, path: Path) -> list[Mimic]:
    """Every `<mimic>` of the file."""
    found = []
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        name = joint.get("name", "")
        place = f"{path}: <mimic> of joint {name!r}"
        found.append(
            Mimic(
                name,
                mimic.get("joint", ""),
                _number(mimic.get("multiplier", "1"), f"{place}, multiplier"),
                _number(mimic.get("offset", "0"), f"{place}, offset"),
            )
        )
    return found


def _number(text: str | None, place: str) -> float:
    try:
        return float(text or "")
    except ValueError:
        raise EngineError(f"{place} is {text!r}, where a number belongs") from None
