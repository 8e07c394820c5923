"""A robot's tree as a system with equations."""

from __future__ import annotations

from physics_crosscheck.harness.documents.errors import ReadError
from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.mechanism.multibody import (
    MultibodySystem,
    TreeSystem,
    tree_system,
)
from physics_crosscheck.reference.mechanism.tree import Tree
from .inertias import impossible_links
from .robot import Robot


class RobotError(ValueError):
    """A robot that can't be checked; the message names file, line and remedy.

    Attributes:
        obstacles: the problems that prevent building the tree, each with its line.
        kind: of the first of them, or as given.
    """

    def __init__(
        self, message: str, obstacles: tuple[ReadError, ...] = (), kind: CaseKind = "robot"
    ) -> None:
        super().__init__(message)
        self.obstacles = obstacles
        self.kind: CaseKind = obstacles[0].kind if obstacles else kind


def robot_system(robot: Robot) -> TreeSystem:
    """Return a system with the robot's joints as coordinates.

    Raises:
        RobotError: with all problems that prevent it, or the joints that are not covered.
    """
    if robot.tree is None:
        raise _refused(robot)
    if not robot.tree.links:
        still = "it has no joint that moves, and no free mass; add a joint"
        raise RobotError(f"{robot.file}: {still}", kind="no joint")
    return tree_system(
        name=robot.name, title=summary(robot), source=str(robot.file), tree=robot.tree
    )


def _refused(robot: Robot) -> RobotError:
    """Return the error of a robot without a tree: links with an impossible inertia come first.

    With a negative mass or moment, that joints move no inertia is a consequence.
    """
    links = impossible_links(robot)
    is_negative = any(one.kind != "triangle" for one in links)
    others = (one for one in robot.obstacles if not (is_negative and one.kind == "massless"))
    problems = (*links, *others)
    return RobotError("; ".join(map(str, problems)), problems)


def robot_bodies(robot: Robot) -> MultibodySystem:
    """Return the bodies of a robot, as a declaration has them.

    Raises:
        RobotError: as `robot_system`.
    """
    system, read = robot_system(robot), robot.body_model
    assert read is not None  # it has a tree
    return MultibodySystem(
        name=system.name,
        title=system.title,
        source=system.source,
        gravity=read.gravity,
        bodies=read.bodies,
        pulls=read.pulls,
        couplings=read.couplings,
        fluid=read.fluid,
    )


def names_of(tree: Tree) -> tuple[str, ...]:
    """Return the names of its coordinates, which engines use too, (nv,)."""
    return tuple(name for link in tree.links for name, _ in coordinate_names(link.kind, link.name))


def summary(robot: Robot) -> str:
    """Return a summary such as: 7 joints, 8 links in 7 bodies, 21.4 kg."""
    count = 0 if robot.tree is None else len(robot.tree.links)
    mass = f"{sum(part.link.mass for part in robot.parts):.4g} kg"
    mass = "without masses" if has_stand_ins(robot.file) else mass
    links = counted(len(robot.parts), "link")
    bodies = counted(count, "body", "bodies")
    return f"{counted(count, 'joint')}, {links} in {bodies}, {mass}"
