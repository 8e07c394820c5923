"""Names of a declaration, read without deriving anything."""

import builtins
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from .prepare import SCENARIO, scenario_of


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


def declared(target: Path, *, floating: bool | None = None, model: str = "") -> Declared:
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


def listed(
    targets: Sequence[Path], only: Sequence[str], *, floating: bool | None = None, model: str = ""
) -> tuple[list[tuple[str, CaseId]], list[str]]:
    """List the cases of system folders and robot files as a run would create them.

    Args:
        targets: folders, each with a `system.py` that runs in a worker, and robot files.
        only: engines; empty: all that the sidecars name, or that read the file.
        floating, model: options for reading files, as in `read_robot`.

    Returns:
        The cases with their folders, and a sentence for each target that cannot be listed.
    """
    with Workers(1) as workers:
        reading = partial(declared, floating=floating, model=model)
        declarations = workers.outcomes(reading, targets)
    cases, faults = list[tuple[str, CaseId]](), list[str]()
    for target, system in zip(targets, declarations, strict=True):
        if isinstance(system, Failure):
            faults.append(system.about(target) if target.is_file() else system.reason)
            continue
        for file in [target] if target.is_file() else model_files(target):
            if isinstance(file, UnreadModel):
                faults.append(file.reason)
                continue
            name = model_path(file).name
            for engine in chosen_engines(file, only):
                for scenario in system.scenarios:
                    case = CaseId(system=system.name, model=name, scenario=scenario, engine=engine)
                    cases.append((str(target), case))
    return cases, faults
