"""Folders that declare bodies: their tree, sampled states, and checks of their models.

`system.py` declares the tree. Model files are checked at the same kind of states as standalone
files. The sidecar of a model holds its settings.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.checks.prepare import Prepared, derived
from physics_crosscheck.harness.checks.robot_case import (
    SCENARIO,
    STATES,
    motion_from_rest,
    tree_states,
)
from physics_crosscheck.harness.checks.robot_record import (
    format_omission,
    robot_findings,
    tree_record,
)
from physics_crosscheck.harness.checks.robot_task import RobotTask
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.survey import FileSurvey
from physics_crosscheck.harness.records.system import System as SystemRecord
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.samples import Samples


@dataclass(frozen=True, kw_only=True)
class PreparedTree:
    """A declared tree of bodies, solved; picklable.

    Attributes:
        folder: the system folder.
        system: the declared system.
        samples: states of the tree, and the states that its equations reach from them.
        record: the system's entry in results.json.
        reads: states of the files that `system.py` read, by name relative to the folder.
        motion: the motion from rest, or why it cannot be solved; None if none was requested.
    """

    folder: Path
    system: MultibodySystem
    samples: Samples
    record: SystemRecord
    reads: Mapping[str, str]
    motion: Motion | str | None = None

    def id(self, sidecar: Sidecar, engine: str) -> CaseId:
        """Return the name of the only case of a model in an engine."""
        return CaseId(
            system=self.system.name, model=sidecar.model.name, scenario=SCENARIO, engine=engine
        )

    def task(self, sidecar: Sidecar, engine: str, resolution: float) -> RobotTask:
        """Build the task of that case."""
        task = case_of(self.system, self.samples, self.folder, sidecar, engine, resolution)
        return replace(task, motion=self.motion)


def case_of(
    system: MultibodySystem,
    drawn: Samples,
    folder: Path,
    sidecar: Sidecar,
    engine: str,
    resolution: float,
) -> RobotTask:
    """Build the task of a model in an engine at states of the declared bodies."""
    spec = sidecar.spec(engine)
    return RobotTask(
        file=sidecar.model,
        folder=str(folder),
        robot=system.name,
        scenario=SCENARIO,
        engine=engine,
        names=tuple(c.name for c in system.tree_system.coordinates),
        followers=Followers.of(system.assembled.tree),
        tree=system.assembled.tree,
        samples=drawn,
        settings=spec.settings,
        springs=spec.springs,
        resolution=resolution,
    )


def prepare_folder(
    folder: Path, described: bool = True, motion: float = 0.0
) -> Prepared | PreparedTree:
    """Load `folder/system.py`, and solve the system that it declares by energies or by bodies.

    Args:
        folder: the system folder.
        described: whether the record contains a derivation, as in `prepare`.
        motion: duration of a motion from rest of declared bodies, seconds; 0 for none.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    began = time.perf_counter()
    with record_reads(folder) as reads:
        declared = load_declaration(folder)
    if isinstance(declared, System):
        return derived(folder, declared, reads.states(), began, described=described)
    return _prepared_tree(folder, declared, reads.states(), began, motion)


def _prepared_tree(
    folder: Path, declared: MultibodySystem, reads: Mapping[str, str], began: float, motion: float
) -> PreparedTree:
    try:
        drawn = states_of(declared, STATES)
    except ReferenceError as error:
        raise ReferenceError(f"{folder / 'system.py'}: {error}") from None
    solved = motion_from_rest(declared.tree_system, drawn, motion) if motion else None
    seconds = time.perf_counter() - began
    return PreparedTree(
        folder=folder,
        system=declared,
        samples=drawn,
        record=tree_record(str(folder), declared.tree_system, drawn, SCENARIO, seconds, motion),
        reads=reads,
        motion=solved,
    )


def states_of(declared: MultibodySystem, count: int) -> Samples:
    """Select states that make a tree's numbers distinguishable, and solve the equations from them.

    Raises:
        ReferenceError: where a joint moves nothing that has mass.
    """
    return tree_states(declared.tree_system, declared.assembled.limits, count)


def survey_file(sidecar: Sidecar) -> FileSurvey:
    """Read a model file without its declaration."""
    robot = read_robot(
        sidecar.model,
        floating=bool(sidecar.settings.get("floating", False)),
        model=str(sidecar.settings.get("model", "")),
    )
    return FileSurvey(
        findings=robot_findings(robot),
        left_out=tuple(format_omission(one) for one in robot.left_out),
    )
