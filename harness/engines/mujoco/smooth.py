"""Features of MuJoCo beyond smooth dynamics: switched off under `smooth`, and counted."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.pulls import (
    acts,
    actuators,
    box_fluid,
    control,
    covered_actuator,
    covered_tendon,
    ellipsoids,
    equalities_act,
    joint_name,
    pulls_by_itself,
    spatial_tendon,
    straight_equalities,
    without_ellipsoids,
)
from physics_crosscheck.harness.engines.mujoco.shapes import without_idle_files
from physics_crosscheck.harness.engines.protocol import ModelSpec, held_joints

_SOLREF, _SOLIMP = [1e-12, 0.5], [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Equalities as stiff as a step allows, which settle in one step; steps can be 1e-8 s or less."""

_INVERSE_WEIGHT_FACTOR = 1e-2
"""A factor of the inverse weights that scale the softness of equalities.

With it, limits of tendon equalities are known to 3e-12, without it to 2e-9. For two fingers with
seven times their mass in armature these are 3e-12 and 1e-9. The initial error of a soft equality is
gone after one step.
"""


def switch_off(tree: Any, *, smooth: bool, actuated: bool) -> None:
    """Disable the features that `smooth` and `actuators` of a sidecar exclude."""
    import mujoco

    names = ("CONTACT", "LIMIT", "FRICTIONLOSS", "CLAMPCTRL") if smooth else ()
    for name in (*names, *(() if actuated else ("ACTUATION",))):
        tree.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    if smooth:
        without_idle_files(tree)


def keep_equalities(m: Any, followers: Collection[str] | None) -> None:
    """Activate only those equalities whose followers are named; None activates all."""
    if followers is not None:
        held = {
            i
            for i, (follower, *_) in straight_equalities(m).items()
            if joint_name(m, follower) in followers
        }
        for i in set(range(m.neq)) - held:
            m.eq_active0[i] = 0


def remove_uncovered(m: Any) -> None:
    """Remove features without a formula here, and all saturation, from a compiled model.

    The remaining equalities settle in one step. Their solver iterates to the last digit, under
    Euler steps, since their limits are not known for the other integrators.
    """
    import mujoco

    m.eq_solref[:], m.eq_solimp[:] = _SOLREF, _SOLIMP
    if m.eq_active0.any():
        m.opt.tolerance, m.opt.iterations = 0.0, 100
        m.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Implicit dampers act after the solver, so they would break equalities.
        m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        # Without this safeguard an equality as stiff as here would diverge at any step.
        m.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
        m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 has a wrong sparse Hessian
        # The inverse weights scale the softness of an equality. They are much larger than a
        # tendon's effective inverse mass, and for a body at its own center they omit the
        # joint's armature.
        m.tendon_invweight0[:] *= _INVERSE_WEIGHT_FACTOR
        m.dof_invweight0[:] *= _INVERSE_WEIGHT_FACTOR
    limited = ("actuator_forcelimited", "actuator_actlimited", "jnt_actfrclimited")
    for name in (*limited, "tendon_actfrclimited"):
        getattr(m, name)[:] = 0
    without_ellipsoids(m)
    own_fields = ("damping", "dampingpoly", "armature")
    force = (
        "gainprm",
        "biasprm",
        "gaintype",
        "biastype",
        "dyntype",
    )  # type 0 is constant
    _zero(m, "actuator", (*force, *own_fields), _uncovered_actuators(m))
    _zero(m, "tendon", ("armature",), _spatial_tendons_with_armature(m))
    _zero(m, "actuator", ("armature",), _actuators_with_armature(m))
    _zero(m, "tendon", ("stiffness", "stiffnesspoly", *own_fields), _uncovered_tendons(m))


def _zero(m: Any, prefix: str, names: tuple[str, ...], rows: Iterable[int]) -> None:
    """Set fields of some rows to zero, if this version has them."""
    wanted = list(rows)
    for name in names:
        if hasattr(m, f"{prefix}_{name}"):
            getattr(m, f"{prefix}_{name}")[wanted] = 0


def _uncovered_actuators(m: Any) -> list[int]:
    return [i for i in range(actuators(m)) if not covered_actuator(m, i)]


def _uncovered_tendons(m: Any) -> list[int]:
    return [i for i in range(m.ntendon) if pulls_by_itself(m, i) and not covered_tendon(m, i)]


