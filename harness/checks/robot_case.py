"""Check of a robot file in an engine against its own equations, at sampled states."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.accelerations import with_dynamics
from physics_crosscheck.harness.checks.case_record import (
    dynamics_record,
    full_run_record,
    stepping_record,
    verdict_record,
)
from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.checks.full_run_check import with_full_runs
from physics_crosscheck.harness.checks.robot_record import (
    format_omission,
    robot_findings,
    settings_of,
    sidecar_beside,
    tree_record,
)
from physics_crosscheck.harness.checks.robot_task import (
    RefusedError,
    RobotTask,
    load_robot,
    order_of,
    placed,
)
from physics_crosscheck.harness.checks.verdict import Verdict, filled, judged
from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.failure import Failure, failure_of
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot import Robot, home_of
from physics_crosscheck.harness.modelfiles.robot_system import RobotError, robot_system
from physics_crosscheck.harness.numerics.batch import Batch, held
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.forward_dynamics import (
    AccelerationComparison,
    forward_dynamics,
    mixed,
)
from physics_crosscheck.harness.numerics.full_run import why_no_run
from physics_crosscheck.harness.numerics.segments import BlownUpError, Extrapolated, extrapolate
from physics_crosscheck.harness.numerics.step_study import study_step
from physics_crosscheck.harness.numerics.stepping import step_engine
from physics_crosscheck.harness.records.case import Case, CaseKind, FullRun, Stepping
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import FLOOR, Outcome
from physics_crosscheck.harness.records.system import System
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.declaration import DeclarationError, Scenario
from physics_crosscheck.reference.mechanism.multibody import TreeSystem, tree_system
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.next_state import SteppedBodies
from physics_crosscheck.reference.solving.samples import Samples, samples
from physics_crosscheck.reference.solving.solve import solve

SCENARIO = "states"
"""Placeholder for the scenario of a file that declares none."""

FLOATING = "floating states"
"""The same for a URDF whose root link moves freely."""

STATES = 40
"""Number of segments of a check. They are selected so that each number shows as well as with a
hundred random segments.
"""

SEED = 1


@dataclass(frozen=True, kw_only=True)
class PreparedRobot:
    """A robot file, read and solved.

    Attributes:
        file: the model file.
        names: names of its coordinates.
        followers: map to the joints of an engine.
        system: its tree as a system.
        samples: states, and the states that the equations reach from them.
        record: its entry in results.json.
        settings: settings of the engines.
        left_out: statements of the file that the equations omit.
        findings: non-physical inertias.
        motion: the motion from rest, or a sentence why it cannot be solved; None if none was
            requested.
    """

    file: Path
    names: tuple[str, ...]
    followers: Followers
    system: TreeSystem
    samples: Samples
    record: System
    settings: Mapping[str, object]
    left_out: tuple[str, ...]
    findings: tuple[AuditFinding, ...]
    motion: Motion | str | None = None

    @property
    def scenario(self) -> str:
        """Name of its states."""
        return self.record.scenarios[0].name

    def task(self, engine: str, resolution: float) -> RobotTask:
        """Build the task of the check in an engine."""
        adapter_settings = engines()[engine].settings_for(self.file.suffix)
        return RobotTask(
            file=self.file,
            folder=str(self.file),
            robot=self.record.name,
            scenario=self.scenario,
            engine=engine,
            names=self.names,
            followers=self.followers,
            tree=self.system.tree,
            samples=self.samples,
            settings={**adapter_settings, **self.settings},
            resolution=resolution,
            motion=self.motion,
        )


def prepare_robot(
    file: Path, *, floating: bool = False, model: str = "", motion: float = 0.0
) -> PreparedRobot:
    """Read a robot file, sample states and solve.

    Args:
        file: the model file.
        floating: whether the root link of a URDF moves freely.
        model: which of several models of an SDFormat file; empty: the only one that moves.
        motion: duration of a motion from rest, seconds; 0 for none.

    Raises:
        RobotError, ReferenceError: naming file, line and remedy.
    """
    began = time.perf_counter()
    robot = read_robot(file, floating=floating, model=model)
    system = robot_system(robot)
    try:
        drawn = tree_states(system, robot.limits, STATES)
    except ReferenceError as error:
        raise RobotError(f"{file}: {error}") from None
    solved = motion_from_rest(system, drawn, motion) if motion else None
    return PreparedRobot(
        file=file,
        names=tuple(c.name for c in system.coordinates),
        followers=Followers.of(system.tree),
        system=system,
        samples=drawn,
        record=tree_record(
            str(robot.file),
            system,
            drawn,
            scenario_of(robot),
            time.perf_counter() - began,
            motion,
        ),
        settings=settings_of(robot),
        left_out=(*(format_omission(one) for one in robot.left_out), *sidecar_beside(file)),
        findings=robot_findings(robot),
        motion=solved,
    )


def motion_from_rest(system: TreeSystem, drawn: Samples, seconds: float) -> Motion | str:
    """Solve the motion from rest at the first of the sampled positions.

    Returns:
        The motion, or why it cannot be solved.
    """
    scenario = Scenario(
        "motion",
        "from rest, under gravity and the mechanism's own forces",
        q={c: float(q) for c, q in zip(system.coordinates, drawn.start[0], strict=False)},
        v=dict.fromkeys(system.coordinates, 0.0),
        inputs={},
        duration=seconds,
    )
    try:
        return solve(TreeEquations(system), scenario)
    except (DeclarationError, ReferenceError) as error:
        return str(error)


def scenario_of(robot: Robot) -> str:
    """Return the name of a robot's states."""
    return FLOATING if robot.floats else SCENARIO


