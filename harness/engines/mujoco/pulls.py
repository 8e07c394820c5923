"""Forces of a compiled model: tendons and actuators along lengths, and the drag of its fluid.

Lengths are of joints, points or frames.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.bodies import (
    ZERO,
    Coupling,
    ForceElement,
    Powers,
    Quaternion,
    Site,
    Triple,
)
from physics_crosscheck.reference.mechanism.tree import CablePath, Fluid, FrameForce, JointForce
from ..compiled import Numbers

Length = CablePath[Site] | FrameForce[Site] | JointForce[str]
Combination = tuple[tuple[int, float], ...]
"""Coefficients by the index of a hinge or slide."""


def of_tendon(m: Any, i: int, gear: float = 1.0) -> Combination | Length | None:
    """Return a combination of joints, or segments between sites; None if the tendon wraps
    shapes.
    """
    import mujoco

    first, count = int(m.tendon_adr[i]), int(m.tendon_num[i])
    rows = range(first, first + count)
    kinds = {mujoco.mjtWrap(m.wrap_type[k]) for k in rows}
    if kinds == {mujoco.mjtWrap.mjWRAP_JOINT}:
        return tuple((int(m.wrap_objid[k]), gear * float(m.wrap_prm[k])) for k in rows)
    if not kinds <= {mujoco.mjtWrap.mjWRAP_SITE, mujoco.mjtWrap.mjWRAP_PULLEY}:
        return None
    branches: list[tuple[float, list[Site]]] = [(gear, [])]
    for k in rows:
        if m.wrap_type[k] == mujoco.mjtWrap.mjWRAP_PULLEY:
            branches.append((gear / float(m.wrap_prm[k]), []))
        else:
            branches[-1][1].append(mark(m, int(m.wrap_objid[k])))
    return CablePath(branches=tuple((share, tuple(row)) for share, row in branches if len(row) > 1))


def of_actuator(m: Any, i: int, gear: Numbers) -> Combination | Length | None:
    """Return the same for an actuator; None for slider-cranks, bodies and later transmissions."""
    import mujoco

    kind = mujoco.mjtTrn(m.actuator_trntype[i])
    target, other = map(int, m.actuator_trnid[i])
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        return of_tendon(m, target, gear[0])
    if kind == mujoco.mjtTrn.mjTRN_SITE:
        against = mark(m, other) if other >= 0 else None
        return FrameForce(frame=mark(m, target), against=against, gear=gear)
    inside = kind == mujoco.mjtTrn.mjTRN_JOINTINPARENT
    if not inside and kind != mujoco.mjtTrn.mjTRN_JOINT:
        return None
    joint = mujoco.mjtJoint(m.jnt_type[target])
    if joint in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        return ((target, gear[0]),)
    size = 3 if joint == mujoco.mjtJoint.mjJNT_BALL else 6
    return JointForce(joint=joint_name(m, target), gear=gear[:size], in_parent=inside)


def mark(m: Any, site: int) -> Site:
    """Return a site."""
    return Site(
        body=body_name(m, int(m.site_bodyid[site])),
        position=as_triple(m.site_pos[site]),
        quaternion=as_quaternion(m.site_quat[site]),
    )


def body_name(m: Any, i: int) -> str | None:
    """Return a body's name, or an unused name by its index; None for the world."""
    if not i:
        return None
    name = str(m.body(i).name)
    return name or _unused(m, f"body_{i}")


def _unused(m: Any, name: str) -> str:
    try:
        m.body(name)
    except KeyError:
        return name
    return _unused(m, f"{name}_")


FAINT = 1e-300
"""A remaining share of an ellipsoid's forces: at zero, MuJoCo would drag its body's box."""


def box_fluid(m: Any) -> Fluid | None:
    """Return the fluid of the inertia model, or None if no fluid or passive force acts."""
    if not (m.opt.density > 0 or m.opt.viscosity > 0) or not (
        acts(m, "SPRING") or acts(m, "DAMPER")
    ):
        return None
    density, viscosity = float(m.opt.density), float(m.opt.viscosity)
    return Fluid(density=density, viscosity=viscosity, wind=as_triple(m.opt.wind))


def ellipsoids(m: Any) -> Any:
    """Return which geoms, (ngeom,), the fluid model treats as ellipsoids: their bodies have no box
    drag.
    """
    return np.array(m.geom_fluid)[:, 0] > 0


def without_ellipsoids(m: Any) -> None:
    """Remove the fluid forces on these geoms and their bodies."""
    m.geom_fluid[ellipsoids(m), 0] = FAINT


