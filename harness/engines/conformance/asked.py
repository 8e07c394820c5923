"""What every check has: an adapter, and a model of it with states near its home."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, Engine, Force, Model, ModelSpec

BATCH, STEPS, EVERY = 3, 12, 4
NEAR = 0.05
"""Share of its reach by which a coordinate is away from home, and of it in a second."""

Motion = tuple[Array, Array]


class BrokenError(AssertionError):
    """What a check has found wrong; the message is a sentence."""


@dataclass(frozen=True)
class Asked:
    """An adapter, and a model for it."""

    engine: Engine
    spec: ModelSpec

    def load(self) -> Loaded:
        """The model, loaded anew."""
        model = self.engine.load(self.spec)
        return Loaded(model, model.step)


@dataclass(frozen=True)
class Loaded:
    """A model with the step that it ships with, seconds."""

    model: Model
    h: float

    @property
    def size(self) -> int:
        """How many coordinates it has."""
        return len(self.model.coordinates)

    def states(self) -> Motion:
        """Positions and velocities near home, (BATCH, nz) each."""
        random = np.random.default_rng(5)
        half = np.diff(self.model.reach, axis=1)[:, 0] / 2
        q = self.model.home + NEAR * half * random.uniform(-1, 1, (BATCH, self.size))
        return q, NEAR * half * random.uniform(-1, 1, (BATCH, self.size))

    def pushes(self, n: int) -> Array:
        """Forces that differ from step to step, (BATCH, n, nz)."""
        return np.random.default_rng(7).uniform(-0.01, 0.01, (BATCH, n, self.size))

    def run(
        self, states: Motion, n: int, force: Force, every: int, h: float | None = None
    ) -> Motion:
        """A rollout of these states, in arrays of its own."""
        q, v = (values.copy() for values in states)
        z, w = self.model.rollout(q, v, h or self.h, n, force, every)
        return z.copy(), w.copy()

    def free(self, n: int = STEPS, every: int | None = None, h: float | None = None) -> Motion:
        """A rollout without forces."""
        return self.run(self.states(), n, None, every or n, h)

    def pushed(self, n: int = STEPS, every: int | None = None) -> Motion:
        """A rollout with forces."""
        return self.run(self.states(), n, self.pushes(n), every or n)


def ask(holds: bool, sentence: str) -> None:
    """Raise what is wrong, unless it holds."""
    if not holds:
        raise BrokenError(sentence)


def alike(first: Motion, second: Motion) -> bool:
    """Bitwise, NaN being itself."""
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, second, strict=True))