def tree_states(system: TreeSystem, limits: tuple[Array, Array], count: int) -> Samples:
    """Select states that make a tree's numbers distinguishable, and solve the equations from them.

    Args:
        system: the tree.
        limits: limits of all its joints.
        count: number of states.

    Raises:
        ReferenceError: where a joint moves nothing that has mass.
    """
    kept = Coupled(system.tree).kept
    within, home = np.stack(limits, axis=1)[kept], home_of(system.tree, limits)[kept]
    return samples(TreeEquations(system), within, home, count, SEED)


@dataclass(frozen=True, kw_only=True)
class Followed:
    """Segments of a robot in an engine, in the engine's order.

    Attributes:
        model: the model that the engine loaded.
        map: map from the coordinates to the engine's.
        names: names of the coordinates, in the engine's order.
        samples: states, in the engine's order.
        scale: scale of the defects, (2n,).
        found: ends of the segments in the engine as h -> 0.
    """

    model: Model
    map: CoordinateMap
    names: tuple[str, ...]
    samples: Samples
    scale: Array
    found: Extrapolated

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of the state, (2n,)."""
        return (*self.names, *(f"{name}_dot" for name in self.names))


def scale_of(drawn: Samples) -> Array:
    """Return the scale of the defects: the largest displacement of each component, (2n,)."""
    return filled(np.max(np.abs(drawn.end - drawn.start), axis=0))


def follow_robot(
    task: RobotTask, rungs: tuple[int, ...] = (), model: Model | None = None
) -> Followed:
    """Run every segment in the engine as h -> 0, on these rungs or as many as needed.

    Args:
        task: the task.
        rungs: rungs of the step study; empty: as many as needed.
        model: the loaded model; None: load the file here.

    Raises:
        EngineError, BlownUpError: naming the file.
    """
    model = model or load_robot(task)
    drawn, coordinates, names = placed(task, model)
    count = len(drawn.forces)
    scale = scale_of(drawn)
    batch = Batch(
        states=drawn.start,
        lengths=np.full(count, drawn.length),
        inputs=held(drawn.forces),
        varying=False,
        scale=scale,
        ends=drawn.end,
        uneven=drawn.nonsmooth,
    )
    try:
        if rungs:
            limits = extrapolate(model, coordinates, batch, rungs=rungs)
        else:
            limits = extrapolate(model, coordinates, batch, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(f"{task.file}: {error}") from None
    return Followed(
        model=model, map=coordinates, names=names, samples=drawn, scale=scale, found=limits
    )


def run_robot(task: RobotTask) -> Case:
    """Run every segment in the engine as h -> 0, and judge.

    Run unresolved cases with the engine's other integrators too. A servo that settles within
    microseconds moves its joint so little that rounding, multiplied by the large weights of an
    extrapolation of order 1, hides the result. Order 4 needs a tenth of these weights.

    A standalone file that the engine refuses still becomes such a case, since other engines may
    judge it.

    Raises:
        EngineError, BlownUpError: the case is then FAILED with that message.
    """
    began = time.perf_counter()
    try:
        way, verdict = _judged(task)
    except RefusedError as error:
        if task.folder != str(task.file):
            raise
        return _refused(task, failure_of(error))
    stepping = _stepping(task, way)  # with the integrator that the file selects
    shipped = way
    way, verdict, dynamics = _decided(task, way, verdict)
    outcome, reason, kind, full_run = _with_motion(task, shipped, verdict)
    return Case(
        system=task.robot,
        model=task.file.name,
        scenario=task.scenario,
        engine=task.engine,
        folder=task.folder,
        outcome=outcome,
        reason="; ".join(filter(None, (reason, *way.model.reservations))),
        kind=kind,
        verdict=verdict_record(verdict, way.found, way.model.exponents(False)[0]),
        full_run=full_run,
        stepping=stepping,
        forward_dynamics=dynamics_record(dynamics, tuple(way.model.coordinates)),
        seconds=time.perf_counter() - began,
    )


def judge_robot(task: RobotTask) -> Verdict:
    """Judge every segment, without a run at the file's own time step.

    Raises:
        EngineError, BlownUpError: if the engine cannot run it.
    """
    return _decided(task, *_judged(task))[1]


def _refused(task: RobotTask, failure: Failure) -> Case:
    return Case(
        system=task.robot,
        model=task.file.name,
        scenario=task.scenario,
        engine=task.engine,
        folder=task.folder,
        outcome=Outcome.REFUSED,
        reason=failure.about(task.file),
        locations=failure.locations,
        kind=failure.kind,
    )


def judge_loaded(task: RobotTask, model: Model) -> Verdict:
    """Judge every segment of a loaded model, with its own integrator only.

    Raises:
        EngineError, BlownUpError: if the engine cannot run it.
    """
    return _judged(task, model)[1]


def _judged(task: RobotTask, model: Model | None = None) -> tuple[Followed, Verdict]:
    """Run every segment in the engine, and derive the verdict."""
    way = follow_robot(task, model=model)
    verdict = judged(
        way.found,
        way.samples,
        scale=way.scale,
        components=way.components,
        coordinates=tuple(way.model.coordinates),
        claimed=way.model.exponents(False)[0],
        resolution=task.resolution,
    )
    return way, verdict


def _decided(
    task: RobotTask, way: Followed, verdict: Verdict
) -> tuple[Followed, Verdict, AccelerationComparison | None]:
    """Refine the verdict with the engine's accelerations, and with another integrator if needed."""
    dynamics, names = _dynamics(task, way), tuple(way.model.coordinates)
    way, verdict = _otherwise(task, way, verdict)
    return way, with_dynamics(verdict, dynamics, names, task.resolution), dynamics


