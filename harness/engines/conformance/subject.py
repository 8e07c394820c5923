"""The input of every check: an adapter, and a model with states near its home."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..protocol import Array, Engine, Force, LoadedModel, ModelSpec

BATCH, STEPS, EVERY = 3, 12, 4
NEAR = 0.05
"""Share of its sampling range by which a coordinate differs from home, also per second."""

Motion = tuple[Array, Array]


class ConformanceError(AssertionError):
    """The problem that a check finds; the message is a sentence."""


@dataclass(frozen=True)
class ConformanceSubject:
    """An adapter, and a model for it."""

    engine: Engine
    spec: ModelSpec

    def load(self) -> Loaded:
        """Load the model again."""
        model = self.engine.load(self.spec)
        return Loaded(model, model.step)


@dataclass(frozen=True)
class Loaded:
    """A model with the file's own time step, seconds."""

    model: LoadedModel
    h: float

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return len(self.model.coordinates)

    def states(self) -> Motion:
        """Return positions and velocities near home, (BATCH, nz) each."""
        random = np.random.default_rng(5)
        half = np.diff(self.model.sampling_range, axis=1)[:, 0] / 2
        q = self.model.home + NEAR * half * random.uniform(-1, 1, (BATCH, self.size))
        return q, NEAR * half * random.uniform(-1, 1, (BATCH, self.size))

    def pushes(self, n: int) -> Array:
        """Return forces that differ from step to step, (BATCH, n, nz)."""
        return np.random.default_rng(7).uniform(-0.01, 0.01, (BATCH, n, self.size))

    def run(
        self, states: Motion, n: int, force: Force, every: int, h: float | None = None
    ) -> Motion:
        """Return a rollout of these states, in new arrays."""
        q, v = (values.copy() for values in states)
        z, w = self.model.rollout(q, v, h or self.h, n, force, every)
        return z.copy(), w.copy()

    def free(self, n: int = STEPS, every: int | None = None, h: float | None = None) -> Motion:
        """Return a rollout without forces."""
        return self.run(self.states(), n, None, every or n, h)

    def pushed(self, n: int = STEPS, every: int | None = None) -> Motion:
        """Return a rollout with forces."""
        return self.run(self.states(), n, self.pushes(n), every or n)


def ask(holds: bool, sentence: str) -> None:
    """Raise a BrokenError with this sentence unless the condition holds."""
    if not holds:
        raise ConformanceError(sentence)


def alike(first: Motion, second: Motion) -> bool:
    """Return whether two motions are bitwise equal, with NaN equal to NaN."""
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, second, strict=True))
