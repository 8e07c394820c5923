"""MuJoCo's integrators as rules for one step (Computation, Numerical integration, in its manual).

Euler takes joint dampers at the step's end, unless the flag `eulerdamp` is off, and tendons' at its
start; `implicitfast` takes those and actuators' dampers at the end, in the sparsity of M;
`implicit` all that depends on velocity, Coriolis forces too. Neither takes what a tendon's or a
motor's damper couples across trees or branches: the derivative has no place for it (D_colind; seen
in 4.0: two masses on the world between which a damper acts). Where a damper is no constant, no rule
is told for these. RK4 turns bodies by Munthe-Kaas's rule (seen in 4.0: velocities equal the
classical rule's, rotations that one's to the last digit).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.mujoco.equalities import equalities_act
from physics_crosscheck.harness.engines.mujoco.medium import medium
from physics_crosscheck.harness.engines.mujoco.pulls import acts, actuators, powers
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.step_rule import StepRule

SOFT = "equalities, which are soft at any step"


def step_rule(m: Any) -> StepRule | None:
    """Of a compiled model."""
    import mujoco

    kinds = mujoco.mjtIntegrator
    besides = SOFT if equalities_act(m) else ""
    match kinds(m.opt.integrator):
        case kinds.mjINT_RK4:
            return StepRule(scheme="Runge-Kutta 4", besides=besides)
        case kinds.mjINT_IMPLICIT if not (_bent(m) or _drags(m) or _moves(m)):
            return StepRule(
                scheme="semi-implicit Euler",
                by_velocity=True,
                coupled=_coupled(m),
                besides=besides,
            )
        case kinds.mjINT_EULER:
            late = _joint_dampers(m)
        case kinds.mjINT_IMPLICITFAST if not _moves(m):
            late = _dampers(m)
        case _:
            return None
    if late is None:
        return None
    damping = late if late.any() else None
    return StepRule(scheme="semi-implicit Euler", damping=damping, besides=besides)


def _joint_dampers(m: Any) -> Array | None:
    """What Euler takes at the end, (nv, nv); None where it is no constant."""
    if not (acts(m, "DAMPER") and acts(m, "EULERDAMP")):
        return np.zeros((m.nv, m.nv))
    if _bent(m):
        return None
    if not np.any(m.dof_damping > 0):  # negative ones alone are explicit
        return np.zeros((m.nv, m.nv))
    return np.diag(np.array(m.dof_damping, dtype=float))


def _coupled(m: Any) -> NDArray[np.bool_] | None:
    """Pairs of degrees of freedom of which its derivative has an entry, (nv, nv); None: all."""
    found = np.zeros((m.nv, m.nv), dtype=bool)
    found[np.repeat(np.arange(m.nv), m.D_rownnz), m.D_colind] = True
    return None if found.all() else found


def _bent(m: Any) -> bool:
    """Whether a joint's damper is no constant."""
    return any(any(powers(m, "dof_damping", i)[1:]) for i in range(m.nv))


def _drags(m: Any) -> bool:
    """Whether a force has no slope by a velocity that differences find: of a medium, or |w| w."""
    tendons = (powers(m, "tendon_damping", i) for i in range(m.ntendon))
    motors = (
        powers(m, "actuator_damping", i)
        for i in (range(actuators(m)) if hasattr(m, "actuator_damping") else ())
    )
    return medium(m) is not None or any(any(one[1:]) for one in (*tendons, *motors))


def _moves(m: Any) -> bool:
    """Whether motors act on frames, whose dampers may have no place in the sparsity of M."""
    import mujoco

    fixed = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_TENDON))
    return any(m.actuator_trntype[i] not in fixed for i in range(actuators(m)))


def _dampers(m: Any) -> Array | None:
    """What `implicitfast` takes at the end, (nv, nv), as MuJoCo has it; None: it is no constant."""
    import mujoco

    found = []
    for speed in (0.0, 1.0):
        data = mujoco.MjData(m)
        mujoco.mj_integratePos(m, data.qpos, np.full(m.nv, 0.3), speed)
        data.qvel[:] = speed
        mujoco.mj_step(m, data)
        late = np.zeros((m.nv, m.nv))
        rows = np.repeat(np.arange(m.nv), m.D_rownnz)
        late[rows, m.D_colind] = -np.array(data.qDeriv)
        found.append(late)
    size = np.max(np.abs(found[0]), initial=0.0)
    still, moving = found
    return still if np.allclose(still, moving, rtol=0, atol=1e-12 * size) else None
