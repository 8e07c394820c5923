"""An engine's steps with all forces, and the law that it documents, component by component.

An answer is judged by the rounding of all terms and by a bound of the solver's error: the cost is
convex in M, so |a - a*|_M <= |grad|_(M^-1).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, EngineStep, WholeModel, WholeState
from physics_crosscheck.harness.numerics.judgement import LimitVerdict, judge
from physics_crosscheck.harness.numerics.ladder import floored
from physics_crosscheck.reference.laws.impulses import ImpulseModel, ImpulseStep
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.step import DIGITS, LawModel, LawSolution, LawStep
from physics_crosscheck.reference.mechanism.tree import TreeError

SHARE = 1e-3
"""Smallest scale of an acceleration, as a share of the largest sample."""

LEAST_GAIN = 1e-6
"""Smallest scale of a step's gain in velocity, as a share of the largest velocity."""

TreeLaw = LawModel | ImpulseModel
"""Convex laws of a tree, or impulses on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluated:
    """The laws and the engine at one state, in the order of the tree's velocities."""

    state: WholeState
    solution: LawSolution | ImpulseStep
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


class LawComparison:
    """Laws and an engine that loaded their file, whose choices they take.

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
        laws: TreeLaw,
        model: WholeModel,
        *,
        drives: Sequence[str] = (),
        shapes: Sequence[str] = (),
    ) -> None:
        self.laws, self.model = applied(laws, model), model
        self._drives, self._shapes = drives, shapes
        self.names = laws.tree.names
        if set(self.names) != set(model.coordinates):
            raise TreeError("joints that the engine names otherwise")
        self.order = [model.coordinates.index(name) for name in self.names]

    def under(self, laws: TreeLaw) -> LawComparison:
        """Return the comparison of other laws with the same engine."""
        return LawComparison(laws, self.model)

    def of_engine(self, model: WholeModel) -> LawComparison:
        """Return the comparison of the same laws with another engine."""
        return LawComparison(self.laws, model)

    def solve(
        self, posture: Posture, state: WholeState, engine: EngineStep
    ) -> LawSolution | ImpulseStep:
        """Solve the laws at a state, from the engine's contacts and accelerations."""
        start = engine.acceleration[self.order]
        residual = None if engine.solver_residual is None else engine.solver_residual[self.order]
        inputs = state.controls, state.activations, engine.contacts
        return self.laws.solve(posture, *inputs, start, residual)

    def expected_by(self, laws: TreeLaw, evaluated: Sequence[Evaluated]) -> Array:
        """Return the components by other laws at evaluated states, (S, C)."""
        other, rows = self.under(laws), list[Array]()
        states = [sample.state for sample in evaluated]
        same = laws.tree is self.laws.tree
        postures = (s.solution.posture for s in evaluated) if same else other.postures(states)
        for sample, posture in zip(evaluated, postures, strict=True):
            before, again = sample.solution, other.solve(posture, sample.state, sample.engine)
            if isinstance(before, ImpulseStep) and isinstance(again, ImpulseStep):
                again = before if before.solves(again) else again
            rows.append(other.expected(replace(sample, solution=again)))
        return np.array(rows)

    def elements(self) -> Iterator[tuple[str, str]]:
        """Yield the kind and the name of the elements of the laws that may act."""
        return self._named(self.laws.elements())

    def acting_elements(self, sample: Evaluated) -> Iterator[tuple[str, str]]:
        """Yield the kind and the name of the elements that act at a state."""
        return self._named(sample.solution.acting_elements)

    def _named(self, elements: Iterable[tuple[str, str | int]]) -> Iterator[tuple[str, str]]:
        names = self._drives
        for kind, name in elements:
            if isinstance(name, str):
                yield kind, name
            elif kind == "contact":
                yield kind, self.shape_name(name)
            else:
                has_name = name < len(names) and names[name]
                yield kind, names[name] if has_name else f"drive {name + 1}"

    def shape_name(self, index: int) -> str:
        """Return the name of a surface of contacts."""
        return (self._shapes[index] or "world") if index < len(self._shapes) else f"shape {index}"

    @cached_property
    def ranges(self) -> Array:
        """Ranges of the engine's coordinates by the file, (nz, 2); infinite without one."""
        tree = self.laws.tree.tree
        result = np.tile([-np.inf, np.inf], (len(self.order), 1))
        for joint, lower, upper in self.laws.limits:
            if tree.links[joint].kind in ("hinge", "slide"):
                result[self.order[tree.velocities[joint].start]] = lower, upper
        return result

    def postures(self, states: Sequence[WholeState]) -> Iterator[Posture]:
        """Yield the tree at each state."""
        y, m = (np.array([state[k][self.order] for state in states]) for k in range(2))
        return self.laws.tree.postures(y, m)

    def evaluate(self, states: Sequence[WholeState]) -> list[Evaluated]:
        """Evaluate the engine and the laws at states."""
        return self.solve_steps([(state, self.model.evaluate(state)) for state in states])

    def solve_steps(self, steps: Sequence[tuple[WholeState, EngineStep]]) -> list[Evaluated]:
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

    def compare(self, evaluated: Sequence[Evaluated]) -> LawDefect:
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
        if self.laws.has_next_state:
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
        if self.laws.has_next_state:
            names += [f"{name}_dot" for name in self.names] + list(self.names)
            names += [f"state {i + 1} of the drives" for i in range(self.model.activations)]
        return tuple(names)

    def expected(self, sample: Evaluated) -> Array:
        """Return the components by the laws, (C,)."""
        return self.predict(sample.solution.law, sample.acceleration, sample.engine)

    def predict(self, law: LawStep | ImpulseStep, acceleration: Array, engine: EngineStep) -> Array:
        """Return the components by the laws, (C,), with states of drives relative to their size.

        The positions follow from the engine's velocities, so that each component is judged alone.
        """
        if not self.laws.has_next_state:
            return acceleration
        state = law.next_state(acceleration, engine.after.m[self.order], self.model.step)
        return np.concatenate([acceleration, *state, law.drive_states / state_sizes(engine)])

    def answer(self, sample: Evaluated) -> Array:
        """Return the components by the engine, (C,)."""
        engine, order = sample.engine, self.order
        parts: list[Array] = [engine.acceleration[order]]
        if self.laws.has_next_state:
            after = engine.after
            parts += [after.m[order], after.z[order], after.activations / state_sizes(engine)]
        return np.concatenate(parts)

    def uncertainty(self, sample: Evaluated) -> Array:
        """Return the uncertainty of each component, (C,)."""
        order, posture = self.order, sample.solution.posture
        eps, h = np.finfo(float).eps, self.model.step
        unsure = sample.solution.law.uncertainty(
            sample.acceleration, sample.engine.unbalanced[order]
        )
        if not self.laws.has_next_state:
            return unsure
        after = sample.engine.after
        speed, y = np.abs(after.m[order]), after.z[order]
        turned = 1 + np.abs(y) + y**2  # a last digit of a rotation's coordinate
        return np.concatenate(
            [
                unsure,
                sample.solution.law.velocity_uncertainty(sample.acceleration, unsure)
                + eps * (np.abs(posture.m) + speed),
                DIGITS * eps * (h * speed + turned),
                np.full(len(after.activations), DIGITS * eps),
            ]
        )


