"""A robot's file in an engine, against the equations of what it says: at states at random."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from harness.cases.case_record import verdict_record
from harness.cases.system_record import quantities
from harness.cases.verdict import filled, judge
from harness.engines.protocol import EngineError, Model, ModelSpec
from harness.engines.registry import engines
from harness.numerics.coordinates import identity
from harness.numerics.segments import Batch, BlownUpError, extrapolate, held
from harness.records.base import SourceLine, number
from harness.records.case import Case
from harness.records.finding import AuditFinding
from harness.records.system import Scenario, System
from harness.robots.inertias import impossible
from harness.robots.named import read_robot
from harness.robots.robot import LeftOut
from harness.robots.system import RobotError, robot_system
from reference.integrate import ReferenceError
from reference.multibody.tree import WORLD
from reference.samples import Samples, samples
from reference.trees import TreeEquations, TreeSystem

SCENARIO = "states"
"""What stands for the scenario of a file that declares none."""

STATES = 100
"""Segments of a check: each number of a robot has a say in nearly all of them."""

SEED = 1

ALONE: Mapping[str, object] = MappingProxyType({"smooth": True, "couplings": False})
"""Settings of every engine: what the equations leave out is left out there too."""

METHOD = "recursion along the tree; Gauss collocation of order 16, checked by DOP853"


@dataclass(frozen=True, kw_only=True)
class PreparedRobot:
    """A robot's file, read and solved.

    Attributes:
        file: the model file.
        names: of its coordinates.
        samples: states, and where the equations take them.
        record: what is written of it.
        left_out: what the file says beyond the equations.
        findings: inertias that no body can have.
    """

    file: Path
    names: tuple[str, ...]
    samples: Samples
    record: System
    left_out: tuple[str, ...]
    findings: tuple[AuditFinding, ...]

    def task(self, engine: str, resolution: float) -> RobotTask:
        """The check in an engine."""
        return RobotTask(
            file=self.file,
            robot=self.record.name,
            engine=engine,
            names=self.names,
            samples=self.samples,
            resolution=resolution,
        )


def prepare_robot(file: Path) -> PreparedRobot:
    """Read a robot's file, draw states, and solve.

    Raises:
        RobotError, ReferenceError: naming file, line and remedy.
    """
    began = time.perf_counter()
    robot = read_robot(file)
    system = robot_system(robot)
    limits = np.stack(robot.limits, axis=1)
    still = {part.name for part in robot.parts if part.body == WORLD}
    try:
        drawn = samples(TreeEquations(system), limits, robot.home, STATES, SEED)
    except ReferenceError as error:
        raise RobotError(f"{file}: {error}") from None
    return PreparedRobot(
        file=file,
        names=tuple(c.name for c in system.coordinates),
        samples=drawn,
        record=_record(file, system, drawn, time.perf_counter() - began),
        left_out=tuple(told(one) for one in robot.left_out),
        findings=tuple(
            AuditFinding(
                kind="inertia",
                message=f"{one.sentence}; {one.remedy}",
                where=SourceLine(file=str(one.file), line=one.line or None),
                expected=None,
                found=None,
                severity="note" if one.link in still else "finding",
            )
            for one in impossible(robot)
        ),
    )


def told(one: LeftOut) -> str:
    """Such as: dry friction (7)."""
    return one.what if one.count == 1 else f"{one.what} ({one.count})"


def _record(file: Path, system: TreeSystem, drawn: Samples, seconds: float) -> System:
    count = len(drawn.start)
    return System(
        name=system.name,
        folder=str(file),
        title=system.title,
        source=system.source,
        kind="autonomous",
        coordinates=quantities(system.coordinates),
        constants=(),
        inputs=(),
        outputs=(),
        scenarios=(
            Scenario(
                name=SCENARIO,
                description=f"{count} states at random, each under forces of its own",
                duration=drawn.length,
                inputs={},
                segments=count,
                method=METHOD,
                bound=number(float(drawn.bound.max())),
                global_bound=None,
            ),
        ),
        seconds=seconds,
    )


@dataclass(frozen=True, kw_only=True)
class RobotTask:
    """A robot's file in one engine.

    Attributes:
        file: the model file.
        robot: its name.
        engine: that runs it.
        names: of the coordinates, in the samples' order.
        samples: states, and where the equations take them.
        resolution: that is asked.
    """

    file: Path
    robot: str
    engine: str
    names: tuple[str, ...]
    samples: Samples
    resolution: float


def run_robot(task: RobotTask) -> Case:
    """Run every segment in the engine as h -> 0, and judge.

    Raises:
        EngineError, BlownUpError: the case is FAILED with that message.
    """
    began = time.perf_counter()
    engine = engines()[task.engine]
    settings = {**engine.settings_for(task.file.suffix), **ALONE}
    model = engine.load(ModelSpec(path=task.file, settings=settings, springs=()))
    drawn = task.samples.ordered(_order(task, model))
    count, n = drawn.forces.shape
    scale = filled(np.max(np.abs(drawn.end - drawn.start), axis=0))
    batch = Batch(
        states=drawn.start,
        lengths=np.full(count, drawn.length),
        inputs=held(drawn.forces),
        varying=False,
        scale=scale,
        ends=drawn.end,
    )
    same = replace(identity(n), push_matrix=np.eye(n))
    try:
        found = extrapolate(model, same, batch, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(f"{task.file}: {error}") from None
    claimed = model.exponents(False)[0]
    components = (*model.coordinates, *(f"{name}_dot" for name in model.coordinates))
    verdict = judge(found.limit, drawn, scale, components, claimed, task.resolution)
    return Case(
        system=task.robot,
        model=task.file.name,
        scenario=SCENARIO,
        engine=task.engine,
        folder=str(task.file),
        outcome=verdict.outcome,
        reason=verdict.reason,
        verdict=verdict_record(verdict, found, claimed),
        seconds=time.perf_counter() - began,
    )


def _order(task: RobotTask, model: Model) -> list[int]:
    """Which of the equations' coordinates each of the engine's is.

    Raises:
        EngineError: naming those that only one of them has.
    """
    here, there = set(task.names), set(model.coordinates)
    if here != there or len(there) != len(model.coordinates):
        missing, more = sorted(here - there), sorted(there - here)
        parts = [f"it has no {', '.join(missing)}"] if missing else []
        parts += [f"it has {', '.join(more)} besides"] if more else []
        told = " and ".join(parts) or "two of its joints have one name"
        raise EngineError(f"{task.file}: {task.engine} makes other joints of it: {told}")
    return [task.names.index(name) for name in model.coordinates]
