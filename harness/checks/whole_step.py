"""Steps of a robot file with all its forces, compared with the law that the engine documents.

States are drawn where limits, contacts, friction and drives act. The positions of contacts are the
engine's; all other numbers are those of the file. An answer is judged by the rounding of all terms
and by a bound of the solver's error: the cost is convex in M, so |a - a*|_M <= |grad|_(M^-1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, Self, TypeVar

import numpy as np
from msgspec.structs import replace as replace_fields
from numpy.typing import NDArray

from physics_crosscheck.harness.checks.findings import format_omission
from physics_crosscheck.harness.checks.prepare import Prepared, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask
from physics_crosscheck.harness.checks.verdict import CaseJudgement, decided, motions_in_words
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    EngineStep,
    LoadedModel,
    ModelSpec,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.laws import law_model
from physics_crosscheck.harness.modelfiles.mjcf.misread import (
    MisreadNumber,
    ReadingCheck,
    check_reading,
)
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs
from physics_crosscheck.harness.modelfiles.robot import Omission
from physics_crosscheck.harness.modelfiles.urdf.laws import impulse_model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.judgement import LimitVerdict, judge
from physics_crosscheck.harness.numerics.ladder import floored
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import CaseKind, LawTerm, WholeStep
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.laws.drives import unsaturated
from physics_crosscheck.reference.laws.impulses import ImpulseModel, ImpulseStep
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.soft import gains
from physics_crosscheck.reference.laws.step import (
    DIGITS,
    STEPPED,
    LawModel,
    LawSolution,
    LawStep,
)
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.mechanism.laws import ImpulseRules
from physics_crosscheck.reference.mechanism.tree import TreeError

STATES, SEED = 24, 20261125
"""Number of states, and the seed of their draws."""

ATTEMPTS = 3
"""Draws per state; a draw with too many contacts, or that blows up, is replaced."""

MAX_CONTACTS, MAX_SPEED = 100, 1e3
"""Bounds of a drawn state: more contacts take long, and robots are slower."""

SHARE = 1e-3
"""Smallest scale of an acceleration, as a share of the largest sample."""

LEAST_GAIN = 1e-6
"""Smallest scale of a step's gain in velocity, as a share of the largest velocity."""

SPREAD = 1.5
"""Controls are drawn in this multiple of their range, so that limits act."""

DEEPEST, INSIDE = 0.02, 0.2
"""Largest violation of a limit, as a share of its range; share of joints that are inside theirs."""

MAX_OUTWARD = 50.0
"""Half of the largest speed of a joint beyond its limit, rad/s or m/s."""

SIGNS = 0, 0, 0, 1, -1
"""Sides of the ranges of all controls, in turn; 0: each on another one."""