def applied(laws: TreeLaw, model: WholeModel) -> TreeLaw:
    """Return the laws of a file with the choices of an engine."""
    if isinstance(laws, ImpulseModel):
        return laws
    chosen = model.applied(laws.laws)
    return laws if chosen is laws.laws else laws.under(chosen)


def state_sizes(engine: EngineStep) -> Array:
    """Return the size of each state of the drives, (states,)."""
    sizes: Array = 1 + np.abs(engine.after.activations)
    return sizes


class LawEngine(WholeModel):
    """An engine with a known answer: the laws of a comparison, which may contain a mistake.

    Args:
        comparison: the laws, and the engine that detects contacts and draws states.
    """

    def __init__(self, comparison: LawComparison) -> None:
        self._comparison = comparison
        model = comparison.model
        self.coordinates, self.step = model.coordinates, model.step
        self.controls, self.activations = model.controls, model.activations
        self.edits, self.uncovered = model.edits, model.uncovered
        self.speed, self.rules = model.speed, model.rules

    @property
    def starts(self) -> Iterable[WholeState]:
        """States of the file at rest."""
        return self._comparison.model.starts

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps of the other engine."""
        return self._comparison.model.moved(state, steps)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return accelerations and the next state by the laws."""
        comparison = self._comparison
        contacts = replace(comparison.model.evaluate(state), solver_residual=None)
        solution = comparison.solve(next(comparison.postures([state])), state, contacts)
        engine = replace(
            contacts,
            acceleration=self._in_order(solution.acceleration),
            unbalanced=np.zeros_like(contacts.unbalanced),
            converged=solution.converged,
        )
        if not comparison.laws.has_next_state:
            return engine
        for _ in range(2):  # the positions follow from the velocities after the step
            sample = Evaluated(state=state, solution=solution, engine=engine)
            n = len(comparison.names)
            _, velocity, z, states = np.split(comparison.expected(sample), (n, 2 * n, 3 * n))
            after = engine.after._replace(
                z=self._in_order(z),
                m=self._in_order(velocity),
                activations=states * state_sizes(engine),
            )
            engine = replace(engine, after=after)
        return engine

    def _in_order(self, values: Array) -> Array:
        """Return values in the order of the engine's coordinates, (nz,)."""
        result = np.zeros_like(values)
        result[self._comparison.order] = values
        return result
