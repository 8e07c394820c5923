"""Create a system folder from a model file: from short energies, else from its bodies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.commands.scaffold.folder import NewError, write_folder
from physics_crosscheck.harness.commands.scaffold.from_energies import (
    STEP,
    Energies,
    format_settings,
)
from physics_crosscheck.harness.commands.scaffold.from_tree import from_tree
from physics_crosscheck.harness.commands.scaffold.text import plain
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.modelfiles.formats import FORMATS
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_sources import source_file
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import odd_name, visible
from physics_crosscheck.reference.mechanism.declaration import DeclarationError

MOST_JOINTS = 3
"""Maximum number of joints for formulas; above, they take minutes and are not attempted."""

MOST_OPERATIONS = 1500
"""Maximum operations in T and V as declared; the equations of motion then take ten seconds."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """A written folder.

    Attributes:
        declares: what `system.py` declares, and why.
        remarks: further remarks to print.
    """

    declares: str
    remarks: tuple[str, ...]


def from_model(model: Path, target: Path, *, floating: bool = False, chosen: str = "") -> Written:
    """Write the folder of a model file.

    Nothing is written if no engine agrees with the equations that were read.

    Args:
        model: the file.
        target: the folder to write.
        floating: whether the root link of a URDF moves freely.
        chosen: name of one of several models of an SDFormat file; empty: the only movable one.

    Raises:
        NewError: naming file, line and the unreadable part.
    """
    try:
        model = source_file(str(model)) or model
    except FolderError as error:
        raise NewError(str(error)) from None
    if model.suffix not in FORMATS:
        raise NewError(
            f"{model}: unknown kind of model file; use a URDF (.urdf), an SDFormat "
            "file (.sdf) or an MJCF (.xml)"
        )
    if (why := odd_name(model.name)) is not None:
        raise NewError(f"{visible(str(model))}: its name has {why}; rename it")
    try:
        data = read_regular(model)
    except OSError as error:
        raise NewError(f"{model}: can't be read: {error.strerror}") from None
    robot = read_robot(model, floating=floating, model=chosen)
    if robot.tree is None:
        raise NewError("; ".join(map(str, robot.obstacles)))
    energies = _energies(robot, data, target)
    if isinstance(energies, Energies):
        write_folder(target, energies.files, energies.check)
        reason = (
            f"energies: {counted(energies.operations, 'operation')} in T and V, of {_joints(robot)}"
        )
        return Written(declares=reason, remarks=tuple(energies.remarks))
    settings = _default_settings(robot) if model.suffix == ".sdf" else format_settings(model.suffix)
    remarks = from_tree(robot, data, target, settings)
    return Written(declares=f"bodies instead of energies: {energies}", remarks=remarks)


def _default_settings(robot: Robot) -> list[str]:
    """Return sidecar settings for values that an SDFormat file states in its world."""
    assert robot.body_model is not None
    ordinary = {"step": STEP, "gravity": list(robot.body_model.gravity)}
    missing = [f"{key} = {value}" for key, value in ordinary.items() if key not in robot.stated]
    if not missing:
        return []
    return [f"# No world in {plain(robot.file.name)} states this.", "[settings]", *missing, ""]


def _energies(robot: Robot, data: bytes, target: Path) -> Energies | str:
    """Return the folder of a mechanism's energies, or why there are no short energies."""
    if why := _too_much(robot):
        return why
    try:
        energies = Energies(robot.file, data, target)
        if energies.operations > MOST_OPERATIONS:
            return (
                f"T and V have {energies.operations} operations; more than "
                f"{MOST_OPERATIONS} are too many"
            )
        energies.plan()
    except (NewError, DeclarationError) as error:
        return str(error)
    return energies


def _too_much(robot: Robot) -> str:
    """Return the part of a robot that prevents formulas of energies; empty if they are possible."""
    assert robot.tree is not None
    if robot.file.suffix == ".sdf":
        return "energies of an SDFormat file are not supported"
    links = robot.tree.links
    if len(links) > MOST_JOINTS:
        return f"it has {_joints(robot)}; formulas of more than {MOST_JOINTS} are too long"
    for link in links:
        if link.kind not in ("hinge", "slide"):
            return f"joint {link.name!r} is a {link.kind} joint"
    if robot.tree.pulls:
        return f"it has {robot.tree.pulls[0].name!r}, a tendon, an actuator or a bent spring"
    return "its bodies move in a medium" if robot.tree.fluid else ""


def _joints(robot: Robot) -> str:
    assert robot.tree is not None
    count = len(robot.tree.links)
    return counted(count, "joint")