def _otherwise(task: RobotTask, way: Followed, verdict: Verdict) -> tuple[Followed, Verdict]:
    """Run with another integrator if only that resolves the case.

    The reason then names both integrators.
    """
    if verdict.outcome is not Outcome.UNRESOLVED:
        return way, verdict
    for name, settings in way.model.integrators.items():
        other, other_verdict = _judged(replace(task, settings={**task.settings, **settings}))
        if other_verdict.outcome is not Outcome.UNRESOLVED:
            message = f"stepped by {name}, since by {way.model.integrator} {verdict.reason}"
            return other, replace(
                other_verdict, reason="; ".join(filter(None, [other_verdict.reason, message]))
            )
    return way, verdict


def _with_motion(
    task: RobotTask, way: Followed, verdict: Verdict
) -> tuple[Outcome, str, CaseKind, FullRun | None]:
    """Run the motion from rest at the file's own time step, and compare it with the verdict.

    Returns:
        The outcome, its reason, the kind of the reason, and the full run; those of the verdict if
        there is no motion.
    """
    motion, model = task.motion, way.model
    unchanged = verdict.outcome, verdict.reason, verdict.kind
    if motion is None:
        return *unchanged, None
    why = motion if isinstance(motion, str) else why_no_run(motion.duration, model.step)
    if isinstance(motion, str) or why:
        reason = "; ".join(filter(None, (verdict.reason, f"no motion from rest: {why}")))
        return verdict.outcome, reason, verdict.kind, None
    n, claimed = len(task.names), model.exponents(False)[0]
    size = np.repeat([motion.amplitude[:n].max(), motion.amplitude[n:].max()], n)
    study = study_step(
        model,
        task.followers.map(order_of(task, model), task.names),
        motion,
        power=TreeEquations(
            tree_system(name=task.robot, title="", source="", tree=task.tree)
        ).numeric_power,
        amplitude=filled(np.maximum(motion.amplitude, FLOOR * size)),
        claimed=claimed,
        agrees=verdict.outcome is Outcome.AGREES,
    )
    full_run = full_run_record(study, model.step, model.integrator)
    return *with_full_runs(verdict, study, motion, claimed), full_run


def _stepping(task: RobotTask, way: Followed) -> Stepping | None:
    """Compare single steps of the engine, from the starts of the segments."""
    drawn = way.samples
    stepping = step_engine(
        way.model,
        way.map,
        _stepped(task, way),
        drawn.start,
        drawn.forces,
        task.resolution,
        fastest=drawn.fastest,
    )
    return None if stepping is None else stepping_record(stepping, way.components)


def _dynamics(task: RobotTask, way: Followed) -> AccelerationComparison | None:
    """Compare the engine's accelerations at those states, and at further states in the same
    positions.
    """
    states, inputs = mixed(way.samples.start, way.samples.forces)
    stepped = _stepped(task, way)
    return forward_dynamics(way.model, way.map, stepped, states, inputs, task.resolution)


def _stepped(task: RobotTask, way: Followed) -> SteppedBodies:
    """Build the equations in the order of the engine's coordinates."""
    return SteppedBodies(task.tree, [task.names.index(name) for name in way.names])
