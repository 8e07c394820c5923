"""An engine's steps with all forces, and the law that it documents, component by component.

An answer is judged by the rounding of all terms and by a bound of the solver's error: the cost is
convex in M, so |a - a*|_M <= |grad|_(M^-1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineStep,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.numerics.judgement import LimitVerdict, judge
from physics_crosscheck.harness.numerics.ladder import floored
from physics_crosscheck.reference.laws.drives import eased, holding, unsaturated
from physics_crosscheck.reference.laws.impulses import ImpulseModel, ImpulseStep
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.soft import WITHIN, Part, gains, varies
from physics_crosscheck.reference.laws.step import (
    DIGITS,
    STEPPED,
    LawModel,
    LawSolution,
    LawStep,
)
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.mechanism.laws import ImpulseContact
from physics_crosscheck.reference.mechanism.tree import TreeError

SHARE = 1e-3
"""Smallest scale of an acceleration, as a share of the largest sample."""

LEAST_GAIN = 1e-6
"""Smallest scale of a step's gain in velocity, as a share of the largest velocity."""

DEEPEST = 0.02
"""Largest violation of a limit, as a share of its range."""

NEWTON_STEPS, LARGEST_STEP = 10, 0.3
"""Iterations that put a tendon or an equality at a violation, and the largest one, rad or m."""

MAX_OUTWARD = 50.0
"""Half of the largest speed of a joint beyond its limit, rad/s or m/s."""