LONG, SHORT = 600, 40
"""Largest number of steps before a state: a fall to the floor, or a change of the contacts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeStepCheck:
    """The comparison of whole steps.

    Attributes:
        record: for the results.
        judgement: of accelerations and the next state; None if nothing was compared.
        resolution: relative discrepancy that it resolves.
        misread: numbers that the compiler of the file resolves otherwise than its text.
    """

    record: WholeStep
    judgement: LimitVerdict | None = None
    resolution: float = 0.0
    misread: tuple[MisreadNumber, ...] = ()

    @property
    def _differs(self) -> bool:
        """Steps differ from the law."""
        return self.judgement is not None and self.judgement.outcome is Outcome.DIFFERS

    @property
    def kind(self) -> CaseKind:
        """Kind of a case that differs by it."""
        return "compiled number" if self.misread and not self._differs else "whole step"

    @property
    def locations(self) -> tuple[SourceLine, ...]:
        """Lines of misread numbers; a law has no single line."""
        places = dict.fromkeys((one.file, one.line) for one in self.misread if one.line)
        return tuple(SourceLine(file=str(file), line=line) for file, line in places)

    def combined(self, verdict: CaseJudgement) -> CaseJudgement:
        """Combine the verdict on a motion with this one: a difference in either counts."""
        judged, record = self.judgement, self.record
        if verdict.outcome is Outcome.DIFFERS:
            return verdict
        if self.misread:
            return self._misread(verdict)
        if judged is None or not self._differs:
            return verdict
        return decided(
            verdict,
            judged,
            by="whole steps",
            kind=self.kind,
            component=record.component,
            reason=(
                f"with limits, friction, contacts and drives, {record.component} is off by"
                f" {judged.discrepancy:.2e} of its largest value at"
                f" {counted(record.states, 'state')}; the uncertainty is"
                f" {judged.uncertainty:.1e}; {motions_in_words(verdict)}"
            ),
            resolution=self.resolution,
        )

    def _misread(self, verdict: CaseJudgement) -> CaseJudgement:
        """Return the verdict of numbers that the engine compiles otherwise."""
        first, unsure = self.misread[0], np.finfo(float).eps
        off = max(one.discrepancy for one in self.misread)
        more = f", and {len(self.misread) - 1} more" if len(self.misread) > 1 else ""
        return decided(
            verdict,
            LimitVerdict(
                outcome=Outcome.DIFFERS, unresolved_reason=None, segment=0, component=0,
                discrepancy=off, uncertainty=unsure, below_resolution=False,
                largest_discrepancy=off, largest_uncertainty=unsure,
            ),
            by="whole steps",
            kind=self.kind,
            component=first.subject,
            reason=f"{first.file.name}:{first.line}: {first.sentence}{more};"
            f" {motions_in_words(verdict)}",
            resolution=self.resolution,
        )  # fmt: skip


M = TypeVar("M", bound=LawModel | ImpulseModel)
S = TypeVar("S", LawSolution, ImpulseStep)
"""The laws, and their solution at one state."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluated(Generic[S]):
    """The laws and the engine at one state, in the order of the tree's velocities."""

    state: WholeState
    solution: S
    engine: EngineStep

    @property
    def acceleration(self) -> Array:
        """The solution of the laws, (nv,)."""
        return self.solution.acceleration


@dataclass(frozen=True, kw_only=True, eq=False)
class LawDefect:
    """Engine minus laws at S states, relative to the scale of each component.

    Attributes:
        defect, uncertainty: (S, C).
        scale: of accelerations and the next state, (C,).
    """

    defect: Array
    uncertainty: Array
    scale: Array

    def at_states(self, kept: NDArray[np.bool_]) -> LawDefect:
        """Return the defects at some states, at the same scale."""
        return replace(self, defect=self.defect[kept], uncertainty=self.uncertainty[kept])

    def relative_to(self, scale: Array) -> LawDefect:
        """Return the defects relative to another scale, (C,)."""
        ratio = self.scale / scale
        return LawDefect(
            defect=self.defect * ratio, uncertainty=self.uncertainty * ratio, scale=scale
        )

    def resolved(self, resolution: float) -> NDArray[np.bool_]:
        """Return the states with bounds below the resolution, or that differ, (S,).

        Return all states if these are fewer than half.
        """
        fine: NDArray[np.bool_] = np.max(self.uncertainty, axis=1) <= resolution
        kept = fine | np.any(np.abs(self.defect) > self.uncertainty, axis=1)
        return kept if 2 * np.sum(kept) >= len(kept) else np.ones_like(kept)


