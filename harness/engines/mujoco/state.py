"""Coordinates of a compiled model, one per degree of freedom, and its own qpos and qvel.

With a soft equality, accelerations by `mj_forward` depend on its softness and can't be compared.
MuJoCo's mass matrix M, forces f and the equality's Jacobian J determine the accelerations with J a
= 0, for constraint forces that do no work.

Euler evaluates joint dampers at the step's end, unless the flag `eulerdamp` is off, and tendon
dampers at its start. `implicitfast` evaluates these and actuator dampers at the end, in the
sparsity of M. `implicit` evaluates all forces that depend on velocity at the end, including
Coriolis forces. Both omit damping that a tendon or motor couples across trees or branches: the
derivative has no entry for it (D_colind; observed in 4.0 with a damper between two masses on the
world). If a damper is not constant, these integrators have no rule here. RK4 rotates bodies by
Munthe-Kaas's rule (observed in 4.0: velocities equal the classical rule's, rotations match
Munthe-Kaas's to the last digit).
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    minimal_coordinates,
    place_names,
    rotation_names,
    unit_quaternion,
)
from ..protocol import Array, StepRule
from ..tree_model import constrained_accelerations
from .pulls import (
    acts,
    actuators,
    box_fluid,
    equalities_act,
    joint_name,
    powers,
    straight_equalities,
)

_RotationSlices = tuple[slice, slice]
"""The indices of a ball or free joint's rotation in qpos and qvel."""


class States:
    """Coordinates in the order of qvel; a free joint's position precedes its rotation.

    MuJoCo's velocity of a free joint is linear in the world's axes and angular in the body's axes.

    Attributes:
        names: of the coordinates.
        joints: index of the joint that each belongs to, (nv,).
        single: whether it is a slide's or a hinge's, (nv,).
    """

    def __init__(self, model: Any) -> None:
        self._nq, self._nv = int(model.nq), int(model.nv)
        self.names = tuple(name for j in range(model.njnt) for name in _names(model, j))
        self.joints = np.array(model.dof_jntid, dtype=int)
        self._turning = list(_turning(model))
        places = [
            (int(q), int(d))
            for q, d, kind in zip(model.jnt_qposadr, model.jnt_dofadr, model.jnt_type, strict=True)
            for q, d in _straight(int(q), int(d), int(kind))
        ]
        self._qpos = np.array([q for q, _ in places], dtype=int)
        self._dofs = np.array([d for _, d in places], dtype=int)
        kinds = np.array(model.jnt_type, dtype=int)[self.joints]
        self.single = np.isin(kinds, _SINGLE)

    def qpos(self, z: Array) -> Array:
        """Return qpos (..., nq) of coordinates (..., nv)."""
        if not self._turning:
            return z
        out = np.empty((*z.shape[:-1], self._nq))
        out[..., self._qpos] = z[..., self._dofs]
        for quaternion, angular in self._turning:
            out[..., quaternion] = unit_quaternion(z[..., angular].T).T
        return out

    def qvel(self, z: Array, w: Array) -> Array:
        """Return qvel (..., nv) of coordinates and rates."""
        out = np.array(w, dtype=float)
        for _, angular in self._turning:
            out[..., angular] = angular_velocity(z[..., angular].T, w[..., angular].T).T
        return out

    def motion_of(self, qpos: Array, qvel: Array, start: Array) -> tuple[Array, Array]:
        """Return coordinates and rates along motions (B, samples, ...) that begin at qpos (B, nq).

        Each sample's quaternion has the sign that is nearer to the sample before.
        """
        if not self._turning:
            return qpos.copy(), qvel.copy()
        z, w = np.empty_like(qvel), np.array(qvel)
        z[..., self._dofs] = qpos[..., self._qpos]
        for quaternion, angular in self._turning:
            near = start[:, quaternion]
            for k in range(qpos.shape[1]):
                turn = qpos[:, k, quaternion]
                z[:, k, angular] = minimal_coordinates(turn.T, near.T).T
                near = unit_quaternion(z[:, k, angular].T).T
            w[..., angular] = coordinate_rate(z[..., angular].T, qvel[..., angular].T).T
        return z, w

    def coordinates_of(self, qpos: Array, near: Array | None) -> list[float]:
        """Return the coordinates of one qpos as plain numbers, with rotations near to given
        ones.
        """
        if not self._turning:
            return list(qpos.tolist())
        start = (qpos if near is None else self.qpos(near))[None]
        return list(self.motion_of(qpos[None, None], np.zeros((1, 1, self._nv)), start)[0][0, 0])


FREE, BALL = 0, 1
_SINGLE = (2, 3)
"""Values of mjtJoint."""


def _names(model: Any, j: int) -> tuple[str, ...]:
    name, kind = joint_name(model, j), int(model.jnt_type[j])
    if kind == FREE:
        return (*place_names(name), *rotation_names(name))
    return rotation_names(name) if kind == BALL else (name,)


