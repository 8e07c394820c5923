"""What a compiled model accelerates with at given states, by `mj_forward`: no step is taken."""

from __future__ import annotations

from typing import Any

import numpy as np

from harness.engines.mujoco.state import States
from harness.engines.protocol import Array


def forward(
    model: Any,
    data: Any,
    states: States,
    at: tuple[Array, Array, Array],
    held: tuple[Array, Array],
) -> Array:
    """Accelerations of the velocities, (B, nv); nan where a constraint acts, which is soft.

    Args:
        model: compiled.
        data: of it, whose state is lost.
        states: its coordinates.
        at: positions, rates and forces on the coordinates, (B, nv) each.
        held: controls (nu,) and activations (na,).
    """
    import mujoco

    z, w, force = at
    found = np.empty_like(w)
    mujoco.mj_resetData(model, data)
    data.ctrl[:], data.act[:] = held
    for k, (qpos, qvel) in enumerate(zip(states.qpos(z), states.qvel(z, w), strict=True)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = qpos, qvel, force[k]
        mujoco.mj_forward(model, data)
        found[k] = np.nan if data.nefc else data.qacc
    return found
