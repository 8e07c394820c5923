"""Lengths that tendons and actuators of a compiled model act along: joints, points, frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledFrame, CompiledLength, Numbers

Combination = tuple[tuple[int, float], ...]
"""Coefficients by the index of a hinge or slide."""


def of_tendon(m: Any, i: int, gear: float = 1.0) -> Combination | CompiledLength | None:
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
    branches: list[tuple[float, list[CompiledFrame]]] = [(gear, [])]
    for k in rows:
        if m.wrap_type[k] == mujoco.mjtWrap.mjWRAP_PULLEY:
            branches.append((gear / float(m.wrap_prm[k]), []))
        else:
            branches[-1][1].append(mark(m, int(m.wrap_objid[k])))
    return CompiledLength(
        branches=tuple((share, tuple(row)) for share, row in branches if len(row) > 1)
    )


def of_actuator(m: Any, i: int, gear: Numbers) -> Combination | CompiledLength | None:
    """Return the same for an actuator; None for slider-cranks, bodies and later transmissions."""
    import mujoco

    kind = mujoco.mjtTrn(m.actuator_trntype[i])
    target, other = map(int, m.actuator_trnid[i])
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        return of_tendon(m, target, gear[0])
    if kind == mujoco.mjtTrn.mjTRN_SITE:
        against = mark(m, other) if other >= 0 else None
        return CompiledLength(frame=mark(m, target), against=against, gear=gear)
    inside = kind == mujoco.mjtTrn.mjTRN_JOINTINPARENT
    if not inside and kind != mujoco.mjtTrn.mjTRN_JOINT:
        return None
    joint = mujoco.mjtJoint(m.jnt_type[target])
    if joint in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        return ((target, gear[0]),)
    size = 3 if joint == mujoco.mjtJoint.mjJNT_BALL else 6
    return CompiledLength(joint=target, gear=gear[:size], in_parent=inside)


def mark(m: Any, site: int) -> CompiledFrame:
    """Return a site."""
    return CompiledFrame(
        body=int(m.site_bodyid[site]),
        position=tuple(map(float, np.ravel(m.site_pos[site]))),
        turn=tuple(map(float, np.ravel(m.site_quat[site]))),
    )
