"""Actuators of a compiled model, each with all its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledActuator, Numbers
from physics_crosscheck.harness.engines.mujoco.pulls import (
    control,
    covered_actuator,
    joint_name,
    output,
    powers,
)


def compiled_actuator(m: Any, i: int) -> CompiledActuator:
    """Return the actuator with index `i`."""
    import mujoco

    kinds = (
        ("transmission", mujoco.mjtTrn(m.actuator_trntype[i])),
        ("gain", mujoco.mjtGain(m.actuator_gaintype[i])),
        ("bias", mujoco.mjtBias(m.actuator_biastype[i])),
        ("dynamics", mujoco.mjtDyn(m.actuator_dyntype[i])),
    )
    first, count = int(m.actuator_actadr[i]), int(m.actuator_actnum[i])
    return CompiledActuator(
        name=m.actuator(i).name,
        on=_target(m, i),
        kind=tuple(f"{what} {kind.name.partition('_')[2].lower()}" for what, kind in kinds),
        numbers=tuple(_numbers(m, i)),
        ranges=tuple(_ranges(m, i)),
        covered=covered_actuator(m, i),
        control=control(m, i),
        states=tuple(range(first, first + count)) if first >= 0 else (),
    )


def _target(m: Any, i: int) -> str:
    """Return the name of the element that it acts on; empty for other transmissions."""
    import mujoco

    kind, target = mujoco.mjtTrn(m.actuator_trntype[i]), int(m.actuator_trnid[i][0])
    if target < 0:
        return ""
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return joint_name(m, target)
    named = {
        mujoco.mjtTrn.mjTRN_TENDON: m.tendon,
        mujoco.mjtTrn.mjTRN_SITE: m.site,
        mujoco.mjtTrn.mjTRN_SLIDERCRANK: m.site,
        mujoco.mjtTrn.mjTRN_BODY: m.body,
    }
    return str(named[kind](target).name) if kind in named else ""


def _numbers(m: Any, i: int) -> Iterator[tuple[str, Numbers]]:
    """Yield the numbers that its force depends on while its control is held."""
    yield "gear", _row(m.actuator_gear[output(m, i)])
    yield "gain and bias", (*_row(m.actuator_gainprm[i]), *_row(m.actuator_biasprm[i]))
    yield "dynamics", _row(m.actuator_dynprm[i])
    yield "length of the crank", _row(m.actuator_cranklength[i])
    if hasattr(m, "actuator_armature"):
        yield "armature", _row(m.actuator_armature[i])
        yield "damping", powers(m, "actuator_damping", i)


def _ranges(m: Any, i: int) -> Iterator[tuple[str, Numbers]]:
    """Yield its saturation ranges, and features that act as its control changes."""
    index = control(m, i)
    for what, limited, bounds in (
        ("control", m.actuator_ctrllimited[index], m.actuator_ctrlrange[index]),
        ("state", m.actuator_actlimited[i], m.actuator_actrange[i]),
        ("force", m.actuator_forcelimited[i], m.actuator_forcerange[i]),
    ):
        if limited:
            yield f"{what} range", _row(bounds)
    if hasattr(m, "actuator_delay") and m.actuator_delay[i]:
        yield "delay", _row(m.actuator_delay[i])
    if m.actuator_actearly[i]:
        yield "early state", (1.0,)


def _row(values: Any) -> Numbers:
    return tuple(float(value) for value in np.ravel(values))
