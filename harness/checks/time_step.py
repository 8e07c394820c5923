"""The time step of a model in an engine, without a full run: its error and its stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.engines.protocol import (
    EngineError,
    LoadedModel,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.step_study import TARGETS
from physics_crosscheck.harness.numerics.time_step import (
    LARGEST_STEP,
    SECONDS,
    GrowingMode,
    RestPose,
    SmoothError,
    StudiedModel,
    by_state,
    largest_stable,
    rounded_down,
    smooth_error,
    whole_mode,
)
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import StepChoice, TargetStep, TimeStep
from physics_crosscheck.harness.results.status import duration
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import TreeError
from .findings import finding
from .plausibility.facts import element_line, line_of, roots_of
from .prepare import Prepared, PreparedSystem, PreparedTree, prepare_tree
from .task import ModelTask, model_task
from .whole_step import compares_steps

POSES = 12
"""Number of drawn positions of which the one with the fastest rates is linearized."""

DAMPED = 1.7
"""Least product of the largest stable step and the rate of dampers that make it unstable. It is 2
without springs, in steps of Runge-Kutta 2.8."""

SETTLING, MOST_STEPS = 0.2, 400
"""Length of the motion with all forces, s, and its largest number of steps."""

MOST_OFF = 2.0
"""Largest error of a run at a predicted step, as a multiple of the target."""


def case_time_step(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> TimeStep | None:
    """Return the error of the step over a smooth motion of bodies, and what makes it unstable.

    The motion is that of a full run from rest. None if the engine has no integrator, and for a
    stable step if full runs show its error, or the engine compiles each number of steps.
    """
    target, h = task.target, model.step
    if not model.steps_itself or not (np.isfinite(h) and 0 < h < SECONDS):
        return None
    studied, poses = StudiedModel(model=model, coordinates=coordinates), poses_of(target)
    mode = studied.unstable_mode(poses, h)
    if mode is not None and studied.confirms(mode, h):
        return _unstable(task, studied, mode, poses)
    if not isinstance(target, PreparedTree) or engines()[task.engine].on_request:
        return None
    start = start_of(target)
    error = smooth_error(studied, start, h, poses)
    if math.isnan(error.error):
        return None
    steps = [(one, step_for(studied, start, poses, error, one, h)) for one in TARGETS]
    return TimeStep(
        step=number(h),
        duration=SECONDS,
        error=number(error.error),
        order=error.order,
        steps_for=tuple(TargetStep(target=one, step=number(step)) for one, step in steps),
    )


def choose_step(
    file: Path, *, engine: str, target: float, floating: bool, model: str
) -> StepChoice:
    """Return the error of the step of a robot file, the largest stable one, and one for an error.

    Raises:
        FileError, ReferenceError: naming the file and its place.
    """
    prepared = prepare_tree(file, floating=floating, model=model)
    task = model_task(prepared, engine)
    loaded, coordinates = task.load()
    choice = StepChoice(
        file=str(file),
        engine=engine,
        integrator=loaded.integrator,
        step=number(loaded.step),
        target=target,
    )
    if not loaded.steps_itself:
        return structs.replace(choice, step=None, problem="no integrator of its own")
    studied = StudiedModel(model=loaded, coordinates=coordinates)
    poses, start, h = poses_of(prepared), start_of(prepared), loaded.step
    stable = studied.largest_stable_step(poses, h)
    # Close to the largest stable step, deviations overshoot and hardly decay.
    base = h if stable is None or stable >= h else stable / 4
    error = smooth_error(studied, start, base, poses)
    limit = LARGEST_STEP if stable is None else stable
    wanted = step_for(studied, start, poses, error, target, base, limit)
    smooth = case_time_step(task, loaded, coordinates)
    study = whole_time_step(task, smooth) or smooth
    unstable = "" if study is None or study.finding is None else study.finding.message
    if study is not None and study.largest_stable is not None:
        stable = study.largest_stable
    return structs.replace(
        choice,
        error=None if unstable or (stable is not None and stable < h) else number(error.error),
        largest_stable=number(stable),
        step_for=number(wanted if wanted is None or stable is None else min(wanted, stable)),
        unstable=unstable,
    )


def start_of(target: PreparedTree) -> Array:
    """Return the start of the smooth motion: the first drawn position, at rest, (2n,)."""
    return np.concatenate([target.samples.start[0, : len(target.names)], 0 * target.home])


def poses_of(target: Prepared) -> tuple[RestPose, ...]:
    """Return poses at rest: the declared equilibria, or two of a tree.

    These are the middle of the joints' ranges, and the drawn position with the fastest rates.
    """
    if isinstance(target, PreparedSystem):
        if target.system.interactions:  # no linearization describes motions that switch
            return ()
        return tuple(
            RestPose(
                name=f"about {one.name}",
                state=np.concatenate([one.position, 0 * one.position]),
                hold=one.hold,
                slopes=one.matrices["A"][len(one.position) :],
            )
            for one in target.equilibria
        )
    assert isinstance(target, PreparedTree)
    equations, n = TreeEquations(target.system), len(target.names)
    q = np.concatenate([target.home[None], target.samples.start[:POSES, :n]])
    states = np.concatenate([q, 0 * q], axis=1)
    hold = equations.forces_for(q, 0 * q, 0 * q)
    slopes = equations.pushed_slopes(states, hold)
    rates = [float(np.max(np.abs(np.linalg.eigvals(by_state(one))))) for one in slopes]
    fastest = 1 + int(np.argmax(rates[1:]))
    places = ("in the middle of the joints' ranges", 0), ("at a drawn position", fastest)
    return tuple(
        RestPose(name=name, state=states[k], hold=hold[k], slopes=slopes[k]) for name, k in places
    )


def step_for(
    studied: StudiedModel,
    start: Array,
    poses: Sequence[RestPose],
    error: SmoothError,
    target: float,
    h: float,
    limit: float = LARGEST_STEP,
) -> float | None:
    """Return the step for an error of the smooth motion, s; None if unknown.

    A step above the one with a known error is run, and must be stable.

    Args:
        error: that of steps of h.
        limit: largest step to return, s.
    """
    longer = error.step_for(target)
    if longer is None or longer <= h:
        return longer if error.error > target else h
    longer = min(longer, limit)
    if studied.unstable_mode(poses, longer) is not None:
        return None
    run = smooth_error(studied, start, longer, poses)
    if run.error <= target:
        return longer
    choice = run.step_for(target) if run.error <= MOST_OFF * target else None
    if choice is None:
        return h if error.error <= target else None
    return max(choice, h)


def _unstable(
    task: ModelTask[Prepared], studied: StudiedModel, mode: GrowingMode, poses: Sequence[RestPose]
) -> TimeStep:
    """Return the record of a step that is unstable without limits, contacts and drives."""
    target, h, pose = task.target, studied.model.step, mode.pose
    assert pose is not None
    joint, largest = target.names[mode.coordinate], studied.largest_stable_step(poses, h)
    remedy = ""
    if isinstance(target, PreparedTree) and largest:
        remedy = _stable_damping(target, joint, pose, largest, h)
    behaviour = f"grow {growth_words(math.exp(pose.rate * h))}" if pose.rate else "do not"
    grows = f"{pose.name}, a deviation grows {growth_words(mode.growth)} a step"
    where = f"{grows}, and the equations {behaviour}"
    return _record(task, joint, mode.growth, (h, largest), where, remedy)


def _stable_damping(
    target: PreparedTree, joint: str, pose: RestPose, largest: float, h: float
) -> str:
    """Return the damping of a joint that is stable at a step; empty if other forces decide."""
    share = largest / h
    damping = {one.name: one.damping for one in target.tree.links}.get(joint, 0.0)
    links = tuple(replace(one, damping=share * one.damping) for one in target.tree.links)
    system = replace(target.system, tree=replace(target.tree, links=links))
    slopes = TreeEquations(system).pushed_slopes(pose.state[None], pose.hold[None])[0]
    settling = replace(pose, slopes=slopes).settling
    if not damping or h * settling < DAMPED or settling > 1.01 * share * pose.settling:
        return ""
    stable = rounded_down(damping * share)
    return f"damping up to {stable:g} instead of {damping:g} is stable at {duration(h)}"


def whole_time_step(task: ModelTask[Prepared], step: TimeStep | None) -> TimeStep | None:
    """Return what makes steps with limits, contacts and drives unstable; None if they are stable.

    Steps are linearized at rest in the first keyframe, or else as drawn, and after a short motion.
    """
    target = task.target
    if not isinstance(target, PreparedTree) or not compares_steps(task):
        return None
    if task.spec.path != target.place or (step is not None and step.finding is not None):
        return None
    try:
        model = target.steps.model(task.engine, task.spec)
    except (TreeError, EngineError):
        return None  # the case reports it
    if model is None or not 0 < model.step < SECONDS:
        return None
    comparison, _ = target.steps.kept(task.engine)
    mode, state = _overshooting(model)
    if mode is None:
        return None

    h, joint = model.step, model.coordinates[mode.coordinate]
    names: tuple[str, ...] = ()
    largest = None
    if model.set_step(h):
        largest = largest_stable(lambda step: _is_stable(model, step), h)
        model.set_step(h)
    contacts = sorted(model.contacts(state), key=lambda one: one.distance)
    if contacts and comparison is not None:
        names = tuple(map(comparison.shape_name, contacts[0].surfaces))
    touching = f" (deepest contact: {' and '.join(names)})" if names else ""
    grows = f"overshoots and grows {growth_words(mode.growth)} a step"
    where = f"with all forces{touching}, a deviation {grows}"
    return _record(task, joint, mode.growth, (h, largest), where, shapes=names)


def _is_stable(model: WholeModel, h: float) -> bool:
    return model.set_step(h) and _overshooting(model)[0] is None


def _overshooting(model: WholeModel) -> tuple[GrowingMode | None, WholeState]:
    """Return the mode that overshoots at the first keyframe, or as drawn, or soon after."""
    *_, start = islice(model.starts, 2)
    later = model.moved(start, min(MOST_STEPS, round(SETTLING / model.step)))
    for state in (later, start):
        finite = np.isfinite(state.z).all() and np.isfinite(state.m).all()
        mode = whole_mode(model, state) if finite else None
        if mode is not None:
            return mode, state
    return None, start


def _record(
    task: ModelTask[Prepared],
    joint: str,
    growth: float,
    steps: tuple[float, float | None],
    where: str,
    remedy: str = "",
    shapes: Sequence[str] = (),
) -> TimeStep:
    """Return the record of an unstable step, with the line of the joint."""
    (h, largest), title = steps, engines()[task.engine].title
    message = f"{joint} is unstable in {title} at the step of {duration(h)}: "
    limit = f"the largest stable step is {duration(largest)}" if largest else ""
    parts = (message + where, limit, remedy)
    return TimeStep(
        step=number(h),
        growth=number(growth),
        joint=joint,
        largest_stable=number(largest),
        finding=finding(
            "unstable step",
            (task.engine, joint),
            "; ".join(filter(None, parts)),
            location=_line_of(task.file, joint, shapes),
            expected=largest,
            actual=h,
        ),
    )


def growth_words(growth: float) -> str:
    """Return a growth in words: `14-fold`, `by 3.2 %`."""
    return f"{growth:.2g}-fold" if growth >= 2 else f"by {100 * (growth - 1):.2g} %"


def _line_of(file: Path, joint: str, shapes: Sequence[str] = ()) -> SourceLine:
    """Return the line of one of the shapes or links, of a joint's drive, or of the joint."""
    roots = tuple(roots_of(file))
    names = [(tag, one.rpartition(":")[2]) for one in shapes for tag in ("geom", "link")]
    places = (element_line(roots, tag, name) for tag, name in names)
    drives = (
        line_of(drive)
        for root in roots
        for drive in root.findall("actuator/*")
        if drive.get("joint") == joint and drive.tag != "motor"
    )
    name = joint.partition(":")[0]
    joints = (element_line(roots, tag, name, "dynamics") for tag in ("joint", "freejoint"))
    return next(filter(None, (*places, *drives, *joints)), SourceLine(file=str(file)))