class WholeStepComparison(ABC, Generic[M, S]):
    """Laws and an engine that loaded their file.

    Args:
        laws: on the file's bodies.
        model: the file in the engine.

    Attributes:
        names: of the coordinates, in the tree's order.
        order: their indices among the engine's.

    Raises:
        TreeError: if the engine's joints are not those of the file.
    """

    def __init__(self, laws: M, model: WholeModel) -> None:
        self.laws, self.model = laws, model
        links = laws.tree.tree.links
        self.names = tuple(
            name for link in links for name, _ in coordinate_names(link.kind, link.name)
        )
        if set(self.names) != set(model.coordinates):
            raise TreeError("joints that the engine names otherwise")
        self.order = [model.coordinates.index(name) for name in self.names]

    def under(self, laws: M) -> Self:
        """Return the comparison of other laws with the same engine."""
        return type(self)(laws, self.model)

    def of_engine(self, model: WholeModel) -> Self:
        """Return the comparison of the same laws with another engine."""
        return type(self)(self.laws, model)

    @property
    @abstractmethod
    def steps(self) -> bool:
        """True if the next state has a rule."""

    @property
    @abstractmethod
    def drives(self) -> int:
        """Number of drives."""

    @abstractmethod
    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return controls and states at which drives exert shares of their limits."""

    @abstractmethod
    def solve(self, posture: Posture, state: WholeState, engine: EngineStep) -> S:
        """Solve the laws at a state."""

    @abstractmethod
    def expected(self, sample: Evaluated[S]) -> Array:
        """Return the components by the laws, (C,)."""

    def outward_speed(self, state: WholeState, outwards: Array) -> Array:
        """Return speeds at which limits act although other forces pull joints back, (nz,).

        `outwards` are the signs of the joints that are beyond a limit, 0 for others, (nz,).
        """
        return np.zeros(len(outwards))

    @property
    def rotations(self) -> Iterator[int]:
        """Indices of the coordinates that are rotations, in the engine's order."""
        tree = self.laws.tree.tree
        for link, there in zip(tree.links, tree.velocities, strict=True):
            count = {"free": 3, "ball": 3, "hinge": 1}.get(link.kind, 0)
            yield from self.order[there.start : there.start + count]

    def postures(self, states: Sequence[WholeState]) -> Iterator[Posture]:
        """Yield the tree at each state."""
        y, m = (np.array([state[k][self.order] for state in states]) for k in range(2))
        return self.laws.tree.postures(y, m)

    def evaluate(self, states: Sequence[WholeState]) -> list[Evaluated[S]]:
        """Evaluate the engine and the laws at states."""
        result = []
        for state, posture in zip(states, self.postures(states), strict=True):
            engine = self.model.evaluate(state)
            solution = self.solve(posture, state, engine)
            result.append(Evaluated(state=state, solution=solution, engine=engine))
        return [sample for sample in result if sample.solution.converged]

    def judge(self, compared: LawDefect, resolution: float) -> LimitVerdict:
        """Judge accelerations, the next velocities and positions, and states of drives."""
        kept = compared.resolved(resolution)
        uncertainty = np.maximum(compared.uncertainty[kept], np.finfo(float).eps)
        return judge(np.abs(compared.defect[kept]), uncertainty, resolution, None)

    def compare(self, evaluated: Sequence[Evaluated[S]]) -> LawDefect:
        """Compare accelerations, the next velocities and positions, and states of drives."""
        speeds = [
            np.maximum(np.abs(sample.solution.posture.m), np.abs(sample.engine.after.m[self.order]))
            for sample in evaluated
        ]
        speed, h = floored(np.max(speeds, axis=0)), self.model.step
        size = np.max([np.abs(sample.acceleration) for sample in evaluated], axis=0)
        # Of a joint that nothing accelerates, only rounding is left.
        scale = np.maximum(size, np.maximum(SHARE * np.max(size), LEAST_GAIN * speed / h))
        parts = [scale]
        if self.steps:
            drives = np.ones(self.model.activations)
            parts += [h * scale, h * speed, drives]
        whole = np.concatenate(parts)
        defect = [self._answer(sample) - self.expected(sample) for sample in evaluated]
        unsure = [self._uncertainty(sample) for sample in evaluated]
        return LawDefect(
            defect=np.array(defect) / whole, uncertainty=np.array(unsure) / whole, scale=whole
        )

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the judged components."""
        names: list[str] = [f"{name}_ddot" for name in self.names]
        if self.steps:
            names += [f"{name}_dot" for name in self.names] + list(self.names)
            names += [f"state {i + 1} of the drives" for i in range(self.model.activations)]
        return tuple(names)

    def velocity_uncertainty(self, sample: Evaluated[S], unsure: Array) -> Array:
        """Return the uncertainty of the next velocities, (nv,), from that of accelerations."""
        return self.model.step * unsure

    def _answer(self, sample: Evaluated[S]) -> Array:
        """Return the components by the engine, (C,)."""
        engine, order = sample.engine, self.order
        parts: list[Array] = [engine.acceleration[order]]
        if self.steps:
            after = engine.after
            parts += [after.m[order], after.z[order], after.activations / state_sizes(engine)]
        return np.concatenate(parts)

    def _uncertainty(self, sample: Evaluated[S]) -> Array:
        """Return the uncertainty of each component, (C,)."""
        order, posture = self.order, sample.solution.posture
        eps, h = np.finfo(float).eps, self.model.step
        unsure = sample.solution.law.uncertainty(
            sample.acceleration, sample.engine.unbalanced[order]
        )
        if not self.steps:
            return unsure
        after = sample.engine.after
        speed, y = np.abs(after.m[order]), after.z[order]
        turned = 1 + np.abs(y) + y**2  # a last digit of a rotation's coordinate
        return np.concatenate(
            [
                unsure,
                self.velocity_uncertainty(sample, unsure) + eps * (np.abs(posture.m) + speed),
                DIGITS * eps * (h * speed + turned),
                np.full(len(after.activations), DIGITS * eps),
            ]
        )


class LawComparison(WholeStepComparison[LawModel, LawSolution]):
    """The convex laws of a file, and an engine that loaded it."""

    @property
    def steps(self) -> bool:
        """True if the next state has a rule."""
        return self.laws.laws.integrator in STEPPED

    @property
    def drives(self) -> int:
        """Number of drives."""
        return len(self.laws.laws.drives)

    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return controls and states at which drives exert shares of their limits."""
        laws = self.laws
        return unsaturated(laws.laws, posture, laws.weights.path_accelerations, shares)

    def solve(self, posture: Posture, state: WholeState, engine: EngineStep) -> LawSolution:
        """Solve the laws at a state, from the engine's accelerations."""
        start = engine.acceleration[self.order]
        contacts = engine.contacts
        return self.laws.solve(posture, state.controls, state.activations, contacts, start)

    def outward_speed(self, state: WholeState, outwards: Array) -> Array:
        """Return the speeds at which the reference of each limit resists the free acceleration."""
        laws = self.laws.laws
        posture = next(self.postures([state]))
        free = self.laws.evaluate(posture, state.controls, state.activations, ()).problem.free
        speed = np.zeros(len(outwards))
        for limit in laws.limits:
            if limit.joint >= 0:
                there = self.laws.tree.tree.velocities[limit.joint].start
                place, softness = self.order[there], limit.softness
                damping = gains(softness.reference, softness.impedance[1], laws.step,
                                safe=laws.safe)[1]  # fmt: skip
                back = max(0.0, -outwards[place] * float(free[there]))
                speed[place] = outwards[place] * min(MAX_OUTWARD, back / damping)
        return speed

    def velocity_uncertainty(self, sample: Evaluated[LawSolution], unsure: Array) -> Array:
        """Return the uncertainty of the next velocities, (nv,), from that of accelerations."""
        return self.laws.velocity_uncertainty(sample.solution.law, sample.acceleration, unsure)

    def expected(self, sample: Evaluated[LawSolution]) -> Array:
        """Return the components by the laws, (C,)."""
        return self.predict(sample.solution.law, sample.acceleration, sample.engine)

    def predict(self, law: LawStep, acceleration: Array, engine: EngineStep) -> Array:
        """Return the components by the laws, (C,), with states of drives relative to their size.

        The positions follow from the engine's velocities, so that each component is judged alone.
        """
        velocity = self.laws.advance(law, acceleration)
        if velocity is None:
            return acceleration
        y, after = law.posture.y[None], engine.after.m[self.order][None]
        position = self.laws.tree.advance(y, after, self.model.step)[0]
        states = law.driven.states / state_sizes(engine)
        return np.concatenate([acceleration, velocity, position, states])


