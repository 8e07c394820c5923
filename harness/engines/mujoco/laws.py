"""Numbers of MuJoCo's laws that are not smooth, from a compiled model."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.bodies import ForceElement
from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    Anchor,
    ContactParameters,
    Curve,
    Dynamics,
    Laws,
    SoftEquality,
    SoftFriction,
    SoftLimit,
    Softness,
    Surface,
)
from .pulls import (
    acts,
    actuators,
    armature_and_damping,
    as_pair,
    box_fluid,
    control,
    ellipsoids,
    force_element,
    gear_of,
    is_off,
    numbers_of,
    of_actuator,
    of_tendon,
    output,
    powers,
)
from .smooth import smooth_omissions
from .state import BALL

_DYNAMICS: Mapping[str, Dynamics] = {
    "NONE": "none", "INTEGRATOR": "integrator", "FILTER": "filter",
    "FILTEREXACT": "exact filter", "MUSCLE": "muscle",
}  # fmt: skip
_CURVES: Mapping[str, Curve] = {
    "NONE": "none", "FIXED": "fixed", "AFFINE": "affine", "MUSCLE": "muscle",
}  # fmt: skip


def laws_of(m: Any) -> tuple[Laws, tuple[ForceElement, ...]]:
    """Return the numbers of the laws, and the paths along which they act: tendons, then drives."""
    import mujoco

    on = acts(m, "CONSTRAINT")
    integrator = mujoco.mjtIntegrator(m.opt.integrator).name.removeprefix("mjINT_").lower()
    drives = [i for i in range(actuators(m)) if of_actuator(m, i, gear_of(m, i)) is not None]
    override = bool(int(m.opt.enableflags) & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE))
    laws = Laws(
        step=float(m.opt.timestep),
        integrator="" if _has_no_rule(m, integrator) else integrator,
        elliptic=m.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC,
        friction_ratio=float(m.opt.impratio),
        safe=acts(m, "REFSAFE"),
        damps_implicitly=acts(m, "EULERDAMP") and acts(m, "DAMPER"),
        dampers=_joint_dampers(m),
        limits=tuple(_limits(m)) if on and acts(m, "LIMIT") else (),
        frictions=tuple(_frictions(m)) if on and acts(m, "FRICTIONLOSS") else (),
        equalities=tuple(_equalities(m)) if on and acts(m, "EQUALITY") else (),
        surfaces=tuple(_surface(m, i, override=override) for i in range(m.ngeom)),
        pairs=tuple(_pairs(m, override=override)),
        touching=frozenset(_touching(m)) if on and acts(m, "CONTACT") else frozenset(),
        drives=tuple(_drive(m, i, m.ntendon + k) for k, i in enumerate(drives)),
        sums=tuple(
            (
                tuple(k for k, i in enumerate(drives) if _driven_tendon(m, i) == t),
                as_pair(m.tendon_actfrcrange[t]),
            )
            for t in np.flatnonzero(m.tendon_actfrclimited)
        ),
        joint_ranges={
            j: (as_pair(m.jnt_actfrcrange[j]), bool(m.jnt_actgravcomp[j]))
            for j in range(m.njnt)
            if m.jnt_actfrclimited[j]
        },
        light=frozenset(int(i) for i in np.flatnonzero(np.array(m.body_simple) == 2)),
        uncovered=tuple(_uncovered(m)),
    )
    ways = [of_tendon(m, t) or () for t in range(m.ntendon)]  # () for one that wraps shapes
    ways += [of_actuator(m, i, gear_of(m, i)) or () for i in drives]
    return laws, tuple(force_element(m, "path", way) for way in ways)


def _has_no_rule(m: Any, integrator: str) -> bool:
    """Return whether velocities at a step's end follow from forces whose slopes have no law."""
    import mujoco

    hinges = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
    turning = (i for i in range(m.nv) if m.jnt_type[m.dof_jntid[i]] not in hinges)
    implicit = integrator.startswith("implicit")
    return any(any(powers(m, "dof_damping", i)[1:]) for i in turning) or (
        implicit and box_fluid(m) is not None and any(ellipsoids(m))
    )


