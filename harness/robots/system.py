"""A robot's tree as a system whose equations can be asked."""

from __future__ import annotations

from harness.robots.robot import Robot
from reference.declaration import Coordinate
from reference.trees import TreeSystem

UNITS = {"hinge": "rad", "slide": "m"}


class RobotError(ValueError):
    """A robot that can't be checked; the message names file, line and remedy."""


def robot_system(robot: Robot) -> TreeSystem:
    """The robot's joints as coordinates.

    Raises:
        RobotError: with all that is in the way, or the joints that are not covered.
    """
    if robot.tree is None:
        raise RobotError("; ".join(map(str, robot.obstacles)))
    links = robot.tree.links
    if not links:
        raise RobotError(f"{robot.file}: it has no joint that moves, so there is nothing to check")
    if others := [link.name for link in links if link.kind not in UNITS]:
        raise RobotError(
            f"{robot.file}: {', '.join(others)}: ball and free joints are not covered yet"
        )
    return TreeSystem(
        name=robot.name,
        title=summary(robot),
        source=str(robot.file),
        coordinates=tuple(Coordinate(k.name, UNITS[k.kind], f"joint {k.name}") for k in links),
        constants=(),
        inputs=(),
        outputs=(),
        T=0,
        V=0,
        D=0,
        equilibria=(),
        scenarios=(),
        published=(),
        tree=robot.tree,
    )


def summary(robot: Robot) -> str:
    """Such as: 7 joints, 8 links in 7 bodies, 21.4 kg."""
    count = 0 if robot.tree is None else len(robot.tree.links)
    mass = sum(part.mass for part in robot.parts)
    joints = "1 joint" if count == 1 else f"{count} joints"
    return f"{joints}, {len(robot.parts)} links in {count} bodies, {mass:.4g} kg"