class ImpulseComparison(WholeStepComparison[ImpulseModel, ImpulseStep]):
    """The impulses of a file, and an engine that loaded it."""

    steps = True

    @property
    def drives(self) -> int:
        """Number of motors."""
        return len(self.laws.laws.rules.controls)

    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return targets at which motors exert shares of their efforts."""
        return self.laws.unsaturated(posture, shares), np.zeros(0)

    def solve(self, posture: Posture, state: WholeState, engine: EngineStep) -> ImpulseStep:
        """Return the rows at a state, from the engine's contacts."""
        return self.laws.solve(posture, state.controls, engine.contacts)

    def expected(self, sample: Evaluated[ImpulseStep]) -> Array:
        """Return the components by the law, (C,)."""
        a, after = sample.acceleration, sample.engine.after.m[self.order]
        return np.concatenate([a, *self.laws.next_state(sample.solution, a, after)])


def state_sizes(engine: EngineStep) -> Array:
    """Return the size of each state of the drives, (states,)."""
    sizes: Array = 1 + np.abs(engine.after.activations)
    return sizes


def case_whole_step(
    task: ModelTask[Prepared], _model: LoadedModel, _coordinates: CoordinateMap
) -> WholeStepCheck | None:
    """Compare whole steps of a robot file, unless only its smooth forces are asked for."""
    target = task.target
    if task.sidecar is not None or not isinstance(target, PreparedTree) or target.smooth:
        return None
    engine = engines()[task.engine]
    usual = {*engine.switches, *engine.settings_for(target.place.suffix), "floating", "model"}
    if set(task.spec.settings) - usual:
        return None  # the laws are those of the file as it is shipped
    return check_whole_step(target.place, task.spec, task.engine, task.resolution)