def _joint_dampers(m: Any) -> dict[int, tuple[float, ...]]:
    """Return the powers of dampers on joints, without the linear ones of joints, by joint."""
    import mujoco

    dampers: dict[int, Any] = {}
    for i in range(m.nv):
        if any(higher := powers(m, "dof_damping", i)[1:]):
            dampers[int(m.dof_jntid[i])] = np.array([0.0, *higher])
    for i in range(actuators(m)):
        _, *damping = armature_and_damping(m, i)
        if any(damping) and m.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT:
            joint, size = int(m.actuator_trnid[i][0]), gear_of(m, i)[0] ** 2
            dampers[joint] = size * np.array(damping) + dampers.get(joint, np.zeros(len(damping)))
    return {joint: numbers_of(one) for joint, one in dampers.items()}


def _softness(reference: Any, impedance: Any) -> Softness:
    return Softness(reference=as_pair(reference), impedance=numbers_of(impedance))


def default_softness(tree: Any) -> Softness:
    """Return the softness of limits and dry friction that a specification leaves to defaults."""
    joint = tree.default.joint
    return _softness(joint.solref_limit, joint.solimp_limit)


def _limits(m: Any) -> Iterator[SoftLimit]:
    """Yield the ranges of joints and tendons."""
    for j in np.flatnonzero(m.jnt_limited):
        lower, upper = as_pair(m.jnt_range[j])
        yield SoftLimit(
            joint=int(j), lower=lower, upper=upper, margin=float(m.jnt_margin[j]),
            softness=_softness(m.jnt_solref[j], m.jnt_solimp[j]),
        )  # fmt: skip
    for t in np.flatnonzero(m.tendon_limited):
        lower, upper = as_pair(m.tendon_range[t])
        yield SoftLimit(
            path=int(t), lower=lower, upper=upper, margin=float(m.tendon_margin[t]),
            softness=_softness(m.tendon_solref_lim[t], m.tendon_solimp_lim[t]),
        )  # fmt: skip


def _frictions(m: Any) -> Iterator[SoftFriction]:
    """Yield the dry friction of joints and tendons."""
    for j in range(m.njnt):
        d = int(m.jnt_dofadr[j])
        if m.dof_frictionloss[d]:
            softness = _softness(m.dof_solref[d], m.dof_solimp[d])
            yield SoftFriction(joint=j, force=float(m.dof_frictionloss[d]), softness=softness)
    for t in range(m.ntendon):
        if m.tendon_frictionloss[t] > 0:
            softness = _softness(m.tendon_solref_fri[t], m.tendon_solimp_fri[t])
            yield SoftFriction(path=t, force=float(m.tendon_frictionloss[t]), softness=softness)


def _equalities(m: Any) -> Iterator[SoftEquality]:
    """Yield the active equalities of joints, tendons and bodies."""
    import mujoco

    kinds = mujoco.mjtEq
    for i in np.flatnonzero(m.eq_active0):
        kind, data = kinds(m.eq_type[i]), numbers_of(m.eq_data[i])
        first, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        both = (first,) if other < 0 else (first, other)
        softness = _softness(m.eq_solref[i], m.eq_solimp[i])
        if kind == kinds.mjEQ_JOINT:
            starts = tuple(float(m.qpos0[m.jnt_qposadr[k]]) for k in both)
            yield SoftEquality(joints=both, polynomial=data[:5], starts=starts, softness=softness)
        elif kind == kinds.mjEQ_TENDON:
            starts = tuple(float(m.tendon_length0[k]) for k in both)
            yield SoftEquality(paths=both, polynomial=data[:5], starts=starts, softness=softness)
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            weld = kind == kinds.mjEQ_WELD
            yield SoftEquality(
                anchors=_anchors(m, int(i), weld=weld),
                turn_scale=data[10] if weld else None,
                softness=softness,
            )


