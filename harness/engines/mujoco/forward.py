"""Accelerations of a compiled model at given states: no step is taken.

A soft equality gives way to each step in another way, so that `mj_forward` with one has no
accelerations to compare. Without it there are: MuJoCo's mass matrix M, forces f and the equality's
own Jacobian J fix those with which J a = 0 holds exactly, by work that the equality does not do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.following import held_accelerations
from physics_crosscheck.harness.engines.mujoco.equalities import straight_equalities
from physics_crosscheck.harness.engines.mujoco.pulls import acts
from physics_crosscheck.harness.engines.mujoco.state import States
from physics_crosscheck.harness.engines.protocol import Array


def forward(
    model: Any,
    data: Any,
    states: States,
    at: tuple[Array, Array, Array],
    held: tuple[Array, Array],
) -> Array:
    """Return accelerations of the velocities, (B, nv); nan where a soft constraint acts.

    Args:
        model: compiled.
        data: of it, whose state is lost.
        states: its coordinates.
        at: positions, rates and forces on the coordinates, (B, nv) each.
        held: controls (nu,) and activations (na,).
    """
    import mujoco

    z, w, force = at
    followers = following_dofs(model)
    found = np.full_like(w, np.nan)
    mujoco.mj_resetData(model, data)
    data.ctrl[:], data.act[:] = held
    for k, (qpos, qvel) in enumerate(zip(states.qpos(z), states.qvel(z, w), strict=True)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = qpos, qvel, force[k]
        if followers:
            found[k] = _held(model, data, followers)
            continue
        mujoco.mj_forward(model, data)
        if not data.nefc:
            found[k] = data.qacc
    return found


def holds_exactly(model: Any) -> bool:
    """Whether every equality that acts makes a slide or a hinge follow others by a straight line.

    Their rows alone fix what follows.
    """
    active = np.count_nonzero(model.eq_active0) if acts(model, "EQUALITY") else 0
    return active == len(following_dofs(model))


def following_dofs(model: Any) -> list[int]:
    """Return the degrees of freedom that active equalities make follow others, one a row."""
    return [int(model.jnt_dofadr[e.follower]) for e in straight_equalities(model).values()]


def equality_errors(model: Any, data: Any, qpos: Array) -> Array:
    """Return how far positions (B, nq) are from where equalities put them, (B, nv).

    Zero for all that follows nothing; nan where other constraints act. The rows' own positions,
    `efc_pos`, as those of the joints that follow.
    """
    import mujoco

    followers = following_dofs(model)
    found = np.zeros((len(qpos), model.nv))
    mujoco.mj_resetData(model, data)
    for row, data.qpos[:] in zip(found, qpos, strict=True):
        mujoco.mj_fwdPosition(model, data)
        jacobian = _jacobian(model, data, followers)
        row[followers] = np.nan
        if jacobian is not None:
            row[followers] = np.linalg.solve(jacobian[:, followers], data.efc_pos)
    return found


def _jacobian(model: Any, data: Any, followers: list[int]) -> Array | None:
    """The equalities' rows, (followers, nv); None where there are other constraints."""
    if data.nefc != len(followers):
        return None
    return np.array(data.efc_J).reshape(data.nefc, model.nv)


def _held(model: Any, data: Any, followers: list[int]) -> Array | float:
    """Accelerations (nv,) that keep the equalities; nan where other constraints act."""
    import mujoco

    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    mujoco.mj_fwdAcceleration(model, data)
    jacobian = _jacobian(model, data, followers)
    if jacobian is None:
        return np.nan
    leaders = [i for i in range(model.nv) if i not in followers]
    along = np.zeros((model.nv, len(leaders)))
    along[leaders, range(len(leaders))] = 1.0
    along[followers] = -np.linalg.solve(jacobian[:, followers], jacobian[:, leaders])
    mass = np.empty((model.nv, model.nv))
    for column, unit in zip(mass, np.eye(model.nv), strict=True):  # M is symmetric
        mujoco.mj_mulM(model, data, column, unit)
    return held_accelerations(mass, np.array(data.qfrc_smooth), along)
