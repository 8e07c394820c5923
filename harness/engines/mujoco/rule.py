"""MuJoCo's integrators as rules for one step (its manual: Computation, Numerical integration).

Euler evaluates joint dampers at the step's end, unless the flag `eulerdamp` is off, and tendon
dampers at its start. `implicitfast` evaluates these and actuator dampers at the end, in the
sparsity of M. `implicit` evaluates all forces that depend on velocity at the end, including
Coriolis forces. Both omit damping that a tendon or motor couples across trees or branches: the
derivative has no entry for it (D_colind; observed in 4.0 with a damper between two masses on the
world). If a damper is not constant, these integrators have no rule here. RK4 rotates bodies by
Munthe-Kaas's rule (observed in 4.0: velocities equal the classical rule's, rotations match
Munthe-Kaas's to the last digit).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.mujoco.equalities import equalities_act
from physics_crosscheck.harness.engines.mujoco.pulls import acts, actuators, box_fluid, powers
from physics_crosscheck.harness.engines.protocol import Array, StepRule

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
