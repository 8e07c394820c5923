"""URDF files as trees of bodies."""

from collections.abc import Mapping
from pathlib import Path

from ..robot import Robot, armatures_of
from .read import UrdfNumbers, read_urdf_robot


def read(file: Path, settings: Mapping[str, object]) -> Robot:
    """Read a robot; `floating` lets its root link move, and None means by its chains."""
    floats = settings.get("floating", False)
    return read_urdf_robot(
        file, floating=None if floats is None else bool(floats), armatures=armatures_of(settings)
    )


def numbers(file: Path, settings: Mapping[str, object]) -> UrdfNumbers:
    """Return the file's numbers; `held` names joints that are fixed."""
    held = settings.get("held", [])
    return UrdfNumbers(
        file,
        floating=bool(settings.get("floating")),
        held=held if isinstance(held, list) else [],
        armatures=armatures_of(settings),
    )
