"""What MuJoCo has beyond smooth dynamics: switched off where that is asked, and counted."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.equalities import equalities_act, straight_equalities
from physics_crosscheck.harness.engines.mujoco.medium import ellipsoids, medium, without_ellipsoids
from physics_crosscheck.harness.engines.mujoco.pulls import (
    acts,
    actuators,
    control,
    covered_actuator,
    covered_tendon,
    joint_name,
    pulls_by_itself,
    spatial_tendon,
)
from physics_crosscheck.harness.engines.mujoco.shapes import without_idle_files

_SOLREF, _SOLIMP = [1e-12, 0.5], [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Of equalities as stiff as a step allows, settled after one: steps may be 1e-8 s and shorter."""

_HEAVIER = 1e-2
"""With it, limits of what tendons tie are known to 3e-12, without to 2e-9; of two fingers whose
joints have seven times their mass in armature, to 3e-12 and 1e-9: what a soft equality gives way by
at the start is gone after a step."""


def switch_off(tree: Any, *, smooth: bool, actuated: bool) -> None:
    """Leave out of a specification what `smooth` and `actuators` of a sidecar say."""
    import mujoco

    names = ("CONTACT", "LIMIT", "FRICTIONLOSS", "CLAMPCTRL") if smooth else ()
    for name in (*names, *(() if actuated else ("ACTUATION",))):
        tree.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    if smooth:
        without_idle_files(tree)


def hold(m: Any, followers: Collection[str] | None) -> None:
    """Let those equalities alone act that make these joints follow others; None: all."""
    if followers is not None:
        held = {
            i
            for i, one in straight_equalities(m).items()
            if joint_name(m, one.follower) in followers
        }
        for i in set(range(m.neq)) - held:
            m.eq_active0[i] = 0


def leave_out(m: Any) -> None:
    """Take from a compiled model what has no formula here, and all saturation.

    Equalities that are left hold at once, by a solver that goes on to the last digit, and under
    Euler's steps, since with others their limits can't be told.
    """
    import mujoco

    m.eq_solref[:], m.eq_solimp[:] = _SOLREF, _SOLIMP
    if m.eq_active0.any():
        m.opt.tolerance, m.opt.iterations = 0.0, 100
        m.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Dampers taken implicitly act after the solver, so that they would let go of equalities.
        m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        # Without this safeguard an equality as stiff as here would diverge at any step.
        m.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
        m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 has a wrong sparse Hessian
        # By which the softness of an equality is scaled: far above what a tendon feels, and where
        # a body stands at its own center without the armature of its joint.
        m.tendon_invweight0[:] *= _HEAVIER
        m.dof_invweight0[:] *= _HEAVIER
    limited = ("actuator_forcelimited", "actuator_actlimited", "jnt_actfrclimited")
    for name in (*limited, "tendon_actfrclimited"):
        getattr(m, name)[:] = 0
    without_ellipsoids(m)
    own = ("damping", "dampingpoly", "armature")
    force = (
        "gainprm",
        "biasprm",
        "gaintype",
        "biastype",
        "dyntype",
    )  # of type 0 they are constants
    _zero(m, "actuator", (*force, *own), _bent_actuators(m))
    _zero(m, "tendon", ("armature",), _heavy_cords(m))
    _zero(m, "actuator", ("armature",), _heavy_motors(m))
    _zero(m, "tendon", ("stiffness", "stiffnesspoly", *own), _bent_tendons(m))


def _zero(m: Any, of: str, names: tuple[str, ...], rows: Iterable[int]) -> None:
    """Set some fields of some rows to zero; those of later versions where they are there."""
    wanted = list(rows)
    for name in names:
        if hasattr(m, f"{of}_{name}"):
            getattr(m, f"{of}_{name}")[wanted] = 0


def _bent_actuators(m: Any) -> list[int]:
    return [i for i in range(actuators(m)) if not covered_actuator(m, i)]