def _straight(q: int, d: int, kind: int) -> Iterator[tuple[int, int]]:
    """Yield the indices of plain coordinates in qpos and in qvel."""
    count = {FREE: 3, BALL: 0}.get(kind, 1)
    return ((q + i, d + i) for i in range(count))


def _turning(model: Any) -> Iterator[_RotationSlices]:
    for q, d, kind in zip(model.jnt_qposadr, model.jnt_dofadr, model.jnt_type, strict=True):
        q, d = int(q), int(d)
        if int(kind) == FREE:
            yield slice(q + 3, q + 7), slice(d + 3, d + 6)
        if int(kind) == BALL:
            yield slice(q, q + 4), slice(d, d + 3)


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
    return [int(model.jnt_dofadr[i]) for i, *_ in straight_equalities(model).values()]


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


SOFT = "equalities, which are soft at any step"


def step_rule(m: Any) -> StepRule | None:
    """Return the step rule of a compiled model, or None."""
    import mujoco

    kinds = mujoco.mjtIntegrator
    besides = SOFT if equalities_act(m) else ""
    match kinds(m.opt.integrator):
        case kinds.mjINT_RK4:
            return StepRule(scheme="Runge-Kutta 4", besides=besides)
        case kinds.mjINT_IMPLICIT if not (
            has_nonlinear_damping(m) or _has_unresolved_drag(m) or _has_motors_on_frames(m)
        ):
            return StepRule(
                scheme="semi-implicit Euler",
                by_velocity=True,
                coupled=_derivative_entries(m),
                besides=besides,
            )
        case kinds.mjINT_EULER:
            implicit_damping = _euler_damping(m)
        case kinds.mjINT_IMPLICITFAST if not _has_motors_on_frames(m):
            implicit_damping = _implicitfast_damping(m)
        case _:
            return None
    if implicit_damping is None:
        return None
    damping = implicit_damping if implicit_damping.any() else None
    return StepRule(scheme="semi-implicit Euler", damping=damping, besides=besides)


def _euler_damping(m: Any) -> Array | None:
    """Return the damping that Euler evaluates at the end, (nv, nv), or None if it is not
    constant.
    """
    if not (acts(m, "DAMPER") and acts(m, "EULERDAMP")):
        return np.zeros((m.nv, m.nv))
    if has_nonlinear_damping(m):
        return None
    if not np.any(m.dof_damping > 0):  # MuJoCo treats dampers as explicit if none is positive
        return np.zeros((m.nv, m.nv))
    return np.diag(np.array(m.dof_damping, dtype=float))


def _derivative_entries(m: Any) -> NDArray[np.bool_] | None:
    """Return the pairs of degrees of freedom with an entry in the derivative, (nv, nv); None for
    all.
    """
    entries = np.zeros((m.nv, m.nv), dtype=bool)
    entries[np.repeat(np.arange(m.nv), m.D_rownnz), m.D_colind] = True
    return None if entries.all() else entries


def has_nonlinear_damping(m: Any) -> bool:
    """Return whether a joint's damper is not constant."""
    return any(any(powers(m, "dof_damping", i)[1:]) for i in range(m.nv))


def _has_unresolved_drag(m: Any) -> bool:
    """Return whether a force has no finite-difference slope in velocity: of a fluid, or |w| w."""
    tendons = (powers(m, "tendon_damping", i) for i in range(m.ntendon))
    motors = (
        powers(m, "actuator_damping", i)
        for i in (range(actuators(m)) if hasattr(m, "actuator_damping") else ())
    )
    return box_fluid(m) is not None or any(any(one[1:]) for one in (*tendons, *motors))


def _has_motors_on_frames(m: Any) -> bool:
    """Return whether motors act on frames, whose dampers may have no entry in the sparsity of M."""
    import mujoco

    fixed = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_TENDON))
    return any(m.actuator_trntype[i] not in fixed for i in range(actuators(m)))


def _implicitfast_damping(m: Any) -> Array | None:
    """Return the damping that `implicitfast` evaluates at the end, (nv, nv), or None if not
    constant.
    """
    import mujoco

    matrices = []
    for speed in (0.0, 1.0):
        data = mujoco.MjData(m)
        mujoco.mj_integratePos(m, data.qpos, np.full(m.nv, 0.3), speed)
        data.qvel[:] = speed
        mujoco.mj_step(m, data)
        matrix = np.zeros((m.nv, m.nv))
        rows = np.repeat(np.arange(m.nv), m.D_rownnz)
        matrix[rows, m.D_colind] = -np.array(data.qDeriv)
        matrices.append(matrix)
    size = np.max(np.abs(matrices[0]), initial=0.0)
    still, moving = matrices
    return still if np.allclose(still, moving, rtol=0, atol=1e-12 * size) else None
