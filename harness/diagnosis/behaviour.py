"""What a model does, in as few numbers as tell whether it does something else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from physics_crosscheck.harness.engines.protocol import Engine, EngineError, Model
from physics_crosscheck.harness.modelfiles.frames import SidecarFrames
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.mechanism.numeric import Array

POSED = 8
"""States at which frames are looked up: extremes of the motions are among the first."""


@dataclass(frozen=True, eq=False)
class Probe:
    """The positions and velocities at which a model is asked, (S, nz) each, and its frames.

    Attributes:
        h: step, s: of the model as it is, since a number may be the step.
        resolution: a change that counts, relative.
    """

    z: Array
    w: Array
    h: float
    engine: Engine
    said: SidecarFrames
    resolution: float

    def loaded(self, sidecar: Sidecar) -> Model | None:
        """A model, or None where the engine refuses it."""
        try:
            model = self.engine.load(sidecar.spec(self.engine.name))
        except (EngineError, SidecarError):
            return None
        return model if len(model.coordinates) == self.z.shape[1] else None

    def of(self, model: Model) -> Behaviour:
        """What it does; its frames are looked up when that is asked, with the model still there."""
        q, v = model.rollout(self.z, self.w, self.h, 1, None, 1)
        return Behaviour(
            moved=(q[:, 0] - self.z) / self.h,
            pushed=(v[:, 0] - self.w) / self.h,
            look=partial(self._look, model),
        )

    def _look(self, model: Model) -> tuple[Array, Array]:
        places = [target.place for target in self.said.targets if target.place in model.places]
        if not places:
            return np.zeros(0), np.zeros(0)
        return model.poses(places, self.z[:POSED])


@dataclass(frozen=True, eq=False)
class Behaviour:
    """What a model does at some states.

    Attributes:
        moved, pushed: changes of positions and velocities over a step, a second, (S, nz).
        look: origins of the frames, and their rotations.
    """

    moved: Array
    pushed: Array
    look: Callable[[], tuple[Array, Array]]

    @cached_property
    def posed(self) -> tuple[Array, Array]:
        """Origins of the frames, and their rotations."""
        return self.look()

    def moves_as(self, other: Behaviour, resolution: float) -> bool:
        """Whether the motions are the same, to a share of the largest rate."""
        pairs = ((self.moved, other.moved), (self.pushed, other.pushed))
        return all(_alike(one, two, resolution) for one, two in pairs)

    def poses_as(self, other: Behaviour, resolution: float) -> bool:
        """Whether the frames are where those of another are, to a share of the largest distance."""
        pairs = zip(self.posed, other.posed, strict=True)
        return all(one.shape == two.shape and _alike(one, two, resolution) for one, two in pairs)


def _alike(one: Array, other: Array, resolution: float) -> bool:
    size = float(np.max(np.abs(other), initial=0.0))
    return bool(np.all(np.abs(one - other) <= resolution * size))
