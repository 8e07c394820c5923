"""A robot's file, read by its suffix: its tree and its numbers."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.documents.errors import ReadError
from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.engines.protocol import Spring
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.assemble import (
    MultibodySystem,
    TreeSystem,
    assemble,
    tree_system,
)
from physics_crosscheck.reference.mechanism.bodies import ForceElement
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeError
from .folders import FORMATS
from .inertias import impossible_links
from .numbers import ModelFile
from .robot import LOCKED, Omission, Robot, home_of


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
        first = obstacles[0].kind if obstacles else kind
        self.kind: CaseKind = "robot" if first == "not finite" else first


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
    """Return a summary such as: 7 joints, 8 links in 7 bodies, 21.4 kg, root held."""
    count = 0 if robot.tree is None else len(robot.tree.links)
    mass = f"{sum(part.link.mass for part in robot.parts):.4g} kg"
    mass = "without masses" if has_stand_ins(robot.file) else mass
    links = counted(len(robot.parts), "link")
    bodies = counted(count, "body", "bodies")
    shaped = {one.body for one in robot.placed}
    heavy = [one for one in robot.parts if one.body == WORLD and one.link.mass > 0]
    held = any(one.name in shaped for one in heavy)
    root = ", root free" if robot.floats else ", root held" if held else ""
    root = root if robot.file.suffix == ".urdf" else ""
    selection = f", {robot.selection}" if robot.selection else ""
    return f"{counted(count, 'joint')}, {links} in {bodies}, {mass}{root}{selection}"


FOLLOWERS = "joints that follow others"
"""Omission of couplings that a setting releases."""


def _reader(file: Path) -> Any:
    """Return the package of a file's suffix, as in `FORMATS`; an engine compiles unknown ones."""
    return import_module(f"{__package__}.{FORMATS.get(file.suffix, FORMATS['.xml']).package}")


def read_robot(file: Path, *, floating: bool | None = None, model: str = "") -> Robot:
    """Read a robot's file, by its suffix.

    Args:
        file: the model file.
        floating: whether the root link of a URDF moves freely, which an SDFormat file states; None:
            if it stands on legs or wheels, or flies.
        model: name of one of several models of an SDFormat file; empty for a single moving one.
    """
    robot: Robot = _reader(file).read(file, {"floating": floating, "model": model})
    return robot


def read_as_it_runs(
    file: Path, settings: Mapping[str, object], springs: Sequence[Spring] = ()
) -> Robot:
    """Read a robot's file with the settings of an engine, and the springs of a sidecar.

    Joints named by `held` are fixed where the file draws them. Without `couplings`, followers move
    freely; without `actuators`, no actuator acts.
    """
    robot: Robot = _reader(file).read(file, settings)
    held = settings.get("held")
    names = held if isinstance(held, list) else []
    released = not settings.get("couplings", True)
    if not (names or springs or (released and robot.tree and robot.tree.couplings)):
        return robot
    try:
        return _changed(robot, names, springs, released=released)
    except TreeError:
        return replace(robot, tree=None)


def hold_joints(robot: Robot, names: tuple[str, ...]) -> Robot:
    """Return a robot whose named joints are fixed where the file draws them, and listed."""
    left_out = (*robot.left_out, Omission(what=LOCKED, count=len(names), where=names))
    held = _changed(robot, names, (), released=False)
    return replace(held, held=(*robot.held, *names), left_out=left_out)


def _changed(
    robot: Robot, names: Collection[str], springs: Sequence[Spring], *, released: bool
) -> Robot:
    """Return a robot with joints fixed, springs added, and couplings released."""
    model = robot.body_model
    if robot.tree is None or model is None:
        return robot
    kept = model.without(names)
    pulls = (*kept.pulls, *(_force_element(f"spring[{i}]", one) for i, one in enumerate(springs)))
    couplings = () if released else kept.couplings
    whole = assemble(replace(kept, pulls=pulls, couplings=couplings))
    count = len(model.couplings) if released else 0
    free = (Omission(what=FOLLOWERS, count=count, where=()),) if count else ()
    return replace(
        robot,
        tree=whole.tree,
        parts=tuple(replace(one, body=whole.tree.frames[one.name][0]) for one in robot.parts),
        limits=whole.limits,
        home=home_of(whole.tree, whole.limits),
        left_out=(*free, *robot.left_out),
    )


def _force_element(name: str, spring: Spring) -> ForceElement:
    return ForceElement(
        name=name,
        joints=tuple((joint, float(share)) for joint, share in spring.joints.items()),
        stiffness=float(spring.stiffness),
        damping=float(spring.damping),
        rest=(float(spring.rest), float(spring.rest)),
    )


def robot_numbers(file: Path, settings: Mapping[str, object]) -> ModelFile:
    """Return the numbers of a robot's file that has a tree, by its suffix.

    Args:
        file: the model file.
        settings: of the engines that run it.

    Raises:
        RobotError: if no installed engine compiles the file.
    """
    numbers: ModelFile = _reader(file).numbers(file, settings)
    return numbers
