"""Poses of the bodies, sites and geoms of a compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array


class PoseEvaluator:
    """Poses by `kind:name`; `centre` is a body's centre of mass, in the body's axes.

    Args:
        model: compiled; for a URDF, without fusing links on fixed joints.
        body: the file's word for a body: `body`, or `link` in a URDF.
    """

    def __init__(self, model: Any, body: str) -> None:
        import mujoco

        self._model, self._data = model, mujoco.MjData(model)
        kinds = {
            body: (model.nbody, model.body, "xpos", "xmat"),
            "centre": (model.nbody, model.body, "xipos", "xmat"),
            "site": (model.nsite, model.site, "site_xpos", "site_xmat"),
            "geom": (model.ngeom, model.geom, "geom_xpos", "geom_xmat"),
        }
        self._rows = {
            f"{kind}:{named(i).name}": (at, turn, i)
            for kind, (count, named, at, turn) in kinds.items()
            for i in range(count)
            if named(i).name
        }

    @property
    def places(self) -> tuple[str, ...]:
        """All places with a name."""
        return tuple(self._rows)

    def evaluate(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return origins (K, F, 3) and rotations (K, F, 3, 3) at positions z, (K, nz)."""
        import mujoco

        wanted = [self._rows[place] for place in places]
        origins, turns = np.empty((len(z), len(wanted), 3)), np.empty((len(z), len(wanted), 9))
        for k, qpos in enumerate(z):
            self._data.qpos[:] = qpos
            mujoco.mj_kinematics(self._model, self._data)
            for f, (positions_field, turn, i) in enumerate(wanted):
                origins[k, f] = getattr(self._data, positions_field)[i]
                turns[k, f] = getattr(self._data, turn)[i]
        return origins, turns.reshape(len(z), len(wanted), 3, 3)
