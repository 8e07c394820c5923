"""A robot's file in an engine, against the equations of what it says: at states at random."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import sympy as sp

from harness.cases.case_record import verdict_record
from harness.cases.verdict import Verdict, filled
from harness.engines.protocol import EngineError, Model, ModelSpec
from harness.engines.registry import engines
from harness.numerics import judgement
from harness.numerics.coordinates import identity
from harness.numerics.judgement import Judgement, Obstacle, obstacle
from harness.numerics.ladder import EPSILON
from harness.numerics.segments import Batch, BlownUpError, Extrapolated, extrapolate, held
from harness.records.base import SourceLine, number
from harness.records.case import Case
from harness.records.finding import AuditFinding
from harness.records.outcome import Outcome
from harness.records.system import Quantity, Scenario, System
from harness.robots.inertias import impossible
from harness.robots.named import read_robot
from harness.robots.robot import LeftOut
from harness.robots.system import RobotError, robot_system
from reference.integrate import ReferenceError
from reference.multibody.tree import WORLD
from reference.numeric import Array
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
                where=SourceLine(file=str(one.file), line=one.line),
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
    coordinates = (
        Quantity(name=c.name, unit=c.unit, description=c.description, latex=sp.latex(c.q))
        for c in system.coordinates
    )
    count = len(drawn.start)
    return System(
        name=system.name,
        folder=str(file),
        title=system.title,
        source=system.source,
        kind="autonomous",
        coordinates=tuple(coordinates),
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
        settings: of the engine, beside that it leaves out what is not smooth.
    """

    file: Path
    robot: str
    engine: str
    names: tuple[str, ...]
    samples: Samples
    resolution: float
    settings: Mapping[str, object] = field(default_factory=dict)


def run_robot(task: RobotTask) -> Case:
    """Run every segment in the engine as h -> 0, and judge.

    Raises:
        EngineError, BlownUpError: the case is FAILED with that message.
    """
    began = time.perf_counter()
    engine = engines()[task.engine]
    settings = {**engine.settings_for(task.file.suffix), **task.settings, **ALONE}
    model = engine.load(ModelSpec(path=task.file, settings=settings, springs=()))
    order = _order(task, model)
    start, end = (_ordered(part, order) for part in (task.samples.start, task.samples.end))
    scale = filled(np.max(np.abs(end - start), axis=0))
    count = len(start)
    batch = Batch(
        states=start,
        lengths=np.full(count, task.samples.length),
        inputs=held(task.samples.forces[:, order]),
        varying=False,
        scale=scale,
        ends=end,
    )
    same = replace(identity(len(order)), push_matrix=np.eye(len(order)))
    try:
        found = extrapolate(model, same, batch, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(f"{task.file}: {error}") from None
    claimed = model.exponents(False)[0]
    bound = _ordered(task.samples.bound[None], order)[0]
    verdict = judge(found, end, bound, scale, model.coordinates, claimed, task.resolution)
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


def judge(
    found: Extrapolated,
    end: Array,
    bound: Array,
    scale: Array,
    names: tuple[str, ...],
    claimed: int,
    resolution: float,
) -> Verdict:
    """Judge extrapolated segments from states that no motion joins.

    Args:
        end, bound: where the equations take them, (K, 2n), and its error, (2n,).
        scale: what counts as one, (2n,).
        names: of the coordinates, n.
        claimed: the engine's order.
    """
    limit = found.limit
    defect = np.abs(limit.value - end) / scale
    uncertainty = np.maximum((limit.uncertainty + bound) / scale, EPSILON)
    seen = judgement.judge(defect, uncertainty, resolution, obstacle(limit))
    components = (*names, *(f"{name}_dot" for name in names))
    component = components[seen.component]
    return Verdict(
        outcome=seen.outcome,
        discrepancy=seen.discrepancy,
        uncertainty=seen.uncertainty,
        largest_discrepancy=seen.largest_discrepancy,
        largest_uncertainty=seen.largest_uncertainty,
        component=component,
        time=float("nan"),
        order=limit.order,
        map_residual=float("nan"),
        map_uncertainty=float("nan"),
        reason=_reason(seen, limit.order, component, claimed, resolution),
    )


def _reason(seen: Judgement, order: float, component: str, claimed: int, resolution: float) -> str:
    where = f"the segment from state {seen.segment + 1}"
    if seen.outcome is Outcome.DIFFERS:
        return (
            f"{component} ends {where} {seen.discrepancy:.2e} of its movement off; the uncertainty"
            f" there is {seen.uncertainty:.1e}"
        )
    if seen.below_resolution:
        return (
            f"{component} differs at {seen.discrepancy:.0e}, below the resolution asked,"
            f" {resolution:.0e} ({where}, uncertainty {seen.uncertainty:.0e})"
        )
    match seen.obstacle:
        case None:
            return ""
        case Obstacle.STANDS_STILL:
            return "every rung returned the same values: the engine did not step"
        case Obstacle.WRONG_ORDER:
            return (
                f"the exponents don't hold: the rungs fall with order {order:.2f}, the engine"
                f" claims {claimed}; no digit of the limit can be trusted"
            )
        case Obstacle.DIVERGES | Obstacle.DIVERGES_HERE:
            return f"the ladder diverges in {where}: the limits of finer rungs do not converge"
    return (
        f"the limit of {component} is known to {seen.uncertainty:.1e} at best, in {where}, where"
        f" {resolution:.0e} was asked: the motion is not smooth there, or the step too coarse"
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


def _ordered(states: Array, order: list[int]) -> Array:
    """States (K, 2n) with their coordinates in another order."""
    n = len(order)
    found: Array = states[:, [*order, *(n + i for i in order)]]
    return found
