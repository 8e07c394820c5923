"""Tendons and actuators of a compiled model as forces along combinations of joints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from harness.engines.compiled import CompiledCoupling, CompiledPull, Numbers

_SPRING, _DAMPER, _ACTUATION = "SPRING", "DAMPER", "ACTUATION"


def pulls(m: Any) -> Iterator[CompiledPull]:
    """All that are straight: those of fixed tendons that pull, and of actuators without a state.

    What a file's flags switch off pulls nothing.
    """
    for i in range(m.ntendon):
        if straight_tendon(m, i) and pulls_by_itself(m, i):
            yield CompiledPull(
                name=m.tendon(i).name or f"tendon_{i}",
                joints=_tendon(m, i),
                stiffness=powers(m, "tendon_stiffness", i) if acts(m, _SPRING) else (),
                damping=powers(m, "tendon_damping", i) if acts(m, _DAMPER) else (),
                rest=_pair(m.tendon_lengthspring[i]),
                armature=float(m.tendon_armature[i]),
            )
    for i in range(m.nu):
        if straight_actuator(m, i):
            yield from _actuator(m, i)


def acts(m: Any, what: str) -> bool:
    """Whether a file's flags leave it on."""
    import mujoco

    return not int(m.opt.disableflags) & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{what}"))


def straight_tendon(m: Any, i: int) -> bool:
    """Whether it is a combination of joints."""
    import mujoco

    return bool(m.wrap_type[m.tendon_adr[i]] == mujoco.mjtWrap.mjWRAP_JOINT)


def pulls_by_itself(m: Any, i: int) -> bool:
    """Whether a tendon has a spring, a damper or an armature."""
    own = (*powers(m, "tendon_stiffness", i), *powers(m, "tendon_damping", i))
    return bool(any(own) or m.tendon_armature[i])


def straight_actuator(m: Any, i: int) -> bool:
    """Whether its force is affine in a joint's or tendon's position and velocity.

    It has no state, no delay and one input, which its gain multiplies.
    """
    import mujoco

    gain, bias = mujoco.mjtGain(m.actuator_gaintype[i]), mujoco.mjtBias(m.actuator_biastype[i])
    held = (
        m.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_NONE
        and gain in (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_AFFINE)
        and bias in (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
        and not (hasattr(m, "actuator_delay") and m.actuator_delay[i])
        and not (hasattr(m, "actuator_ctrlnum") and m.actuator_ctrlnum[i] != 1)
    )
    if not held:
        return False
    target = int(m.actuator_trnid[i][0])
    match mujoco.mjtTrn(m.actuator_trntype[i]):
        case mujoco.mjtTrn.mjTRN_JOINT | mujoco.mjtTrn.mjTRN_JOINTINPARENT:
            return mujoco.mjtJoint(m.jnt_type[target]) in (
                mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE,
            )  # fmt: skip
        case mujoco.mjtTrn.mjTRN_TENDON:
            return straight_tendon(m, target)
    return False


def couplings(m: Any) -> Iterator[CompiledCoupling]:
    """Joints that equalities make follow others, or stand still, by a straight line."""
    for i in straight_equalities(m):
        one, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        offset, multiplier = float(m.eq_data[i][0]), float(m.eq_data[i][1])
        offset += float(m.qpos0[m.jnt_qposadr[one]])
        if other >= 0:
            offset -= multiplier * float(m.qpos0[m.jnt_qposadr[other]])
        yield CompiledCoupling(
            follower=one,
            leader=other if other >= 0 else None,
            multiplier=multiplier if other >= 0 else 0.0,
            offset=offset,
        )


def straight_equalities(m: Any) -> list[int]:
    """Those that make a slide or hinge follow another by a straight line, or stand still.

    They are active, and each the first for its joint; no leader follows one of its followers.
    """
    import mujoco

    found, leaders = list[int](), dict[int, int]()
    for i in range(m.neq) if acts(m, "EQUALITY") else ():
        if m.eq_type[i] != mujoco.mjtEq.mjEQ_JOINT or not m.eq_active0[i]:
            continue
        one, at = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        if np.any(m.eq_data[i][2:5]) or one in leaders:
            continue
        leader = at
        while at in leaders:
            at = leaders[at]
        if at != one:
            found.append(i)
            leaders[one] = leader
    return found


def joint_name(m: Any, i: int) -> str:
    """Its own, or what it is called without one."""
    return str(m.joint(i).name) or f"joint_{i}"


def _actuator(m: Any, i: int) -> Iterator[CompiledPull]:
    """Its force; and its own damper and armature, which count from the motor's side (gear^2)."""
    import mujoco

    target, gear = int(m.actuator_trnid[i][0]), float(m.actuator_gear[i][0])
    tendon = m.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON
    joints = _tendon(m, target) if tendon else ((target, 1.0),)
    name = m.actuator(i).name or f"actuator_{i}"
    if acts(m, _ACTUATION):
        affine = m.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
        turning = m.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_AFFINE
        gain = [float(one) for one in m.actuator_gainprm[i][:3]]
        limited = bool(m.actuator_ctrllimited[i])
        yield CompiledPull(
            name=name,
            joints=tuple((j, gear * share) for j, share in joints),
            bias=_triple(m.actuator_biasprm[i]) if affine else (0.0, 0.0, 0.0),
            gain=(gain[0], gain[1], gain[2]) if turning else (gain[0], 0.0, 0.0),
            control=int(m.actuator_ctrladr[i]) if hasattr(m, "actuator_ctrladr") else i,
            range=_pair(m.actuator_ctrlrange[i]) if limited else None,
        )
    if hasattr(m, "actuator_armature"):
        damping = tuple(gear**2 * d for d in powers(m, "actuator_damping", i))
        armature = gear**2 * float(m.actuator_armature[i])
        if any(damping) or armature:
            yield CompiledPull(
                name=name,
                joints=joints,
                damping=damping if acts(m, _DAMPER) else (),
                armature=armature,
            )


def _tendon(m: Any, i: int) -> tuple[tuple[int, float], ...]:
    first, count = int(m.tendon_adr[i]), int(m.tendon_num[i])
    return tuple((int(m.wrap_objid[k]), float(m.wrap_prm[k])) for k in range(first, first + count))


def powers(m: Any, name: str, index: int) -> Numbers:
    """A stiffness or damping; MuJoCo 4 has polynomials."""
    higher = getattr(m, f"{name}poly")[index] if hasattr(m, f"{name}poly") else ()
    return tuple(float(v) for v in np.ravel([*np.ravel(getattr(m, name)[index]), *higher]))


def _pair(values: Any) -> tuple[float, float]:
    low, high = (float(value) for value in values)
    return low, high


def _triple(values: Any) -> tuple[float, float, float]:
    one, two, three = (float(value) for value in values[:3])
    return one, two, three