def check_whole_step(
    file: Path, spec: ModelSpec, engine: str, resolution: float
) -> WholeStepCheck | None:
    """Compare whole steps of a file; None if the engine has no documented law for it.

    Args:
        file: whose numbers the law takes.
        spec: what the engine loads: the same file, or a changed copy, with its settings.
        engine: name of the engine.
        resolution: relative discrepancy to resolve.
    """
    try:
        # With its shapes for contacts, whose files the smooth forces do not need.
        model = engines()[engine].load_whole(spec)
        if model is None:
            return None
        if model.rules is not None:
            return _check_impulses(file, spec, model, model.rules, resolution)
        return _check_laws(file, model, resolution)
    except (TreeError, EngineError) as error:
        return WholeStepCheck(record=WholeStep(uncovered=(str(error),)))


def _check_laws(file: Path, model: WholeModel, resolution: float) -> WholeStepCheck:
    """Compare steps by convex laws, and the numbers of these with the text of the file."""
    reader = compiler(file.suffix)
    assert reader is not None  # it read the file before
    compiled = reader.compiled(file)
    laws = law_model(compiled)
    if laws is None:
        return WholeStepCheck(record=WholeStep())
    reading = check_reading(file, compiled, laws)
    if laws.laws.uncovered:
        check = WholeStepCheck(record=WholeStep(uncovered=laws.laws.uncovered))
    else:
        covered = tuple(
            format_omission(Omission(what=what, count=count, where=()))
            for what, count in compiled.besides
        )
        check = _check(LawComparison(laws, model), covered, resolution)
    return _with_reading(check, reading)


def _with_reading(check: WholeStepCheck, reading: ReadingCheck) -> WholeStepCheck:
    record = replace_fields(
        check.record,
        stated=reading.compared,
        misread=tuple(one.sentence for one in reading.misread),
        unread=reading.unread,
    )
    return replace(check, record=record, misread=reading.misread)


def _check_impulses(
    file: Path, spec: ModelSpec, model: WholeModel, rules: ImpulseRules, resolution: float
) -> WholeStepCheck:
    """Compare steps by impulses."""
    laws = impulse_model(read_as_it_runs(file, {**spec.settings, "couplings": False}), rules)
    if laws is None:
        return WholeStepCheck(record=WholeStep())
    return _check(ImpulseComparison(laws, model), IMPULSES, resolution)


