"""SDFormat files as trees of bodies."""

from collections.abc import Mapping
from pathlib import Path

from ..robot import Robot, armatures_of
from .read import SdfNumbers, read_sdf_robot


def read(file: Path, settings: Mapping[str, object]) -> Robot:
    """Read a robot; `model` names one of several models."""
    return read_sdf_robot(
        file, model=str(settings.get("model", "")), armatures=armatures_of(settings)
    )


def numbers(file: Path, settings: Mapping[str, object]) -> SdfNumbers:
    """Return the numbers of the chosen model."""
    held = settings.get("held")
    return SdfNumbers(
        file,
        str(settings.get("model", "")),
        held if isinstance(held, list) else [],
        armatures_of(settings),
    )