def _anchors(m: Any, i: int, *, weld: bool) -> tuple[Anchor, Anchor]:
    """Return the two frames of an equality; the numbers of a weld begin with the second one."""
    import mujoco

    first, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
    if m.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        return _site(m, first), _site(m, other)
    data = numbers_of(m.eq_data[i])
    first_origin, origin = (data[3:6], data[:3]) if weld else (data[:3], data[3:6])
    turn = data[6:10] if weld else (1.0, 0.0, 0.0, 0.0)
    return Anchor(body=first, position=first_origin, turn=turn), Anchor(body=other, position=origin)


def _site(m: Any, i: int) -> Anchor:
    return Anchor(
        body=int(m.site_bodyid[i]),
        position=numbers_of(m.site_pos[i]),
        turn=numbers_of(m.site_quat[i]),
    )


def _surface(m: Any, i: int, *, override: bool) -> Surface:
    """Return the surface of a geom; `override` replaces its numbers by those of the options."""
    o = m.opt
    return Surface(
        body=int(m.geom_bodyid[i]),
        dimension=int(m.geom_condim[i]),
        friction=numbers_of(o.o_friction if override else m.geom_friction[i]),
        priority=int(m.geom_priority[i]),
        mix=float(m.geom_solmix[i]),
        masks=(int(m.geom_contype[i]), int(m.geom_conaffinity[i])),
        margin=float(o.o_margin) / 2 if override else float(m.geom_margin[i]),
        softness=_softness(o.o_solref, o.o_solimp)
        if override
        else _softness(m.geom_solref[i], m.geom_solimp[i]),
    )


def _pairs(m: Any, *, override: bool) -> Iterator[tuple[int, int, ContactParameters]]:
    """Yield the pairs of geoms that state their numbers themselves."""
    o = m.opt
    for i in range(m.npair):
        first, other = int(m.pair_geom1[i]), int(m.pair_geom2[i])
        touch = ContactParameters(
            dimension=int(m.pair_dim[i]),
            friction=numbers_of(o.o_friction if override else m.pair_friction[i]),
            margin=float(o.o_margin if override else m.pair_margin[i]),
            softness=_softness(o.o_solref, o.o_solimp)
            if override
            else _softness(m.pair_solref[i], m.pair_solimp[i]),
            sliding=as_pair(m.pair_solreffriction[i]),
        )
        yield first, other, touch


def _touching(m: Any) -> Iterator[tuple[int, int]]:
    """Yield the pairs of geoms that a file lets touch (Computation, Collision, Selection)."""
    body, welds, parents = np.array(m.geom_bodyid), np.array(m.body_weldid), m.body_parentid
    weld, above = welds[body], welds[np.array(parents)[welds]][body]
    first, other = np.triu_indices(m.ngeom, 1)
    kinds, reactions = np.array(m.geom_contype), np.array(m.geom_conaffinity)
    on = (kinds[first] & reactions[other]) | (kinds[other] & reactions[first])
    on = on.astype(bool) & (weld[first] != weld[other])
    if acts(m, "FILTERPARENT"):
        kin = (weld[first] == above[other]) | (weld[other] == above[first])
        on &= ~(kin & (weld[first] > 0) & (weld[other] > 0))
    low, high = np.sort([body[first], body[other]], axis=0)
    on &= ~np.isin((low << 16) + high, np.array(m.exclude_signature))
    yield from zip(first[on].tolist(), other[on].tolist(), strict=True)
    for pair in zip(m.pair_geom1, m.pair_geom2, strict=True):
        low, high = sorted(map(int, pair))
        yield low, high