def has_box_drag(m: Any, body: int) -> bool:
    """Return whether the fluid acts on a body as on a box."""
    first, count = int(m.body_geomadr[body]), int(m.body_geomnum[body])
    return not (count and ellipsoids(m)[first : first + count].any())


UNCOUPLED = "armature of a tendon across branches couples no joints"
"""The cause that a diagnosis reports."""

_SPRING, _DAMPER, _ACTUATION = "SPRING", "DAMPER", "ACTUATION"


def pulls(m: Any) -> Iterator[ForceElement]:
    """Yield all forces that have a formula: of tendons and of actuators.

    Forces that a file's flags disable are left out.
    """
    for i in range(m.ntendon):
        if covered_tendon(m, i) and pulls_by_itself(m, i):
            stiffness = powers(m, "tendon_stiffness", i) if acts(m, _SPRING) else ()
            damping = powers(m, "tendon_damping", i) if acts(m, _DAMPER) else ()
            yield force_element(
                m,
                m.tendon(i).name or f"tendon_{i}",
                of_tendon(m, i),
                stiffness=as_powers(stiffness),
                damping=as_powers(damping),
                rest=as_pair(m.tendon_lengthspring[i]),
                armature=float(m.tendon_armature[i]) if not spatial_tendon(m, i) else 0.0,
            )
    for i in range(actuators(m)):
        if covered_actuator(m, i):
            yield from _actuator(m, i)


def actuators(m: Any) -> int:
    """Return the number of actuators; in MuJoCo 4 one can have several inputs."""
    return int(getattr(m, "nactuator", m.nu))


def output(m: Any, i: int) -> int:
    """Return an actuator's row in arrays with one row per force."""
    return int(m.actuator_outadr[i]) if hasattr(m, "actuator_outadr") else i


def control(m: Any, i: int) -> int:
    """Return the index of an actuator's first input."""
    return int(m.actuator_ctrladr[i]) if hasattr(m, "actuator_ctrladr") else i


def acts(m: Any, what: str) -> bool:
    """Return whether a file's flags leave a feature on."""
    import mujoco

    return not int(m.opt.disableflags) & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{what}"))


def covered_tendon(m: Any, i: int) -> bool:
    """Return whether a tendon is a combination of joints, or of segments between sites."""
    return of_tendon(m, i) is not None


def spatial_tendon(m: Any, i: int) -> bool:
    """Return whether a tendon is spatial."""
    import mujoco

    return bool(m.wrap_type[m.tendon_adr[i]] != mujoco.mjtWrap.mjWRAP_JOINT)


def pulls_by_itself(m: Any, i: int) -> bool:
    """Return whether a tendon has a spring, a damper or an armature."""
    coefficients = (*powers(m, "tendon_stiffness", i), *powers(m, "tendon_damping", i))
    return bool(any(coefficients) or m.tendon_armature[i])


