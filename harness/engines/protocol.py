"""The engine protocol: what an adapter offers, and nothing of the system's equations.

An adapter turns a model file into a `Model` that rolls out. It holds engine knowledge only: it
never sees a system's constants, never interpolates, and counts steps in integers. Third parties
add one through the entry point `crosscheck.engines`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class EngineError(RuntimeError):
    """A model file that an engine can't load or run; the message names file, place and remedy."""


@dataclass(frozen=True)
class Spring:
    """A spring and damper on a linear combination s of joints: force -k (s - rest) - c ds/dt.

    MuJoCo's fixed tendon is the model; `joints` maps joint names to coefficients.
    """

    joints: Mapping[str, float]
    stiffness: float
    damping: float
    rest: float


@dataclass(frozen=True)
class ModelSpec:
    """A model file with what its sidecar adds for one engine; `settings` are the engine's own."""

    path: Path
    springs: tuple[Spring, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class StateForce:
    """Inputs whose force on the engine's coordinates depends on the state.

    Attributes:
        inputs: u at the start of each step, (B, n, inputs).
        at: force on the engine's coordinates at one state, (z, u) -> nz numbers. It takes plain
            sequences: at a call a step, arrays of two or three numbers would cost most of the time.
    """

    inputs: Array
    at: Callable[[Sequence[float], Sequence[float]], Sequence[float]]


Force = Array | StateForce | None
"""Forces on the engine's coordinates, held over each step: (B, n, nz), by state, or none."""


def within(free: Array, limits: Array) -> Array:
    """Ranges (nz, 2) cut to limits; where these leave nothing, the limits alone."""
    cut = np.stack([np.maximum(free[:, 0], limits[:, 0]), np.minimum(free[:, 1], limits[:, 1])], 1)
    return np.where((cut[:, 0] < cut[:, 1])[:, None], cut, limits)


class Model(Protocol):
    """A model file, loaded by an engine.

    A model may also have `home`, positions as the file draws the mechanism, (nz,), and `reach`,
    where positions may be drawn at random, (nz, 2); without them these are 0 and -1 to 1.
    """

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the engine's coordinates, in the order of its states."""

    @property
    def step(self) -> float:
        """The step the file (or its sidecar) ships with, seconds."""

    @property
    def integrator(self) -> str:
        """Name of the time-stepping method."""

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Leading exponent of h in the error of a motion, and the increment to the next.

        `varying_input` tells whether an input changes over time and is held over each step.
        """

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """From B states (q, v), each (B, nz), take n steps of h seconds.

        Returns positions and velocities after every `every` steps, each (B, n // every, nz).
        Nothing that an earlier call left may matter. Values that are not finite are returned as
        they are.
        """


class Engine(Protocol):
    """An adapter: its name, whether its engine is there, and how to load a model file."""

    @property
    def name(self) -> str:
        """Short name, as in sidecars and results."""

    @property
    def formats(self) -> tuple[str, ...]:
        """Endings of the files it reads, such as ".urdf"."""

    @property
    def capabilities(self) -> tuple[str, ...]:
        """What it can do, one short phrase each, for `crosscheck engines`."""

    def version(self) -> str | None:
        """Version of the engine, or None where it is not installed."""

    def load(self, spec: ModelSpec) -> Model:
        """Load a model file.

        Raises:
            EngineError: naming file, place and remedy.
        """
