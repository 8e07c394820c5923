"""Behaviour of a model, in few numbers, to detect whether another behaves differently."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from physics_crosscheck.harness.engines.protocol import Engine, EngineError, Model
from physics_crosscheck.harness.modelfiles.frames import SidecarFrames
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.mechanism.numeric import Array

POSE_STATES = 8
"""States at which poses of frames are evaluated; extremes of the motions are among the first."""


@dataclass(frozen=True, eq=False)
class Probe:
    """Positions and velocities at which a model is evaluated, (S, nz) each, and its frames.

    Attributes:
        h: step of the unmodified model, s; a number of the file may be the step.
        resolution: smallest relative change that counts.
    """

    z: Array
    w: Array
    h: float
    engine: Engine
    frames: SidecarFrames
    resolution: float

    def loaded(self, sidecar: Sidecar) -> Model | None:
        """Return the loaded model, or None if the engine rejects it."""
        try:
            model = self.engine.load(sidecar.spec(self.engine.name))
        except (EngineError, SidecarError):
            return None
        return model if len(model.coordinates) == self.z.shape[1] else None

    def evaluate(self, model: Model) -> Behaviour:
        """Evaluate a model; its poses are evaluated on demand, while it is still loaded."""
        q, v = model.rollout(self.z, self.w, self.h, 1, None, 1)
        return Behaviour(
            moved=(q[:, 0] - self.z) / self.h,
            pushed=(v[:, 0] - self.w) / self.h,
            evaluate_poses=partial(self._evaluate_poses, model),
        )

    def _evaluate_poses(self, model: Model) -> tuple[Array, Array]:
        places = [target.place for target in self.frames.targets if target.place in model.places]
        if not places:
            return np.zeros(0), np.zeros(0)
        return model.poses(places, self.z[:POSE_STATES])


@dataclass(frozen=True, eq=False)
class Behaviour:
    """Behaviour of a model at some states.

    Attributes:
        moved, pushed: rates of change of positions and velocities over a step, (S, nz).
        evaluate_poses: returns origins of the frames and their rotations.
    """

    moved: Array
    pushed: Array
    evaluate_poses: Callable[[], tuple[Array, Array]]

    @cached_property
    def posed(self) -> tuple[Array, Array]:
        """Origins of the frames, and their rotations."""
        return self.evaluate_poses()

    def moves_as(self, other: Behaviour, resolution: float) -> bool:
        """Return whether the motions agree, within a share of the largest rate."""
        pairs = ((self.moved, other.moved), (self.pushed, other.pushed))
        return all(_alike(one, two, resolution) for one, two in pairs)

    def poses_as(self, other: Behaviour, resolution: float) -> bool:
        """Return whether the frames agree, within a share of the largest distance."""
        pairs = zip(self.posed, other.posed, strict=True)
        return all(one.shape == two.shape and _alike(one, two, resolution) for one, two in pairs)


def _alike(values: Array, reference: Array, resolution: float) -> bool:
    size = float(np.max(np.abs(reference), initial=0.0))
    return bool(np.all(np.abs(values - reference) <= resolution * size))
