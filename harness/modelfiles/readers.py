"""A robot's file, read by its suffix: its tree and its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Protocol

from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, read_compiled_robot
from physics_crosscheck.harness.modelfiles.numbers import Number
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_system import RobotError
from physics_crosscheck.harness.modelfiles.sdf.numbers import SdfNumbers
from physics_crosscheck.harness.modelfiles.sdf.read import read_sdf_robot
from physics_crosscheck.harness.modelfiles.urdf.numbers import UrdfNumbers
from physics_crosscheck.harness.modelfiles.urdf.read import read_urdf_robot
from physics_crosscheck.reference.mechanism.tree import Tree


class Numbers(Protocol):
    """The numbers of a robot's file, and the tree for other values."""

    @property
    def numerals(self) -> tuple[Number, ...]:
        """All numbers, in order."""

    @property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""

    @property
    def unread(self) -> tuple[str, ...]:
        """Why numbers of some of its files are missing, one sentence each."""

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""

    def engine_variants(self) -> Iterable[tuple[str, Tree]]:
        """Return differences of the engine that compiles the file: causes, each with its tree."""

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return the files, by path, with other values of some numbers."""


def read_robot(file: Path, *, floating: bool = False, model: str = "") -> Robot:
    """Read a robot's file, by its suffix.

    Args:
        file: the model file.
        floating: whether the root link of a URDF moves freely; an SDFormat file states it.
        model: name of one of several models of an SDFormat file; empty for a single moving one.
    """
    if file.suffix == ".sdf":
        return read_sdf_robot(file, model=model)
    if file.suffix == ".urdf":
        return read_urdf_robot(file, floating=floating)
    return read_compiled_robot(file)


def robot_numbers(file: Path, settings: Mapping[str, object]) -> Numbers:
    """Return the numbers of a robot's file that has a tree, by its suffix.

    Args:
        file: the model file.
        settings: of the engines that run it.

    Raises:
        RobotError: if no installed engine compiles the file.
    """
    if file.suffix == ".sdf":
        return SdfNumbers(file, str(settings.get("model", "")))
    if file.suffix == ".urdf":
        held = settings.get("held", [])
        return UrdfNumbers(
            file,
            floating=bool(settings.get("floating")),
            held=held if isinstance(held, list) else [],
        )
    engine = compiler(file.suffix)
    if engine is None:
        raise RobotError(f"{file}: no engine is installed that compiles {file.suffix} files")
    controls = settings.get("controls", [])
    return CompiledNumbers(file, engine, controls if isinstance(controls, list) else [])