def _spatial_tendons_with_armature(m: Any) -> list[int]:
    """Return spatial tendons with an armature."""
    return [i for i in range(m.ntendon) if spatial_tendon(m, i) and m.tendon_armature[i]]


def _actuators_with_armature(m: Any) -> list[int]:
    """Return actuators with an armature on such tendons."""
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


def without_joints(tree: Any, spec: ModelSpec) -> ModelSpec:
    """Remove held joints from a specification, so that their bodies stay at the drawn positions.

    Unnamed joints have the adapter's names. Actuators, sensors and equalities of such a joint are
    removed with it, and so are all keyframes, which contain its position.

    Returns:
        The settings without the controls of these actuators.
    """
    joints, controls = held_joints(spec), spec.settings.get("controls")
    acting = [one.target not in joints for one in tree.actuators]
    if isinstance(controls, list) and len(controls) == len(acting):
        kept = [value for value, acts in zip(controls, acting, strict=True) if acts]
        spec = replace(spec, settings={**spec.settings, "controls": kept})
    users = (
        *((user, (user.target,)) for user in tree.actuators),
        *((user, (user.objname,)) for user in tree.sensors),
        *((user, (user.name1, user.name2)) for user in tree.equalities),
    )
    gone = [user for user, targets in users if set(targets) & set(joints)]
    gone += list(tree.keys) if joints else []
    rows = enumerate(tree.joints)
    gone += [joint for i, joint in rows if (joint.name or f"joint_{i}") in joints]
    for user in gone:
        tree.delete(user)
    return spec


_SMOOTH = _WRAPPED, _ARMATURES, _ELLIPSOIDS = (
    "tendons around shapes that pull",
    "armatures along tendons in space",
    "ellipsoids in a medium",
)
"""Smooth forces among the features that `besides` counts."""


def besides(m: Any) -> tuple[tuple[str, int], ...]:
    """Return the features of a compiled model that these settings leave out, with their counts."""
    held = int(np.count_nonzero(m.eq_active0)) if equalities_act(m) else 0
    touching = (np.array(m.geom_contype) | np.array(m.geom_conaffinity)) != 0
    counts: dict[str, Any] = {
        "actuators of other laws or transmissions": len(_uncovered_actuators(m)),
        "saturation of actuators": sum(map(bool, _saturation(m)))
        + np.count_nonzero(m.jnt_actfrclimited)
        + np.count_nonzero(m.tendon_actfrclimited),
        _WRAPPED: len(_uncovered_tendons(m)),
        _ARMATURES: len(_spatial_tendons_with_armature(m)) + len(_actuators_with_armature(m)),
        "equality constraints": held - len(straight_equalities(m)),
        "limits of position": np.count_nonzero(m.jnt_limited) + np.count_nonzero(m.tendon_limited),
        "dry friction": np.count_nonzero(m.dof_frictionloss)
        + np.count_nonzero(m.tendon_frictionloss),
        "contact geometry": np.count_nonzero(touching),
        _ELLIPSOIDS: np.count_nonzero(ellipsoids(m)) if box_fluid(m) else 0,
    }
    return tuple((what, int(count)) for what, count in counts.items() if count)


def _saturation(m: Any) -> Iterator[bool]:
    """Yield whether each actuator limits its control, its state or its force."""
    for i in range(actuators(m)):
        limited = m.actuator_ctrllimited[control(m, i)], m.actuator_actlimited[i]
        yield any((*limited, m.actuator_forcelimited[i]))


def smooth_omissions(m: Any) -> tuple[str, ...]:
    """Return the smooth forces of a compiled model that have no formula."""
    return (*uncovered(m), *(what for what, _ in besides(m) if what in _SMOOTH))


def uncovered(m: Any) -> tuple[str, ...]:
    """Return features that act under all settings and that no tree of bodies represents."""
    lifted = bool(np.any(m.body_gravcomp)) and bool(np.any(m.jnt_actgravcomp))
    features = {
        "flexible bodies": bool(getattr(m, "nflex", 0)),
        "plugins": bool(m.nplugin),
        # MuJoCo counts it among the forces of actuators, which this flag takes away.
        "gravity compensation by actuators that are off": lifted and not acts(m, "ACTUATION"),
    }
    return tuple(what for what, there in features.items() if there)
