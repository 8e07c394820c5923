"""Accelerations of a compiled model at given states, without a step.

With a soft equality, accelerations by `mj_forward` depend on its softness and can't be compared.
MuJoCo's mass matrix M, forces f and the equality's Jacobian J determine the accelerations with J a
= 0, for constraint forces that do no work.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.equalities import straight_equalities
from physics_crosscheck.harness.engines.mujoco.pulls import acts
from physics_crosscheck.harness.engines.mujoco.state import States
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.tree_model import constrained_accelerations


def forward(
    model: Any,
    data: Any,
    states: States,
    inputs: tuple[Array, Array, Array],
    held: tuple[Array, Array],
) -> Array:
    """Return accelerations of the velocities, (B, nv); NaN where a soft constraint acts.

    Args:
        model: compiled.
        data: of the model; its state is overwritten.
        states: its coordinates.
        inputs: positions, rates and forces on the coordinates, (B, nv) each.
        held: controls (nu,) and activations (na,).
    """
    import mujoco

    z, w, force = inputs
    followers = following_dofs(model)
    result = np.full_like(w, np.nan)
    mujoco.mj_resetData(model, data)
    data.ctrl[:], data.act[:] = held
    for k, (qpos, qvel) in enumerate(zip(states.qpos(z), states.qvel(z, w), strict=True)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = qpos, qvel, force[k]
        if followers:
            result[k] = _held(model, data, followers)
            continue
        mujoco.mj_forward(model, data)
        if not data.nefc:
            result[k] = data.qacc
    return result


def holds_exactly(model: Any) -> bool:
    """Return whether every active equality couples a slide or hinge linearly to others.

    Their rows then determine the followers.
    """
    active = np.count_nonzero(model.eq_active0) if acts(model, "EQUALITY") else 0
    return active == len(following_dofs(model))


def following_dofs(model: Any) -> list[int]:
    """Return the degrees of freedom that active equalities make follow others, one per row."""
    return [int(model.jnt_dofadr[e.follower]) for e in straight_equalities(model).values()]


def equality_errors(model: Any, data: Any, qpos: Array) -> Array:
    """Return the distance of positions (B, nq) from those that equalities require, (B, nv).

    Zero for joints without a leader; NaN where other constraints act. Computed from the rows' own
    positions, `efc_pos`.
    """
    import mujoco

    followers = following_dofs(model)
    errors = np.zeros((len(qpos), model.nv))
    mujoco.mj_resetData(model, data)
    for row, data.qpos[:] in zip(errors, qpos, strict=True):
        mujoco.mj_fwdPosition(model, data)
        jacobian = _jacobian(model, data, followers)
        row[followers] = np.nan
        if jacobian is not None:
            row[followers] = np.linalg.solve(jacobian[:, followers], data.efc_pos)
    return errors


def _jacobian(model: Any, data: Any, followers: list[int]) -> Array | None:
    """Return the equalities' rows, (followers, nv), or None if other constraints act."""
    if data.nefc != len(followers):
        return None
    return np.array(data.efc_J).reshape(data.nefc, model.nv)


def _held(model: Any, data: Any, followers: list[int]) -> Array | float:
    """Return accelerations (nv,) that satisfy the equalities; NaN where other constraints act."""
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
    return constrained_accelerations(mass, np.array(data.qfrc_smooth), along)
