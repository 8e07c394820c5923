"""Frames of a system in a loaded model: their poses in the equations and in the engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.documents.errors import quote, truncate
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.modelfiles.frames import FrameTarget, SidecarFrames
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import ENTRIES, System, frame_function

STEPS = 16.0
"""Rounding errors of one body's frame in its parent: a product of quaternions, its matrix, times a
vector. Each step sums four products.
"""

PROBED = 8
"""Number of positions at which the effect of rounded coordinates on frames is measured."""

_NUDGE = 2.0**-20


@dataclass(frozen=True, eq=False)
class Placed:
    """Poses at K positions: `origin` (K, F, 3), m, and `turn` (K, F, 3, 3), columns the axes."""

    origin: Array
    turn: Array

    def miss(self, other: Placed) -> tuple[Array, Array]:
        """Return the distance between two sets of frames, m and rad, (K, F) each."""
        far = np.linalg.norm(self.origin - other.origin, axis=-1)
        chord = np.linalg.norm(self.turn - other.turn, axis=(-2, -1)) / np.sqrt(8)
        return far, 2 * np.arcsin(np.minimum(chord, 1.0))


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames that a sidecar maps, in one loaded model.

    Attributes:
        function: poses of every declared frame as a function of q.
        rows: indices of the mapped frames among these.
    """

    model: LoadedModel
    coordinates: CoordinateMap
    mapped: SidecarFrames
    function: Callable[[Array], Array]
    rows: tuple[int, ...]

    @staticmethod
    def look_up(
        system: System, mapped: SidecarFrames, model: LoadedModel, coordinates: CoordinateMap
    ) -> Frames:
        """Look up every frame.

        Raises:
            SidecarError: for a frame that the model lacks; names the file, the line and the
                existing frames.
        """
        for target in mapped.targets:
            if target.place not in model.places:
                raise SidecarError(_lacking(target, model.places))
        names = [frame.name for frame in system.frames]
        rows = tuple(names.index(target.name) for target in mapped.targets)
        return Frames(model, coordinates, mapped, frame_function(system), rows)

    def expected(self, q: Array) -> Placed:
        """Return the poses in the equations at positions q, (K, n)."""
        values = self.function(q).reshape(len(q), -1, ENTRIES)[:, list(self.rows)]
        return Placed(values[..., :3], values[..., 3:].reshape(*values.shape[:2], 3, 3))

    def measured(self, z: Array) -> Placed:
        """Return the poses in the engine at its positions z, (K, nz), in the system's world
        frame.
        """
        targets = self.mapped.targets
        origins, turns = self.model.poses([target.place for target in targets], z)
        offsets = np.array([target.offset for target in targets])
        axes = np.array([target.axes for target in targets])
        world = self.mapped.axes
        places = origins + np.einsum("kfij,fj->kfi", turns, offsets) - self.mapped.origin
        turned = np.einsum("ji,kfjl,flm->kfim", world, turns, axes)
        return Placed(places @ world, turned)

    def length(self, z: Array) -> float:
        """Return the largest distance of any part of the model from its origin, m."""
        origins, _ = self.model.poses(self.model.places, z[:PROBED])
        offsets = [float(np.linalg.norm(target.offset)) for target in self.mapped.targets]
        far = float(np.max(np.abs(origins), initial=0.0))
        return far + max(offsets, default=0.0) + float(np.linalg.norm(self.mapped.origin))

    def uncertainty(self, q: Array, length: float) -> tuple[float, float]:
        """Return how far rounding may move a frame, m and rad.

        The sum of two errors: that of a chain of all bodies, as long as the model, and the measured
        effect of rounded coordinates.
        """
        q = q[:: max(1, len(q) // PROBED)]
        z = self.coordinates.forward(q)
        moved = _moved(self.expected, q) + _moved(self.measured, z)
        chain = STEPS * max(1, len(self.model.places))
        far, turned = self.model.epsilon * (chain * np.array([length, 1.0]) + 4 * moved)
        return float(far), float(turned)


def _moved(placed: Callable[[Array], Placed], x: Array) -> Array:
    """Return the largest movement of frames per unit of relative rounding in all coordinates, m and
    rad.
    """
    here = placed(x)
    total = np.zeros(2)
    for j in range(x.shape[1]):
        there = x.copy()
        there[:, j] *= 1 + _NUDGE
        far, turned = placed(there).miss(here)
        total += np.array([far.max(initial=0.0), turned.max(initial=0.0)]) / _NUDGE
    return total


def _lacking(target: FrameTarget, available: Sequence[str]) -> str:
    kind = target.place.partition(":")[0]
    same = [place for place in available if place.startswith(f"{kind}:")]
    shown = ", ".join(map(truncate, (same or list(available))[:24]))
    return f"{target.where}: the model has no {quote(target.place)}; it has {shown}"
