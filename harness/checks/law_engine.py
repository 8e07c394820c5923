"""An engine with a known answer: it steps by given laws, from the contacts of another engine."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Generic

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineStep, WholeModel, WholeState
from .law_comparison import Evaluated, M, S, WholeStepComparison, state_sizes


class LawEngine(WholeModel, Generic[M, S]):
    """A model that steps by the laws of a comparison, which may contain a mistake.

    Args:
        comparison: the laws, and the engine that detects contacts and draws states.
    """

    def __init__(self, comparison: WholeStepComparison[M, S]) -> None:
        self._comparison: WholeStepComparison[M, S] = comparison
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
        if not comparison.steps:
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
