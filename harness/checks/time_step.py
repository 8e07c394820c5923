"""The time step of a model in an engine, without a full run: its error and its stability.

The error needs no solved motion. Runs of an engine at h and h/2 differ by (1 - 2^-p) of the error
at h, up to higher powers of h (Richardson). The model itself is compared with the equations by
other checks. A step is unstable if its linearization has an eigenvalue outside the unit circle,
unless the equations grow alike, as an inverted pendulum does.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

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
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import StepChoice, TargetStep, TimeStep
from physics_crosscheck.harness.records.outcome import FLOOR
from physics_crosscheck.harness.results.status import NOT_FOLLOWED, duration
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import TreeError
from .findings import finding
from .plausibility.facts import element_line, line_of, roots_of
from .prepare import Prepared, PreparedSystem, PreparedTree, prepare_tree
from .task import ModelTask, model_task
from .verdict import nonzero_scale
from .whole_step import compares_steps

SECONDS = 1.0
"""Length of the smooth motion."""

MOST_STEPS, MANY_STEPS = 1000, 20_000
"""Largest number of steps of the coarsest run, and the same if longer steps are unstable; the error
of shorter steps follows by the order."""

SAMPLES = 100
"""Number of times at which runs are compared."""

MAX_HALVINGS = 2
"""Further halvings of the step until the runs differ in line with the order."""

SMALL = 0.1
"""Error above which the next power of h matters, so that no other step is predicted from it."""

ORDER_RATIO = 1.5
"""Largest factor between the observed and the expected ratio of two differences."""

GROWTH, WHOLE_GROWTH = 1e-3, 1.05
"""Smallest growth a step that counts: differences of steps leave about the root of their error. The
second value is for steps with all forces, as a factor, since their equations are not linearized."""

WHOLE_DEVIATION = 1e-6
"""Deviation from a state with all forces, rad or m, and per second."""

ALIKE = 1.2
"""Largest ratio of its growths by slopes over a small and a large difference."""

FASTER = 3.0
"""A step is unstable if it grows this many times faster than the equations."""

CONFIRMED, MAX_CONFIRMING = 10.0, 2000
"""Growth of a small deviation that confirms an eigenvalue, and the largest number of its steps."""

SMALLEST_STEP, LARGEST_STEP = 1e-9, 0.1
"""Smallest and largest step that are tried, s."""

DIGITS = 2e-2
"""Relative accuracy of the largest stable step, which is rounded down to two digits."""

POSES = 12
"""Number of drawn positions of which the one with the fastest rates is linearized."""

DAMPED = 1.7
"""Least product of the largest stable step and the rate of dampers that make it unstable. It is 2
without springs, in steps of Runge-Kutta 2.8."""

SETTLING, SETTLING_STEPS = 0.2, 400
"""Length of the motion with all forces, s, and its largest number of steps."""

MOST_OFF = 2.0
"""Largest error of a run at a predicted step, as a multiple of the target."""


class RestPose(NamedTuple):
    """A position at rest, as words and a state, (2n,), the inputs that hold it, and A, (2n, 2n)."""

    name: str
    state: Array
    hold: Array
    matrix: Array

    @property
    def rate(self) -> float:
        """Largest growth rate of the equations, 1/s; zero if they decay or swing."""
        return max(0.0, float(np.max(np.linalg.eigvals(self.matrix).real)))


class GrowingMode(NamedTuple):
    """The fastest growing deviation, (2n,): its factor a step, and its main coordinate."""

    growth: float
    coordinate: int
    direction: Array
    pose: RestPose | None = None

    @property
    def confirming_steps(self) -> int:
        """Number of steps over which it grows by the square of `CONFIRMED`."""
        return min(math.ceil(2 * math.log(CONFIRMED) / math.log(self.growth)), MAX_CONFIRMING)


class SmoothError(NamedTuple):
    """The error of a step, and of a shorter one, both relative to the amplitude.

    The first is inf if the motion blows up, and the second if no order is seen. The order is 0 if
    the shortest runs differ clearly too.
    """

    error: float
    order: int
    shorter: float
    shorter_error: float

    def step_for(self, target: float) -> float | None:
        """Return the step that gives an error, s; None if every error is too large."""
        if not 0 < self.shorter_error <= SMALL:
            return None
        ratio = (target / self.shorter_error) ** (1 / self.order)
        return _rounded_down(min(self.shorter * ratio, LARGEST_STEP))


def _step_matrix(
    step: Callable[[Array], Array], state: Array, epsilon: float, *, central: bool = True
) -> Array:
    """Return the derivatives of the state after a step by the state before, (2n, 2n).

    Differences that are not central take half the steps.
    """
    by = epsilon ** (1 / 3 if central else 1 / 2) * np.maximum(np.abs(state), 1.0)
    other = state - np.diag(by) if central else state[None]
    ends = step(np.concatenate([state + np.diag(by), other]))
    slopes: Array = (ends[: len(by)] - ends[len(by) :]).T / (by * (2 if central else 1))
    return slopes


def _fastest_mode(matrix: Array, least: float = 0.0) -> GrowingMode | None:
    """Return the mode of a step's matrix that grows most; None if none grows more than the least.

    Without a least growth, modes count that belong to no motion that the step follows. One that
    falls or tips turns by less than a right angle in a step, and grows less than twofold.
    """
    if not np.isfinite(matrix).all():
        return None
    values, vectors = np.linalg.eig(matrix)
    size = np.abs(values)
    overshoots = (size > 2) | ((values.real < 0) & (size > WHOLE_GROWTH))
    size = np.where(size > least if least else overshoots, size, 0.0)
    k, n = int(np.argmax(size)), len(matrix) // 2
    if not size[k]:
        return None
    try:
        share = np.abs(vectors[:, k] * np.linalg.inv(vectors)[k])  # participation
    except np.linalg.LinAlgError:
        share = np.abs(vectors[:, k])
    real = vectors[:, k].real
    direction = real / (np.max(np.abs(real)) or 1.0)
    return GrowingMode(float(size[k]), int(np.argmax(share[:n] + share[n:])), direction)


@dataclass(frozen=True, kw_only=True)
class StudiedModel:
    """A loaded model whose time step is studied, and the map from the equations' coordinates."""

    task: ModelTask[Prepared]
    model: LoadedModel
    coordinates: CoordinateMap

    @cached_property
    def poses(self) -> tuple[RestPose, ...]:
        """Poses at rest: the declared equilibria, or two of a tree.

        These are the middle of the joints' ranges, and the drawn position with the fastest rates.
        """
        target = self.task.target
        if isinstance(target, PreparedSystem):
            if target.system.interactions:  # no linearization describes motions that switch
                return ()
            points = [(e, np.concatenate([e.position, 0 * e.position])) for e in target.equilibria]
            return tuple(
                RestPose(f"about {e.name}", state, e.hold, e.matrices["A"]) for e, state in points
            )
        assert isinstance(target, PreparedTree)
        equations, n = TreeEquations(target.system), len(target.names)
        q = np.concatenate([target.home[None], target.samples.start[:POSES, :n]])
        states = np.concatenate([q, 0 * q], axis=1)
        hold = equations.forces_for(q, 0 * q, 0 * q)
        matrices = equations.state_matrices(states, hold)
        rates = np.max(np.abs(np.linalg.eigvals(matrices)), axis=1)
        fastest = 1 + int(np.argmax(rates[1:]))
        places = ("in the middle of the joints' ranges", 0), ("at a drawn position", fastest)
        return tuple(RestPose(name, states[k], hold[k], matrices[k]) for name, k in places)

    def after(self, states: Array, inputs: Array, h: float, steps: int = 1) -> Array:
        """Return the states (B, 2n) after some steps under constant inputs, (inputs,)."""
        z, w = self.coordinates.to_engine(states)
        held = np.broadcast_to(inputs, (len(z), steps, len(inputs)))
        with np.errstate(all="ignore"):
            z, w = self.model.rollout(z, w, h, steps, self.coordinates.force(held), steps)
            return self.coordinates.from_engine(z[:, -1], w[:, -1], states)

    def path(self, h: float, steps: int, every: int) -> Array:
        """Return the states of the smooth motion, without inputs, (S, 2n).

        It starts at rest at the first drawn position.
        """
        target = self.task.target
        assert isinstance(target, PreparedTree)
        start = np.concatenate([target.samples.start[0, : len(target.names)], 0 * target.home])
        z, w = self.coordinates.to_engine(start[None])
        with np.errstate(all="ignore"):
            z, w = self.model.rollout(z, w, h, steps, None, every)
            return self.coordinates.follow(z[0], w[0], start)

    def unstable_mode(self, h: float) -> GrowingMode | None:
        """Return the mode that grows most at a step; None if none grows unlike the equations."""
        modes = []
        for pose in self.poses:
            step = partial(self.after, inputs=pose.hold, h=h)
            least = math.exp(max(math.log1p(GROWTH), FASTER * pose.rate * h))
            mode = _fastest_mode(_step_matrix(step, pose.state, self.model.epsilon), least)
            if mode is not None:
                modes.append(mode._replace(pose=pose))
        return max(modes, key=lambda mode: mode.growth, default=None)

    def largest_stable_step(self) -> float | None:
        """Return the largest stable step near the model's own, as `_largest_stable` does."""
        return _largest_stable(lambda step: self.unstable_mode(step) is None, self.model.step)

    def smooth_error(self, h: float) -> SmoothError:
        """Return the error of steps of h over the smooth motion.

        Runs at h, h/2 and so on are compared until their differences are small, and fall in line
        with the order. Of very short steps only multiples are run, if they are stable at the poses.
        The error is nan if that takes too many steps.
        """
        order = self.model.exponents(False)[0]
        factor = max(1, math.ceil(SECONDS / h / MOST_STEPS))
        while factor > 1 and self.unstable_mode(2 * factor * h) is not None:
            factor = (factor + 1) // 2
        coarse = factor * h
        if coarse * MANY_STEPS < SECONDS:
            return SmoothError(math.nan, order, h, math.inf)
        steps = max(2, round(SECONDS / coarse))
        stride = max(1, steps // SAMPLES)
        runs, apart, falls = [self.path(coarse, steps, stride)], list[float](), False
        for k in range(1, MAX_HALVINGS + 2):
            runs.append(self.path(coarse / 2**k, steps * 2**k, stride * 2**k))
            apart.append(_apart(*runs[-2:]))
            ratio = apart[k - 2] / max(apart[-1], 1e-300) / 2.0**order
            falls = k > 1 and 1 / ORDER_RATIO <= ratio <= ORDER_RATIO
            if apart[-1] < SMALL**2 or (falls and apart[-1] < SMALL / 2):
                break
        first, last = (1 - 2.0 ** (-order * k) for k in (1, len(apart)))
        trusted = falls or apart[-1] < SMALL**2
        return SmoothError(
            _apart(runs[0], runs[-1]) / last / factor**order,
            order if trusted or apart[-1] < SMALL else 0,
            coarse / 2 ** (len(apart) - 1),
            apart[-1] / first if trusted else math.inf,
        )

    def step_for(
        self, error: SmoothError, target: float, h: float, limit: float = LARGEST_STEP
    ) -> float | None:
        """Return the step for an error of the smooth motion, s; None if unknown.

        A step above h, which has a known error, is run, and must be stable and within the limit.
        """
        longer = error.step_for(target)
        if longer is None or longer <= h:
            return longer if error.error > target else h
        longer = min(longer, limit)
        if self.unstable_mode(longer) is not None:
            return None
        run = self.smooth_error(longer)
        if run.error <= target:
            return longer
        choice = run.step_for(target) if run.error <= MOST_OFF * target else None
        if choice is None:
            return h if error.error <= target else None
        return max(choice, h)

    def instability(self) -> TimeStep | None:
        """Return the record of a step that is unstable without limits, contacts and drives.

        A small deviation grows in steps of the engine too.
        """
        h, target = self.model.step, self.task.target
        mode = self.unstable_mode(h)
        if mode is None or (pose := mode.pose) is None:
            return None
        small = math.sqrt(self.model.epsilon) / max(1.0, CONFIRMED**2 * mode.growth)
        starts = np.stack([pose.state, pose.state + small * mode.direction])
        ends = self.after(starts, pose.hold, h, mode.confirming_steps)
        if np.max(np.abs(ends[1] - ends[0])) / small < CONFIRMED:  # not finite: it grew
            return None
        joint, largest = target.names[mode.coordinate], self.largest_stable_step()
        remedy = ""
        if isinstance(target, PreparedTree) and largest:
            remedy = _stable_damping(target, joint, pose, largest, h)
        grows_too = pose.rate * h > 1e-3 * math.log(mode.growth)
        behaviour = f"grow {_growth_words(math.exp(pose.rate * h))}" if grows_too else "do not"
        grows = f"{pose.name}, a deviation grows {_growth_words(mode.growth)} a step"
        where = f"{grows}, and the equations {behaviour}"
        return _record(self.task, joint, mode.growth, (h, largest), where, remedy)


def case_time_step(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> TimeStep | None:
    """Return the error of the step over a smooth motion of bodies, and what makes it unstable.

    The motion is that of a full run from rest. None if the engine has no integrator, and for a
    stable step if full runs show its error, or the engine compiles each number of steps.
    """
    h = model.step
    if not model.steps_itself or not (np.isfinite(h) and 0 < h < SECONDS):
        return None
    studied = StudiedModel(task=task, model=model, coordinates=coordinates)
    if (unstable := studied.instability()) is not None:
        return unstable
    if not isinstance(task.target, PreparedTree) or engines()[task.engine].on_request:
        return None
    error = studied.smooth_error(h)
    if math.isnan(error.error):
        return None
    steps = [(one, studied.step_for(error, one, h)) for one in TARGETS]
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
    task = model_task(prepare_tree(file, floating=floating, model=model), engine)
    loaded, coordinates = task.load()
    h = loaded.step
    choice = StepChoice(
        file=str(file), engine=engine, integrator=loaded.integrator, step=number(h), target=target
    )
    if not loaded.steps_itself:
        return structs.replace(choice, step=None, problem="no integrator of its own")
    studied = StudiedModel(task=task, model=loaded, coordinates=coordinates)
    stable = studied.largest_stable_step()
    # Close to the largest stable step, deviations overshoot and hardly decay.
    base = h if stable is None or stable >= h else stable / 4
    error = studied.smooth_error(base)
    wanted = studied.step_for(error, target, base, LARGEST_STEP if stable is None else stable)
    study = whole_time_step(task, studied.instability())
    unstable = "" if study is None or study.finding is None else study.finding.message
    if study is not None and study.largest_stable is not None:
        stable = study.largest_stable
    is_stable = not unstable and (stable is None or stable >= h)
    is_chaotic = is_stable and not error.order and math.isfinite(error.error)
    return structs.replace(
        choice,
        error=number(error.error) if is_stable and not is_chaotic else None,
        problem=NOT_FOLLOWED if is_chaotic else "",
        largest_stable=number(stable),
        step_for=number(wanted if wanted is None or stable is None else min(wanted, stable)),
        unstable=unstable,
    )


def whole_time_step(task: ModelTask[Prepared], step: TimeStep | None) -> TimeStep | None:
    """Return what makes steps with limits, contacts and drives unstable; else the given record.

    Steps are linearized at rest in the first keyframe, or else as drawn, and after a short motion.
    """
    target = task.target
    if not isinstance(target, PreparedTree) or not compares_steps(task):
        return step
    if task.spec.path != target.place or (step is not None and step.finding is not None):
        return step
    try:
        model = target.steps.model(task.engine, task.spec)
    except (TreeError, EngineError):
        return step  # the case reports it
    if model is None or not 0 < model.step < SECONDS:
        return step
    comparison, _ = target.steps.kept(task.engine)
    ranges = np.empty((0, 2)) if comparison is None else comparison.ranges
    mode, state = _overshooting(model, ranges)
    if mode is None:
        return step

    h, joint = model.step, model.coordinates[mode.coordinate]
    names: tuple[str, ...] = ()
    largest = None
    if model.set_step(h):
        largest = _largest_stable(
            lambda step: model.set_step(step) and _overshooting(model, ranges)[0] is None, h
        )
        model.set_step(h)
    contacts = sorted(model.contacts(state), key=lambda one: one.distance)
    if contacts and comparison is not None:
        names = tuple(map(comparison.shape_name, contacts[0].surfaces))
    touching = f" (deepest contact: {' and '.join(names)})" if names else ""
    grows = f"overshoots and grows {_growth_words(mode.growth)} a step"
    where = f"with all forces{touching}, a deviation {grows}"
    return _record(task, joint, mode.growth, (h, largest), where, shapes=names)


def _overshooting(model: WholeModel, ranges: Array) -> tuple[GrowingMode | None, WholeState]:
    """Return the mode that overshoots at the first keyframe, or as drawn, or soon after.

    Joints outside of their `ranges` (nz, 2) start 1 % inside, since the zero of a URDF may be
    outside of its limits, which would throw the robot.
    """
    *_, start = islice(model.starts, 2)
    z = start.z.copy()
    for i, (low, high) in enumerate(ranges):
        if np.isfinite([low, high]).all() and not low <= z[i] <= high:
            z[i] = np.clip(z[i], 0.99 * low + 0.01 * high, 0.01 * low + 0.99 * high)
    start = start._replace(z=z)
    later = model.moved(start, min(SETTLING_STEPS, round(SETTLING / model.step)))
    for state in (later, start):
        finite = np.isfinite(state.z).all() and np.isfinite(state.m).all()
        if finite and (mode := _whole_mode(model, state)) is not None:
            return mode, state
    return None, start


def _whole_mode(model: WholeModel, state: WholeState) -> GrowingMode | None:
    """Return the mode of steps with all forces that overshoots most at a state; None without one.

    The engine confirms it: a small deviation grows in its own steps.
    """
    n, epsilon = len(state.m), float(np.finfo(float).eps)

    def moved(values: Array) -> WholeState:
        return state._replace(z=values[:n], m=values[n:])

    def after(states: Array, step: Callable[[WholeState], WholeState]) -> Array:
        return np.array([np.concatenate(step(moved(one))[:2]) for one in states])

    here = np.concatenate([state.z, state.m])
    stepped = partial(after, step=lambda one: model.moved(one, 1))
    exactly = partial(after, step=lambda one: model.evaluate(one).after)
    with np.errstate(all="ignore"):
        wider = _fastest_mode(_step_matrix(stepped, here, epsilon))
        if wider is None:
            return None
        mode = _fastest_mode(_step_matrix(exactly, here, epsilon, central=False))
        # Forces that jump, as where a contact opens, have no slope.
        if mode is None or not 1 / ALIKE <= wider.growth / mode.growth <= ALIKE:
            return None
        pair = [moved(here), moved(here + WHOLE_DEVIATION * mode.direction)]
        grown = min(CONFIRMED, 0.8 * mode.growth) * WHOLE_DEVIATION
        for _ in range(mode.confirming_steps):  # a contact may open again
            pair = [model.moved(one, 1) for one in pair]
            apart = np.concatenate(pair[1][:2]) - np.concatenate(pair[0][:2])
            if not np.max(np.abs(apart)) < grown:
                return mode
    return None


def _stable_damping(
    target: PreparedTree, joint: str, pose: RestPose, largest: float, h: float
) -> str:
    """Return the damping of a joint that is stable at a step; empty if other forces decide."""
    share, n = largest / h, len(target.names)
    damping = {one.name: one.damping for one in target.tree.links}.get(joint, 0.0)
    links = tuple(replace(one, damping=share * one.damping) for one in target.tree.links)
    system = replace(target.system, tree=replace(target.tree, links=links))
    damped = TreeEquations(system).state_matrices(pose.state[None], pose.hold[None])[0]
    # Largest rates at which dampers stop the joints, 1/s.
    before, settling = (
        float(np.max(np.abs(np.linalg.eigvals(one[n:, n:])))) for one in (pose.matrix, damped)
    )
    if not damping or h * settling < DAMPED or settling > 1.01 * share * before:
        return ""
    stable = _rounded_down(damping * share)
    return f"damping up to {stable:g} instead of {damping:g} is stable at {duration(h)}"


def _largest_stable(stable: Callable[[float], bool], h: float) -> float | None:
    """Return the largest stable step below an unstable one, or above a stable one, s.

    None if all steps up to `LARGEST_STEP` are stable, or none is.
    """
    is_stable, near, far = stable(h), h, h
    while stable(far) == is_stable:
        near, far = far, 2 * far if is_stable else far / 2
        if far > LARGEST_STEP if is_stable else far < SMALLEST_STEP:
            return None
    low, high = sorted((near, far))
    while high > (1 + DIGITS / 2) * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return _rounded_down(low)


def _rounded_down(value: float) -> float:
    digits = 1 - math.floor(math.log10(value))
    return float(f"{math.floor(value * 10.0**digits * (1 + 1e-9)) / 10.0**digits:.6g}")


def _apart(path: Array, finer: Array) -> float:
    """Return the largest difference of two motions, (S, 2n), relative to the amplitude."""
    size = np.max(np.abs(finer), axis=0)
    largest = np.repeat(np.max(size.reshape(2, -1), axis=1), len(size) // 2)
    with np.errstate(all="ignore"):
        scale = nonzero_scale(np.maximum(size, FLOOR * largest))
        result = float(np.max(np.abs(path - finer) / scale))
    return result if math.isfinite(result) else math.inf


def _record(
    task: ModelTask[Prepared],
    joint: str,
    growth: float,
    steps: tuple[float, float | None],
    where: str,
    remedy: str = "",
    shapes: Sequence[str] = (),
) -> TimeStep:
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


def _growth_words(growth: float) -> str:
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
