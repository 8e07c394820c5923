"""MJCF files as trees of bodies, from the numbers that an engine compiles."""

from collections.abc import Mapping
from pathlib import Path

from ..readers import RobotError
from ..robot import Robot
from .numbers import CompiledNumbers
from .read import compiler, read_compiled_robot


def read(file: Path, settings: Mapping[str, object]) -> Robot:
    """Read a robot; `controls` are held values of its actuators, which `actuators` switches."""
    actuated = bool(settings.get("actuators", True))
    controls = settings.get("controls") if actuated else None
    listed = controls if isinstance(controls, list) else None
    return read_compiled_robot(file, actuated=actuated, controls=listed)


def numbers(file: Path, settings: Mapping[str, object]) -> CompiledNumbers:
    """Return the numbers of a file and its includes.

    Raises:
        RobotError: if no installed engine compiles the file.
    """
    engine = compiler(file.suffix)
    if engine is None:
        raise RobotError(f"{file}: no engine is installed that compiles {file.suffix} files")
    listed = (settings.get(key) for key in ("controls", "held"))
    return CompiledNumbers(file, engine, *(one if isinstance(one, list) else [] for one in listed))