MAX_FORCED = 300.0
"""The same of a joint that other forces pull back so much that its limit never acted."""

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

    def at_states(self, kept: NDArray[np.bool_] | slice) -> LawDefect:
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
        drives, shapes: names of drives and of the surfaces of contacts, if they are known.

    Attributes:
        names: of the coordinates, in the tree's order.
        order: their indices among the engine's.

    Raises:
        TreeError: if the engine's joints are not those of the file.
    """

    def __init__(
        self,
        laws: M,
        model: WholeModel,
        *,
        drives: Sequence[str] = (),
        shapes: Sequence[str] = (),
    ) -> None:
        self.laws, self.model = laws, model
        self._drives, self._shapes = drives, shapes
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

    def expected_by(self, laws: M, evaluated: Sequence[Evaluated[S]]) -> Array:
        """Return the components by other laws at evaluated states, (S, C)."""
        other, rows = self.under(laws), list[Array]()
        states = [sample.state for sample in evaluated]
        same = laws.tree is self.laws.tree
        postures = (s.solution.posture for s in evaluated) if same else other.postures(states)
        for sample, posture in zip(evaluated, postures, strict=True):
            again = other.solve_again(posture, sample)
            rows.append(other.expected(replace(sample, solution=again)))
        return np.array(rows)

    def solve_again(self, posture: Posture, sample: Evaluated[S]) -> S:
        """Solve these laws at a state that is solved for others."""
        return self.solve(posture, sample.state, sample.engine)

    @abstractmethod
    def limits(self) -> Iterator[tuple[int, float, float]]:
        """Yield joints with their lower and upper limits, infinite without one."""

    @abstractmethod
    def efforts(self, sample: Evaluated[S]) -> Iterator[tuple[int, float, float]]:
        """Yield joints with the force of a drive and its limit in that direction."""

    def elements(self) -> Iterator[tuple[str, str]]:
        """Yield the kind and the name of the elements of the laws that may act."""
        return iter(())

    @abstractmethod
    def acting_elements(self, sample: Evaluated[S]) -> Iterator[tuple[str, str]]:
        """Yield the kind and the name of the elements that act at a state."""

    def shape_name(self, index: int) -> str:
        """Return the name of a surface of contacts."""
        return self._shapes[index] if index < len(self._shapes) else f"shape {index}"

    def outward_speed(
        self, state: WholeState, outwards: Array, largest: float = MAX_OUTWARD
    ) -> Array:
        """Return speeds at which limits act although other forces pull joints back, (nz,).

        `outwards` are the signs of the joints that are beyond a limit, 0 for others, (nz,).
        No speed is above the largest one.
        """
        return np.zeros(len(outwards))

    @property
    def hardening(self) -> Array:
        """Margins of limits, and the widths over which they harden, (nz, 2); 0 without one."""
        return np.zeros((len(self.order), 2))

    @property
    @abstractmethod
    def drive_ranges(self) -> tuple[Array, Array]:
        """Ranges of controls, (controls, 2), and of states of drives, (activations, 2)."""

    @cached_property
    def ranges(self) -> Array:
        """Ranges of the engine's coordinates by the file, (nz, 2); infinite without one."""
        tree = self.laws.tree.tree
        result = np.tile([-np.inf, np.inf], (len(self.order), 1))
        for joint, lower, upper in self.limits():
            if tree.links[joint].kind in ("hinge", "slide"):
                result[self.order[tree.velocities[joint].start]] = lower, upper
        return result

    @cached_property
    def balls(self) -> tuple[tuple[list[int], float], ...]:
        """The engine's coordinates of each limited ball joint, and its largest angle."""
        tree = self.laws.tree.tree
        return tuple(
            (self.order[tree.velocities[joint]], max(lower, upper))
            for joint, lower, upper in self.limits()
            if tree.links[joint].kind == "ball"
        )

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
        return self.solve_steps([(state, self.model.evaluate(state)) for state in states])

    def solve_steps(self, steps: Sequence[tuple[WholeState, EngineStep]]) -> list[Evaluated[S]]:
        """Evaluate the laws at states with the engine's steps."""
        result = []
        postures = self.postures([state for state, _ in steps]) if steps else iter(())
        for (state, engine), posture in zip(steps, postures, strict=True):
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
        defect = [self.answer(sample) - self.expected(sample) for sample in evaluated]
        unsure = [self.uncertainty(sample) for sample in evaluated]
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

    def answer(self, sample: Evaluated[S]) -> Array:
        """Return the components by the engine, (C,)."""
        engine, order = sample.engine, self.order
        parts: list[Array] = [engine.acceleration[order]]
        if self.steps:
            after = engine.after
            parts += [after.m[order], after.z[order], after.activations / state_sizes(engine)]
        return np.concatenate(parts)

    def uncertainty(self, sample: Evaluated[S]) -> Array:
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
    """The convex laws of a file, with the choices of an engine that loaded it."""

    def __init__(self, laws: LawModel, model: WholeModel, **names: Sequence[str]) -> None:
        super().__init__(applied(laws, model), model, **names)

    @property
    def steps(self) -> bool:
        """True if the next state has a rule."""
        return self.laws.laws.integrator in STEPPED

    @property
    def drives(self) -> int:
        """Number of drives."""
        return len(self.laws.laws.drives)

    @property
    def drive_ranges(self) -> tuple[Array, Array]:
        """Ranges of controls and of states of drives, infinite without one."""
        counts = self.model.controls, self.model.activations
        controls, states = (np.tile([-np.inf, np.inf], (count, 1)) for count in counts)
        for drive in self.laws.laws.drives:
            if drive.control_range is not None:
                controls[drive.control] = drive.control_range
            if drive.state >= 0 and drive.state_range is not None:
                states[drive.state] = drive.state_range
        return controls, states

    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return controls and states at which drives exert shares of their limits."""
        laws = self.laws
        return unsaturated(laws.laws, posture, laws.weights.path_accelerations, shares)

    def solve(self, posture: Posture, state: WholeState, engine: EngineStep) -> LawSolution:
        """Solve the laws at a state, from the engine's accelerations."""
        start = engine.acceleration[self.order]
        residual = None if engine.solver_residual is None else engine.solver_residual[self.order]
        inputs = state.controls, state.activations, engine.contacts
        return self.laws.solve(posture, *inputs, start, residual)

    def elements(self) -> Iterator[tuple[str, str]]:
        """Yield limits, drives, clamps, dry friction, equalities, and shapes of moving bodies."""
        laws, pairs = self.laws.laws, self.laws.laws.pairs
        yield from (self._element(part) for part in self.laws.parts())
        yield from (("equality", str(i + 1)) for i in range(len(laws.equalities)))
        yield from (("drive", self._drive(i)) for i, drive in enumerate(laws.drives) if drive.on)
        paired = {i for first, other, _ in pairs for i in (first, other)}
        for i, surface in enumerate(laws.surfaces):
            if surface.body and (any(surface.masks) or i in paired):
                yield "contact", self.shape_name(i)
        yield from (("contact", self.shape_name(i)) for i in range(1, len(laws.compliant)))

    def acting_elements(self, sample: Evaluated[LawSolution]) -> Iterator[tuple[str, str]]:
        """Yield the elements that act at a state; both shapes of a contact do."""
        for part in self.laws.acting(sample.solution):
            if part.kind == "contact":
                surfaces = sample.solution.contacts[part.place].surfaces
                yield from (("contact", self.shape_name(i)) for i in surfaces)
            else:
                yield self._element(part)
        for i in np.flatnonzero(sample.solution.law.driven.forces):
            yield "drive", self._drive(int(i))

    def _element(self, part: Part) -> tuple[str, str]:
        """Return the kind and the name of the element that a part belongs to."""
        laws, links = self.laws.laws, self.laws.tree.tree.links
        if part.kind in ("limit", "dry friction"):
            row = (laws.limits if part.kind == "limit" else laws.frictions)[part.place]
            name = links[row.joint].name if row.joint >= 0 else f"tendon {row.path + 1}"
            return part.kind, name
        match part.kind:
            case "control" | "state" | "force":
                return "clamp", self._drive(part.place)
            case "joint force":
                return "clamp", links[part.place].name
            case "tendon force":
                return "clamp", f"tendon force {part.place + 1}"
        return part.kind, str(part.place + 1)

    def _drive(self, index: int) -> str:
        names = self._drives
        return names[index] if index < len(names) and names[index] else f"drive {index + 1}"

    def missing_parts(self, evaluated: Sequence[Evaluated[LawSolution]]) -> set[Part]:
        """Return the parts of the laws that act at none of these states, of those that may."""
        acted = (part for sample in evaluated for part in self.laws.acting(sample.solution))
        return set(self.laws.parts()) - set(acted)

    def acting(self, posture: Posture, state: WholeState) -> set[Part]:
        """Return the parts of the laws that act at a state, without contacts."""
        start = np.zeros(len(posture.m))
        return set(
            self.laws.acting(self.laws.solve(posture, state.controls, state.activations, (), start))
        )

    def eased(self, states: Sequence[WholeState]) -> Iterator[WholeState]:
        """Yield states with other positions and velocities, which ease drives at limits."""
        laws, scale = self.laws.laws, self.laws.weights.path_accelerations
        for state, posture in self._with_postures(states):
            moved, sped = eased(laws, posture, scale, state.controls, state.activations)
            z, m = state.z.copy(), state.m.copy()
            z[self.order] += moved
            m[self.order] += sped
            yield state._replace(z=z, m=m)

    def at_limit(
        self, state: WholeState, part: Part, share: float, speed: float, *, forced: bool = False
    ) -> WholeState:
        """Return a state beyond a limit, moving outward.

        Args:
            state: to start from.
            part: of the limit.
            share: of the largest violation, or of the width of the impedance.
            speed: rad/s or m/s.
            forced: whether so fast that the limit acts although other forces pull the joint back.
        """
        limit, tree = self.laws.laws.limits[part.place], self.laws.tree.tree
        way = -1 if part.way < 0 else 1
        end, depth = (limit.lower, limit.upper)[way > 0], DEEPEST * (limit.upper - limit.lower)
        if part.way == WITHIN:
            depth = limit.softness.impedance[2]
        beyond = end + way * (share * depth - (part.way == WITHIN) * limit.margin)
        if limit.joint < 0:

            def miss(posture: Posture) -> tuple[Array, Array]:
                length = posture.lengths[limit.path]
                return posture.rows[limit.path][None], np.array([length - beyond])

            moved = self._moved_to(state, miss)
            row, _ = miss(next(self.postures([moved])))
            moved.m[self.order] = way * (speed + forced * MAX_OUTWARD) * np.linalg.pinv(row)[:, 0]
            return moved
        there = self.order[tree.velocities[limit.joint]]
        if tree.links[limit.joint].kind == "ball":
            return turned(state, there, abs(beyond), speed + forced * MAX_OUTWARD)
        z, m, (place,) = state.z.copy(), state.m.copy(), there
        z[place] = beyond
        if forced:
            outwards = np.zeros(len(z))
            outwards[place] = way
            least = self.outward_speed(state._replace(z=z), outwards, MAX_FORCED)[place]
            speed = max(speed, 1.5 * abs(least))
        m[place] = way * speed
        return state._replace(z=z, m=m)

    def near_equality(self, state: WholeState, part: Part, share: float) -> WholeState:
        """Return a state that violates an equality by a share of the width of its impedance."""
        equality = self.laws.laws.equalities[part.place]
        single = self.laws.under(
            replace(self.laws.laws, equalities=(equality,), frictions=(), limits=())
        )

        def miss(posture: Posture) -> tuple[Array, Array]:
            rows = single.rows(posture, ())
            violation = np.array(rows.violations)
            size = max(float(np.linalg.norm(violation)), np.finfo(float).tiny)
            wanted = share * equality.softness.impedance[2] * violation / size
            return np.array(rows.jacobian), violation - wanted

        return self._moved_to(state, miss)

    def _moved_to(
        self, state: WholeState, miss: Callable[[Posture], tuple[Array, Array]]
    ) -> WholeState:
        """Return a state whose positions are moved by Newton's method, by rows and their errors."""
        for _ in range(NEWTON_STEPS):
            row, error = miss(next(self.postures([state])))
            state = state._replace(z=state.z.copy(), m=state.m.copy())
            moved = np.linalg.pinv(row) @ error
            largest = max(float(np.max(np.abs(moved))), np.finfo(float).tiny)
            state.z[self.order] -= min(1.0, LARGEST_STEP / largest) * moved
        return state

    def held(self, states: Sequence[WholeState]) -> Iterator[WholeState]:
        """Yield states whose drives balance the other forces along their paths."""
        for state, posture in self._with_postures(states):
            scale = self.laws.weights.path_accelerations
            yield state.driven_by(*holding(self.laws.laws, posture, scale))

    def _with_postures(self, states: Sequence[WholeState]) -> Iterator[tuple[WholeState, Posture]]:
        return zip(states, self.postures(states), strict=True) if states else iter(())

    def outward_speed(
        self, state: WholeState, outwards: Array, largest: float = MAX_OUTWARD
    ) -> Array:
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
                outward = back / damping if damping else np.inf
                speed[place] = outwards[place] * min(largest, outward)
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

    @property
    def hardening(self) -> Array:
        """Margins of limits, and the widths over which they harden, (nz, 2); 0 without one."""
        result = np.zeros((len(self.order), 2))
        for limit in self.laws.laws.limits:
            if limit.joint >= 0 and varies(limit.softness):
                places = self.order[self.laws.tree.tree.velocities[limit.joint]]
                result[places] = limit.margin, limit.softness.impedance[2]
        return result

    def limits(self) -> Iterator[tuple[int, float, float]]:
        """Yield joints with their lower and upper limits, infinite without one."""
        for limit in self.laws.laws.limits:
            if limit.joint >= 0:
                yield limit.joint, limit.lower, limit.upper

    def efforts(self, sample: Evaluated[LawSolution]) -> Iterator[tuple[int, float, float]]:
        """Yield joints with the force of a drive and its limit in that direction."""
        driven = sample.solution.law.driven
        for i, drive in enumerate(self.laws.laws.drives):
            joints = self.laws.tree.paths[drive.path].joints
            if len(joints) == 1 and drive.on:
                (joint, gear), force = joints[0], float(driven.forces[i])
                low, high = drive.force_range or (-np.inf, np.inf)
                largest = abs(high if force > 0 else low)
                if i in driven.clipped:  # by a limit of its tendon
                    largest = abs(force)
                yield joint, gear * force, abs(gear) * largest