def _drive(m: Any, i: int, path: int) -> Actuator:
    import mujoco

    index = control(m, i)
    first, count = int(m.actuator_actadr[i]), int(m.actuator_actnum[i])
    dynamics = mujoco.mjtDyn(m.actuator_dyntype[i]).name.removeprefix("mjDYN_")
    gain = mujoco.mjtGain(m.actuator_gaintype[i]).name.removeprefix("mjGAIN_")
    bias = mujoco.mjtBias(m.actuator_biastype[i]).name.removeprefix("mjBIAS_")
    clamped = m.actuator_ctrllimited[index] and acts(m, "CLAMPCTRL")
    return Actuator(
        path=path,
        control=index,
        state=first + count - 1 if first >= 0 else -1,
        control_range=as_pair(m.actuator_ctrlrange[index]) if clamped else None,
        state_range=as_pair(m.actuator_actrange[i]) if m.actuator_actlimited[i] else None,
        force_range=as_pair(m.actuator_forcerange[i]) if m.actuator_forcelimited[i] else None,
        dynamics=_DYNAMICS.get(dynamics, "none"),
        constants=numbers_of(m.actuator_dynprm[i])[:3],
        gain=_CURVES.get(gain, "none"),
        gains=numbers_of(m.actuator_gainprm[i])[:9],
        bias=_CURVES.get(bias, "none"),
        biases=numbers_of(m.actuator_biasprm[i])[:9],
        early=bool(m.actuator_actearly[i]),
        stretch=as_pair(m.actuator_lengthrange[output(m, i)]),
        period=_period(m, i),
        on=not is_off(m, i) and acts(m, "ACTUATION"),
    )


def _period(m: Any, i: int) -> float:
    """Return the period of a servo's setpoint on a ball joint or between frames, or 0."""
    import mujoco

    kinds = mujoco.mjtTrn
    fixed = m.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
    affine = m.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
    matches = m.actuator_gainprm[i][0] == -m.actuator_biasprm[i][1]
    still = m.actuator_dyntype[i] in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_INTEGRATOR)
    if not (fixed and affine and matches and still):
        return 0.0
    gear, kind = np.array(gear_of(m, i)), kinds(m.actuator_trntype[i])
    target, other = map(int, m.actuator_trnid[i])
    if kind == kinds.mjTRN_SITE and other >= 0 and not gear[:3].any():
        return float(2 * np.pi * np.linalg.norm(gear[3:]))
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT) and m.jnt_type[target] == BALL:
        return float(2 * np.pi * np.linalg.norm(gear[:3]))
    return 0.0


def _driven_tendon(m: Any, i: int) -> int:
    """Return the tendon that an actuator acts on, or -1."""
    import mujoco

    on_tendon = m.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON
    return int(m.actuator_trnid[i][0]) if on_tendon else -1


def _uncovered(m: Any) -> Iterator[str]:
    """Yield what acts on the bodies and has no law here."""
    yield from smooth_omissions(m)
    drives = range(actuators(m))
    if any(_unusual(m, i) for i in drives):
        yield "actuators of other laws or transmissions"
    wrapped = [t for t in range(m.ntendon) if of_tendon(m, t) is None]
    if any(m.tendon_limited[t] or m.tendon_frictionloss[t] for t in wrapped) or (wrapped and m.neq):
        yield "limits, friction or equalities of tendons around shapes"
    if getattr(m, "flg_adhesion", False) or getattr(m, "flg_surfacevel", False):
        yield "adhesion or surface velocity"
    kinds = {int(kind) for kind in np.array(m.eq_type)[np.flatnonzero(m.eq_active0)]}
    if kinds - set(range(4)):  # connect, weld, joint, tendon
        yield "equalities of flexible bodies"


def _unusual(m: Any, i: int) -> bool:
    """Return whether an actuator has no law here."""
    import mujoco

    names = (
        mujoco.mjtDyn(m.actuator_dyntype[i]).name.removeprefix("mjDYN_") in _DYNAMICS,
        mujoco.mjtGain(m.actuator_gaintype[i]).name.removeprefix("mjGAIN_") in _CURVES,
        mujoco.mjtBias(m.actuator_biastype[i]).name.removeprefix("mjBIAS_") in _CURVES,
        of_actuator(m, i, gear_of(m, i)) is not None,
        not (hasattr(m, "actuator_delay") and m.actuator_delay[i]),
        not (hasattr(m, "actuator_ctrlnum") and m.actuator_ctrlnum[i] != 1),
        not m.actuator_plugin[i] >= 0,
        m.actuator_actnum[i] <= 1,
    )
    return not all(names)
