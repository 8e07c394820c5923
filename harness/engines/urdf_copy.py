"""A URDF rewritten for an engine to load: the user's own file stays as it is."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from harness.engines.protocol import EngineError
from harness.engines.source import written

Change = Callable[[ET.Element], None]
"""Of a `<robot>`, in place."""


@contextmanager
def rewritten(robot: ET.Element | None, path: Path, changes: Sequence[Change]) -> Iterator[Path]:
    """A copy of a URDF with changes, gone afterwards; without any, the file itself.

    Relative names of files are made absolute.
    """
    if robot is None or not changes:
        yield path
        return
    robot = changed(robot, changes)
    for element in robot.iter():
        name = element.get("filename", "")
        if name and "://" not in name and (path.parent / name).is_file():
            element.set("filename", str((path.parent / name).resolve()))
    with written(robot, path) as file:
        yield file


def changed(robot: ET.Element, changes: Sequence[Change]) -> ET.Element:
    """A copy of a `<robot>` with changes."""
    robot = copy.deepcopy(robot)
    for change in changes:
        change(robot)
    return robot


def without_shapes(robot: ET.Element) -> None:
    """Leave out what is seen and what touches: neither they nor their meshes are looked for."""
    without_looks(robot)
    _without(robot, "collision")


def without_looks(robot: ET.Element) -> None:
    """Leave out what is seen."""
    _without(robot, "visual")
    for material in robot.findall("material"):
        robot.remove(material)


def _without(robot: ET.Element, tag: str) -> None:
    for link in robot.findall("link"):
        for shape in link.findall(tag):
            link.remove(shape)


def with_masses(robot: ET.Element) -> None:
    """Give links whose mass is 0 one that no digit of a motion shows."""
    for inertial in robot.findall("link/inertial"):
        mass = inertial.find("mass")
        if mass is not None and float(mass.get("value", "0")) == 0:
            mass.set("value", "1e-300")


def without_limits(robot: ET.Element) -> None:
    """Limits that PyBullet takes for none: the lower one above the upper."""
    for joint in robot.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic", "spherical"):
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", "1")
            limit.set("upper", "-1")


def without_bounds(robot: ET.Element) -> None:
    """No limits of positions at all."""
    for limit in robot.findall("joint/limit"):
        for key in ("lower", "upper"):
            limit.attrib.pop(key, None)


def without_friction(robot: ET.Element) -> None:
    """No dry friction of joints."""
    for dynamics in robot.findall("joint/dynamics"):
        dynamics.set("friction", "0")


def without_crossed_bounds(robot: ET.Element) -> None:
    """No limits whose lower is above their upper, which most engines take for none."""
    for limit in robot.findall("joint/limit"):
        if float(limit.get("lower", "-inf")) > float(limit.get("upper", "inf")):
            del limit.attrib["lower"], limit.attrib["upper"]


def with_held(names: Sequence[str]) -> Change:
    """Make joints stand still at zero, and forget what pulls at them."""

    def hold(robot: ET.Element) -> None:
        for joint in robot.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
        for element in robot.findall("gazebo"):
            if element.get("reference") in names:
                robot.remove(element)

    return hold


def mimics_of(followers: Collection[str]) -> Change:
    """Let all joints that follow others move on their own, but for these."""

    def change(robot: ET.Element) -> None:
        for joint in robot.findall("joint"):
            for mimic in joint.findall("mimic") if joint.get("name") not in followers else ():
                joint.remove(mimic)

    return change


def followers_of(settings: Mapping[str, object], place: str) -> Collection[str] | None:
    """Of the setting `couplings`: the joints that follow others; None for all that the file says.

    Raises:
        EngineError: where it is neither true, nor false, nor a list of names.
    """
    given = settings.get("couplings", True)
    if isinstance(given, bool):
        return None if given else ()
    if isinstance(given, list) and all(isinstance(one, str) for one in given):
        return given
    raise EngineError(
        f"{place}: [settings] couplings is {given!r}, where true, false or a list of the joints"
        " that follow others belongs"
    )