def applied(laws: LawModel, model: WholeModel) -> LawModel:
    """Return the laws of a file with the choices of an engine."""
    chosen = model.applied(laws.laws)
    return laws if chosen is laws.laws else laws.under(chosen)


class ImpulseComparison(WholeStepComparison[ImpulseModel, ImpulseStep]):
    """The impulses of a file, and an engine that loaded it."""

    steps = True

    @property
    def drive_ranges(self) -> tuple[Array, Array]:
        """Ranges of the driven joints, infinite without one, and no states."""
        controls = np.tile([-np.inf, np.inf], (self.model.controls, 1))
        for joint in self.laws.laws.joints:
            if joint.lower <= joint.upper:
                controls[joint.control] = joint.lower, joint.upper
        return controls, np.zeros((0, 2))

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

    def solve_again(self, posture: Posture, sample: Evaluated[ImpulseStep]) -> ImpulseStep:
        """Return the known solution, unless these laws have another one."""
        again = self.solve(posture, sample.state, sample.engine)
        return sample.solution if sample.solution.solves(again) else again

    def expected(self, sample: Evaluated[ImpulseStep]) -> Array:
        """Return the components by the law, (C,)."""
        a, after = sample.acceleration, sample.engine.after.m[self.order]
        return np.concatenate([a, *self.laws.next_state(sample.solution, a, after)])

    def limits(self) -> Iterator[tuple[int, float, float]]:
        """Yield joints with their lower and upper limits."""
        for joint in self.laws.laws.joints:
            if joint.lower <= joint.upper:
                yield joint.joint, joint.lower, joint.upper

    def acting_elements(self, sample: Evaluated[ImpulseStep]) -> Iterator[tuple[str, str]]:
        """Yield limits, motors at a limit, and the links that touch something."""
        for kind, place in sample.solution.acting():
            yield kind, self.names[place]
        for contact in sample.engine.contacts:
            assert isinstance(contact, ImpulseContact)
            if contact.impulse[0]:
                yield from (("contact", self.shape_name(i)) for i in contact.surfaces)

    def efforts(self, sample: Evaluated[ImpulseStep]) -> Iterator[tuple[int, float, float]]:
        """Yield joints with the force of their motor and its limit."""
        places = [there.start for there in self.laws.tree.tree.velocities]
        for place, force, largest in sample.solution.motors:
            yield places.index(place), force, largest


def turned(state: WholeState, places: Sequence[int], angle: float, speed: float) -> WholeState:
    """Return a state with a ball joint at an angle, moving on about the same axis.

    The axis is that of its coordinates, (3,), which are 4 tan(angle / 4) along it.
    """
    z, m = state.z.copy(), state.m.copy()
    size = float(np.linalg.norm(z[places]))
    axis = z[places] / size if size else np.full(3, 3**-0.5)
    z[places] = 4 * np.tan(angle / 4) * axis
    m[places] = speed * axis
    return state._replace(z=z, m=m)


def state_sizes(engine: EngineStep) -> Array:
    """Return the size of each state of the drives, (states,)."""
    sizes: Array = 1 + np.abs(engine.after.activations)
    return sizes
