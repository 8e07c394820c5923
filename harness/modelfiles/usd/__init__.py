"""USD stages as trees of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..robot import Robot
from .read import UsdNumbers, read_usd_robot


def read(file: Path, settings: Mapping[str, object]) -> Robot:
    """Read a robot; `variants` selects variants by the names of their sets."""
    return read_usd_robot(file, settings)


def numbers(file: Path, settings: Mapping[str, object]) -> UsdNumbers:
    """Return the numbers that layers of a stage state; `held` names joints that are fixed."""
    return UsdNumbers(file, settings)
