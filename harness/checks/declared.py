"""Names of a declaration, read without deriving anything."""

from __future__ import annotations

import builtins
import warnings
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.checks.prepare import SCENARIO, scenario_of
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot_system import robot_system
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem


@dataclass(frozen=True, kw_only=True)
class RecordedWarning:
    """A warning from a declaration or from a library that it imports."""

    message: str
    category: str
    file: str
    line: int

    def again(self) -> None:
        """Emit the warning in this process."""
        category = getattr(builtins, self.category, UserWarning)
        warnings.warn_explicit(self.message, category, self.file, self.line)


@dataclass(frozen=True)
class Declared:
    """The names of a system and its scenarios, with the warnings from loading them."""

    name: str
    scenarios: tuple[str, ...]
    warned: tuple[RecordedWarning, ...]


def declared(target: Path, *, floating: bool = False, model: str = "") -> Declared:
    """Load a declaration, or read a robot file, in a worker, since a declaration is a program.

    Args:
        target: the system folder, or the file.
        floating, model: options for reading the file, as in `read_robot`.

    Raises:
        DeclarationError, RobotError: naming the file, the line and the remedy.
    """
    if target.is_file():
        robot = read_robot(target, floating=floating, model=model)
        return Declared(robot_system(robot).name, (scenario_of(robot),), ())
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("default")
        system = load_declaration(target)
    if isinstance(system, MultibodySystem):
        scenarios: tuple[str, ...] = (SCENARIO,)
    else:
        scenarios = tuple(scenario.name for scenario in system.scenarios)
    return Declared(
        system.name,
        scenarios,
        tuple(
            RecordedWarning(
                message=str(w.message), category=w.category.__name__, file=w.filename, line=w.lineno
            )
            for w in warned
        ),
    )