def _bent_tendons(m: Any) -> list[int]:
    return [i for i in range(m.ntendon) if pulls_by_itself(m, i) and not covered_tendon(m, i)]


def _heavy_cords(m: Any) -> list[int]:
    """Tendons through space with an armature."""
    return [i for i in range(m.ntendon) if spatial_tendon(m, i) and m.tendon_armature[i]]


def _heavy_motors(m: Any) -> list[int]:
    """Actuators with an armature on such tendons."""
    import mujoco

    if not hasattr(m, "actuator_armature"):
        return []
    on = int(mujoco.mjtTrn.mjTRN_TENDON)
    return [
        i
        for i in range(actuators(m))
        if m.actuator_armature[i] and m.actuator_trntype[i] == on
        if spatial_tendon(m, int(m.actuator_trnid[i][0]))
    ]


def without_joints(tree: Any, joints: tuple[str, ...]) -> None:
    """Take joints out of a specification, so that what they carry stands where it is drawn.

    Those without a name are called as the adapter calls them. Actuators, sensors and equalities
    of such a joint go with it, and all keyframes, which have a position of it.
    """
    users = (
        *((one, (one.target,)) for one in tree.actuators),
        *((one, (one.objname,)) for one in tree.sensors),
        *((one, (one.name1, one.name2)) for one in tree.equalities),
    )
    gone = [one for one, targets in users if set(targets) & set(joints)]
    gone += list(tree.keys) if joints else []
    rows = enumerate(tree.joints)
    gone += [joint for i, joint in rows if (joint.name or f"joint_{i}") in joints]
    for one in gone:
        tree.delete(one)


def besides(m: Any) -> tuple[tuple[str, int], ...]:
    """What of a compiled model these settings leave out, with its number."""
    held = int(np.count_nonzero(m.eq_active0)) if equalities_act(m) else 0
    touching = (np.array(m.geom_contype) | np.array(m.geom_conaffinity)) != 0
    counts: dict[str, Any] = {
        "actuators of other laws or transmissions": len(_bent_actuators(m)),
        "saturation of actuators": sum(map(bool, _saturation(m)))
        + np.count_nonzero(m.jnt_actfrclimited)
        + np.count_nonzero(m.tendon_actfrclimited),
        "tendons around shapes that pull": len(_bent_tendons(m)),
        "armatures along tendons in space": len(_heavy_cords(m)) + len(_heavy_motors(m)),
        "equality constraints": held - len(straight_equalities(m)),
        "limits of position": np.count_nonzero(m.jnt_limited) + np.count_nonzero(m.tendon_limited),
        "dry friction": np.count_nonzero(m.dof_frictionloss)
        + np.count_nonzero(m.tendon_frictionloss),
        "contact geometry": np.count_nonzero(touching),
        "ellipsoids in a medium": np.count_nonzero(ellipsoids(m)) if medium(m) else 0,
    }
    return tuple((what, int(count)) for what, count in counts.items() if count)


def _saturation(m: Any) -> Iterator[bool]:
    """Yield whether each actuator has a bound of its control, its state or its force."""
    for i in range(actuators(m)):
        limited = m.actuator_ctrllimited[control(m, i)], m.actuator_actlimited[i]
        yield any((*limited, m.actuator_forcelimited[i]))


def uncovered(m: Any) -> tuple[str, ...]:
    """What acts whatever these settings say, and is in no tree of bodies."""
    lifted = bool(np.any(m.body_gravcomp)) and bool(np.any(m.jnt_actgravcomp))
    found = {
        "flexible bodies": bool(getattr(m, "nflex", 0)),
        "plugins": bool(m.nplugin),
        # MuJoCo counts it among the forces of actuators, which this flag takes away.
        "gravity compensation by actuators that are off": lifted and not acts(m, "ACTUATION"),
    }
    return tuple(what for what, there in found.items() if there)