def _check(
    comparison: WholeStepComparison[M, S], covered: tuple[str, ...], resolution: float
) -> WholeStepCheck:
    """Compare steps at drawn states.

    Raises:
        EngineError: if no state is comparable.
    """
    states = tuple(drawn_states(comparison))
    if not states:
        raise EngineError("no drawn state is finite with few contacts")
    evaluated = comparison.evaluate(states)
    if not evaluated:
        raise EngineError("impulses that do not converge")
    compared, model = comparison.compare(evaluated), comparison.model
    judged = comparison.judge(compared, resolution)
    record = WholeStep(
        outcome=judged.outcome,
        discrepancy=number(judged.discrepancy),
        uncertainty=number(judged.uncertainty),
        component=comparison.components[judged.component],
        states=int(np.sum(compared.resolved(resolution))),
        step=number(model.step),
        next_state=comparison.steps,
        acted=tuple(LawTerm(name=name, count=count) for name, count in _acted(evaluated)),
        edits=model.edits,
        covered=covered,
        uncovered=model.uncovered,
    )
    return WholeStepCheck(record=record, judgement=judged, resolution=resolution)


IMPULSES = ("limits of position", "limits of effort", "collision geometry")
"""Parts of a file that only steps by impulses compare."""


def drawn_states(
    comparison: WholeStepComparison[M, S], count: int = STATES
) -> Iterator[WholeState]:
    """Yield states in which limits, contacts and drives act.

    In turn: after a fall or a motion from a state of the file, with some joints that move beyond
    their limits, and at positions anywhere in the joints' ranges. Every other state has controls at
    which drives are not at a limit.
    """
    rng, model = np.random.default_rng(SEED), comparison.model
    starts = list(model.starts)
    for k in range(count):
        start = starts[k % len(starts)]
        for attempt in range(ATTEMPTS):
            state = _driven(model, rng, start, k // 2)
            match k % 3:
                case 0:
                    moved = _fallen(comparison, rng, state, 0 if attempt else k)
                case 1:
                    moved = _beyond(comparison, rng, state, k // 3)
                case _:
                    moved = state._replace(z=_anywhere(model, rng, state.z))
            speed = model.speed * rng.normal(size=len(moved.m))
            drawn = moved._replace(m=moved.m + speed)
            if k % 2:
                drawn = _unsaturated(comparison, rng, drawn)
            if model.rules is not None:
                drawn = _pressed(model, model.rules, drawn)
            if _usable(model, drawn):
                yield drawn
                break


def _usable(model: WholeModel, state: WholeState) -> bool:
    """Return whether a state is finite, not too fast, and has few contacts."""
    values = np.concatenate([state.z, state.m, state.activations])
    if not np.all(np.isfinite(values)) or np.max(np.abs(values), initial=0.0) > MAX_SPEED:
        return False
    step = model.evaluate(state)
    finite = np.isfinite(step.acceleration).all() and np.isfinite(step.after.m).all()
    return bool(finite) and step.converged and len(step.contacts) <= MAX_CONTACTS


def _driven(
    model: WholeModel, rng: np.random.Generator, start: WholeState, turn: int
) -> WholeState:
    """Return a start with random velocities, controls and states of drives.

    In turn, the controls are inside and beyond both ends of their ranges, then all on one side, so
    that limits of sums act: each control is beyond each end in some of the turns.
    """
    places = (np.arange(model.controls) + turn) % 3 - 1
    sign = SIGNS[turn % len(SIGNS)]
    inside, outside = rng.uniform(-1, 1, (2, model.controls)) + 0 * start.controls  # NaN: off
    beyond = (SPREAD + 1) / 2 + (SPREAD - 1) / 2 * outside
    share = np.where(places == 0, inside, places * beyond)
    if sign:
        share = sign * SPREAD * np.abs(inside)
    lower, upper = model.ranges[1].T
    limited = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(limited, lower, -1.0), np.where(limited, upper, 1.0)
    middle, half = (low + high) / 2, (high - low) / 2
    return WholeState(
        z=start.z,
        m=0.3 * rng.normal(size=len(start.m)),
        controls=middle + half * share,
        activations=start.activations + rng.uniform(0, 1, model.activations),
    )


def _fallen(
    comparison: WholeStepComparison[M, S], rng: np.random.Generator, state: WholeState, turn: int
) -> WholeState:
    """Return the state after some steps.

    After the first turn a motion is long. It begins with other rotations of free and ball joints,
    and of hinges without limits, so that each side may touch.
    """
    model = comparison.model
    if not turn:
        return model.moved(state, int(rng.integers(1, SHORT)))
    z = state.z.copy()
    for place in comparison.rotations:
        if np.any(np.isinf(model.ranges[0][place])):
            z[place] += rng.normal()
    return model.moved(state._replace(z=z), int(rng.integers(LONG // 2, LONG)))


def _unsaturated(
    comparison: WholeStepComparison[M, S], rng: np.random.Generator, state: WholeState
) -> WholeState:
    """Return a state with controls at which no drive is at a limit."""
    posture = next(comparison.postures([state]))
    shares = rng.uniform(-0.8, 0.8, comparison.drives)
    controls, activations = comparison.unsaturated(posture, shares)
    chosen = np.isfinite(controls) & np.isfinite(state.controls)
    return state._replace(
        controls=np.where(chosen, controls, state.controls),
        activations=np.where(np.isfinite(activations), activations, state.activations),
    )


def _pressed(model: WholeModel, rules: ImpulseRules, state: WholeState) -> WholeState:
    """Return a state whose joints beyond their limits move outward, and are not driven back."""
    low, high = model.ranges[0].T
    outward = np.sign(np.maximum(state.z - high, 0.0) - np.maximum(low - state.z, 0.0))
    controls = state.controls.copy()
    for i, name in enumerate(rules.controls):
        place = model.coordinates.index(name) if name in model.coordinates else -1
        if place >= 0 and outward[place] and np.isfinite(controls[i]):
            controls[i] = state.z[place]
    m = np.where(outward, outward * np.abs(state.m), state.m)
    return state._replace(m=m, controls=controls)


def _beyond(
    comparison: WholeStepComparison[M, S], rng: np.random.Generator, state: WholeState, turn: int
) -> WholeState:
    """Return a state with half of the limited joints at a limit, up to 2 % beyond it.

    The turns put each joint at both of its limits.
    """
    z, count = state.z, len(state.z)
    ranges, place = comparison.model.ranges[0], np.arange(count) + turn
    chosen = np.isfinite(ranges).all(axis=1) & (place % 2 == 0)
    end = place // 2 % 2
    width = np.where(chosen, ranges[:, 1] - ranges[:, 0], 0.0)
    bound = np.where(chosen, ranges[np.arange(count), end], z)
    outwards = np.where(chosen, 2 * end - 1, 0)
    sign = np.where(rng.uniform(size=count) < INSIDE, -1, 1)
    depth = sign * width * DEEPEST * 10 ** rng.uniform(-2, 0, count)
    moved = state._replace(z=bound + outwards * depth)
    speed = comparison.outward_speed(moved, outwards) * rng.uniform(1, 2, count)
    return moved._replace(m=state.m + speed)


def _anywhere(model: WholeModel, rng: np.random.Generator, z: Array) -> Array:
    """Return positions anywhere in the joints' ranges."""
    ranges = model.ranges[0]
    limited = np.isfinite(ranges).all(axis=1)
    low, high = (np.where(limited, end, 0.0) for end in ranges.T)
    place = low + (high - low) * rng.uniform(size=len(z))
    return np.where(limited, place, z)


def _acted(evaluated: Sequence[Evaluated[S]]) -> Iterator[tuple[str, int]]:
    """Yield how often forces of each kind acted."""
    count: Counter[str] = Counter()
    for sample in evaluated:
        count.update(dict(sample.solution.law.acted(sample.acceleration)))
    yield from ((name, times) for name, times in count.items() if times)