def covered_actuator(m: Any, i: int) -> bool:
    """Return whether its force is affine in a length that has a formula, and that length's rate.

    It has one input, which its gain multiplies, without a delay; or a constant state.
    """
    import mujoco

    gain, bias = mujoco.mjtGain(m.actuator_gaintype[i]), mujoco.mjtBias(m.actuator_biastype[i])
    kept = mujoco.mjtDyn(m.actuator_dyntype[i]) == mujoco.mjtDyn.mjDYN_NONE or held_state(m, i) >= 0
    affine = (
        gain in (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_AFFINE)
        and bias in (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
        and not (hasattr(m, "actuator_delay") and m.actuator_delay[i])
        and not (hasattr(m, "actuator_ctrlnum") and m.actuator_ctrlnum[i] != 1)
    )
    if not kept or not affine:
        return False
    way = of_actuator(m, i, gear_of(m, i))
    # Its own dampers and armature have no formula here on ball and free joints.
    return way is not None and not (isinstance(way, JointForce) and any(armature_and_damping(m, i)))


def held_state(m: Any, i: int) -> int:
    """Return the index of an actuator's state that a held input keeps constant, or -1."""
    import mujoco

    able = (
        mujoco.mjtDyn.mjDYN_INTEGRATOR,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
    )
    if mujoco.mjtDyn(m.actuator_dyntype[i]) not in able or m.actuator_actnum[i] != 1:
        return -1
    return int(m.actuator_actadr[i])


def joint_name(m: Any, i: int) -> str:
    """Return a joint's name, or a name by its index."""
    return str(m.joint(i).name) or f"joint_{i}"


def _actuator(m: Any, i: int) -> Iterator[ForceElement]:
    """Yield its force, and its own damper and armature, which scale with gear^2 (motor side)."""
    import mujoco

    gear = gear_of(m, i)
    name = m.actuator(i).name or f"actuator_{i}"
    if acts(m, _ACTUATION) and not is_off(m, i):
        affine = m.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
        turning = m.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_AFFINE
        gain = [float(one) for one in m.actuator_gainprm[i][:3]]
        yield force_element(
            m,
            name,
            of_actuator(m, i, gear),
            bias=as_triple(m.actuator_biasprm[i][:3]) if affine else ZERO,
            gain=(gain[0], gain[1], gain[2]) if turning else (gain[0], 0.0, 0.0),
            input=control(m, i),
            range=_range(m, i),
        )
    armature, *damping = armature_and_damping(m, i)
    way = of_actuator(m, i, (1.0, *gear[1:]))
    if any(armature_and_damping(m, i)) and not isinstance(way, FrameForce):
        yield force_element(
            m,
            name,
            way,
            damping=as_powers([gear[0] ** 2 * d for d in damping if acts(m, _DAMPER)]),
            armature=gear[0] ** 2 * armature if isinstance(way, tuple) else 0.0,
        )


def force_element(m: Any, name: str, way: Combination | Length | None, **rest: Any) -> ForceElement:
    """Return a force along a length."""
    if way is None or isinstance(way, tuple):
        joints = tuple((joint_name(m, joint), share) for joint, share in way or ())
        return ForceElement(name=name, joints=joints, **rest)
    return ForceElement(name=name, along=way, **rest)


def _range(m: Any, i: int) -> tuple[float, float] | None:
    """Return the range of its input or state, or None."""
    if held_state(m, i) >= 0 and m.actuator_actlimited[i]:
        return as_pair(m.actuator_actrange[i])
    index = control(m, i)
    return as_pair(m.actuator_ctrlrange[index]) if m.actuator_ctrllimited[index] else None


def is_off(m: Any, i: int) -> bool:
    """Return whether an actuator's group is disabled."""
    group = int(m.actuator_group[i])
    return 0 <= group <= 30 and bool(int(m.opt.disableactuator) >> group & 1)


def gear_of(m: Any, i: int) -> Numbers:
    """Return the gear of an actuator, (6,)."""
    return numbers_of(m.actuator_gear[output(m, i)])


def armature_and_damping(m: Any, i: int) -> Numbers:
    """Return the armature and the damping coefficients of an actuator itself (MuJoCo 4)."""
    if not hasattr(m, "actuator_armature"):
        return (0.0,)
    return (float(m.actuator_armature[i]), *powers(m, "actuator_damping", i))


def powers(m: Any, name: str, index: int) -> Numbers:
    """Return a stiffness or damping; MuJoCo 4 has polynomials."""
    higher = getattr(m, f"{name}poly")[index] if hasattr(m, f"{name}poly") else ()
    return numbers_of([*np.ravel(getattr(m, name)[index]), *higher])


def numbers_of(values: Any) -> Numbers:
    """Return all numbers of an array, row by row."""
    return tuple(np.asarray(values, dtype=float).ravel().tolist())


def as_pair(values: Any) -> tuple[float, float]:
    """Return two numbers."""
    low, high = (float(value) for value in values)
    return low, high


def as_triple(values: Any) -> Triple:
    """Return three numbers."""
    first, second, third = map(float, values)
    return first, second, third


def as_quaternion(values: Any) -> Quaternion | None:
    """Return a quaternion; None for the identity."""
    w, x, y, z = map(float, values)
    return None if (x, y, z) == ZERO else (w, x, y, z)


def as_powers(values: Sequence[float]) -> Powers:
    """Return one number if the higher powers are zero."""
    return tuple(values) if any(values[1:]) else (values[0] if values else 0.0)


def split_tendons(m: Any) -> Iterator[tuple[int, tuple[str, str]]]:
    """Yield fixed tendons with an armature across branches, each with two joints of different ones.

    The sparse mass matrix has no entry for two joints on different branches: `mj_tendonArmature`
    leaves their coupling out.
    """
    for i in range(m.ntendon):
        pairs = _pairs(m, i, related=False) if m.tendon_armature[i] else []
        if pairs:
            first, other = pairs[0]
            yield i, (joint_name(m, first), joint_name(m, other))


def pulls_as_computed(m: Any) -> tuple[ForceElement, ...]:
    """Return all forces, with tendon armatures uncoupled across branches as in MuJoCo."""
    split = dict(split_tendons(m))
    names = {m.tendon(i).name or f"tendon_{i}": i for i in split}
    result: list[ForceElement] = []
    for force in pulls(m):
        i = names.get(force.name)
        if i is None or not force.armature:
            result.append(force)
            continue
        result.append(replace(force, armature=0.0))
        shares = dict(force.joints)
        related = [tuple(joint_name(m, k) for k in pair) for pair in _pairs(m, i, related=True)]
        for pair in related:  # includes the two joints' own inertias
            joints = tuple((joint, shares[joint]) for joint in pair)
            result.append(ForceElement(name=force.name, joints=joints, armature=force.armature))
        for joint, share in force.joints:
            armature = force.armature * (1 - sum(joint in pair for pair in related))
            single = ((joint, share),)
            result.append(ForceElement(name=force.name, joints=single, armature=armature))
    return tuple(result)


def _pairs(m: Any, i: int, *, related: bool) -> list[tuple[int, int]]:
    """Return pairs of a fixed tendon's joints on the same branch, or on different ones."""
    way = () if spatial_tendon(m, i) else of_tendon(m, i)
    joints = [j for j, share in way if share] if isinstance(way, tuple) else []
    return [
        (one, other)
        for k, other in enumerate(joints)
        for one in joints[:k]
        if related == (_carries(m, one, other) or _carries(m, other, one))
    ]


def _carries(m: Any, joint: int, other: int) -> bool:
    """Return whether a joint moves another one, or is on the same body."""
    body, above = int(m.jnt_bodyid[other]), int(m.jnt_bodyid[joint])
    while body and body != above:
        body = int(m.body_parentid[body])
    return body == above


_CURVED = slice(2, 5)
"""Coefficients of an equality's polynomial that make it nonlinear."""


_LinearCoupling = tuple[int, Mapping[int, float], float]
"""A joint, and its position as multiples of others' positions, by index, and an offset."""


def couplings(m: Any) -> Iterator[Coupling]:
    """Yield joints that linear equalities couple to others or fix."""
    for follower, leaders, offset in straight_equalities(m).values():
        (leader, multiplier), *others = leaders.items() or [(None, 0.0)]
        yield Coupling(
            follower=joint_name(m, follower),
            leader=None if leader is None else joint_name(m, leader),
            multiplier=multiplier,
            offset=offset,
            others=tuple((joint_name(m, joint), x) for joint, x in others if joint is not None),
        )


def equalities_act(m: Any) -> bool:
    """Return whether a model has equalities and its flags leave them on."""
    return bool(m.eq_active0.any()) and acts(m, "EQUALITY") and acts(m, "CONSTRAINT")


def straight_equalities(m: Any) -> dict[int, _LinearCoupling]:
    """Return active linear equalities of joints or fixed tendons, by index.

    Each is the first for its follower, and no leader follows one of its followers.
    """
    couplings_by_row: dict[int, _LinearCoupling] = {}
    leaders: dict[int, set[int]] = {}
    for i in range(m.neq) if equalities_act(m) else ():
        if not m.eq_active0[i] or m.eq_data[i][_CURVED].any():
            continue
        for follower, shares, offset in _followings(m, i):
            if follower not in leaders and follower not in _above(shares, leaders):
                couplings_by_row[i] = follower, shares, offset
                leaders[follower] = set(shares)
                break
    return couplings_by_row


def _above(joints: Mapping[int, float], leaders: Mapping[int, set[int]]) -> set[int]:
    """Return these joints and all their leaders, direct and indirect."""
    passed: set[int] = set()
    waiting = list(joints)
    while waiting:
        joint = waiting.pop()
        if joint not in passed:
            passed.add(joint)
            waiting += leaders.get(joint, ())
    return passed


def _followings(m: Any, i: int) -> Iterator[_LinearCoupling]:
    """Yield an equality as possible couplings; for a tendon, its largest coefficient first."""
    import mujoco

    first, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
    start, slope = float(m.eq_data[i][0]), float(m.eq_data[i][1])
    if m.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
        leaders = {other: slope} if other >= 0 else {}
        offset = start + _drawn(m, first) - sum(x * _drawn(m, k) for k, x in leaders.items())
        yield first, leaders, offset
    if m.eq_type[i] != mujoco.mjtEq.mjEQ_TENDON:
        return
    shares: dict[int, float] = {}
    for tendon, by in ((first, 1.0), *(((other, -slope),) if other >= 0 else ())):
        way = of_tendon(m, tendon, by)
        if not isinstance(way, tuple):
            return
        for joint, share in way:
            shares[joint] = shares.get(joint, 0.0) + share
    whole = start + sum(share * _drawn(m, joint) for joint, share in shares.items())
    for joint in sorted(shares, key=lambda joint: -abs(shares[joint])):
        coefficient = shares[joint]
        if coefficient:
            rest = {k: -share / coefficient for k, share in shares.items() if k != joint and share}
            yield joint, rest, whole / coefficient


def _drawn(m: Any, joint: int) -> float:
    """Return a joint's position in the drawn configuration."""
    return float(m.qpos0[m.jnt_qposadr[joint]])
