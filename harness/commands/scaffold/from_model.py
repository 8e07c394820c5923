"""Create a system folder from a model file: its bodies, each number with its line."""

from pathlib import Path

from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.engines.registry import default_engines
from physics_crosscheck.harness.modelfiles.folders import FORMATS, FolderError
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_targets import source_file
from physics_crosscheck.harness.results.visible import odd_name, visible
from .folder import NewError, plain
from .from_tree import from_tree

GRAVITY, STEP = 9.81, 0.002
"""Values of a new sidecar for a format that states none, m/s^2 and s."""


def from_model(
    model: Path, target: Path, *, floating: bool | None = None, chosen: str = ""
) -> tuple[str, ...]:
    """Write the folder of a model file, and return remarks to print.

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
    return from_tree(robot, data, target, _settings(robot))


def _settings(robot: Robot) -> list[str]:
    """Return sidecar settings for values that the file does not state."""
    suffix, gravity = robot.file.suffix, [0, 0, -GRAVITY]
    if suffix == ".xml":
        return []
    if suffix == ".urdf":
        notes = [(e.title, e.default_settings_note) for e in default_engines(suffix)]
        stated = "; ".join(f"{title} would take {note}" for title, note in notes if note)
        missing = {"step": STEP, "gravity": gravity}
        reason = f"A URDF carries neither; {stated}."
    else:
        assert robot.body_model is not None
        ordinary = {"step": STEP, "gravity": list(robot.body_model.gravity)}
        missing = {key: value for key, value in ordinary.items() if key not in robot.stated}
        reason = f"No world in {plain(robot.file.name)} states this."
    if not missing:
        return []
    return [f"# {reason}", "[settings]", *(f"{k} = {v}" for k, v in missing.items()), ""]
