"""What MuJoCo has beyond smooth dynamics: switched off where that is asked, and counted."""

from __future__ import annotations

from typing import Any

import numpy as np


def switch_off(tree: Any, *, smooth: bool, coupled: bool) -> None:
    """Leave out of a specification what a sidecar's `smooth` and `couplings` say."""
    import mujoco

    names = ("CONTACT", "LIMIT", "FRICTIONLOSS", "ACTUATION") if smooth else ()
    for name in (*names, *(() if coupled else ("EQUALITY",))):
        tree.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    if smooth:
        tree.option.density = tree.option.viscosity = 0.0
        tree.option.wind = [0.0, 0.0, 0.0]
        for body in tree.bodies:
            body.gravcomp = 0.0


def besides(m: Any) -> tuple[tuple[str, int], ...]:
    """What of a compiled model these settings leave out, with its number."""
    touching = (np.array(m.geom_contype) | np.array(m.geom_conaffinity)) != 0
    counts = {
        "actuators": m.nu,
        "equality constraints": m.neq,
        "limits of position": np.count_nonzero(m.jnt_limited) + np.count_nonzero(m.tendon_limited),
        "dry friction": np.count_nonzero(m.dof_frictionloss)
        + np.count_nonzero(m.tendon_frictionloss),
        "contact geometry": np.count_nonzero(touching),
        "gravity compensation": np.count_nonzero(m.body_gravcomp),
        "a medium": int(bool(m.opt.wind.any() or m.opt.density or m.opt.viscosity)),
    }
    return tuple((what, int(count)) for what, count in counts.items() if count)


def uncovered(m: Any) -> tuple[str, ...]:
    """What acts whatever these settings say, and is in no tree of bodies."""
    found = {
        "tendons that pull": _any(m, "tendon_stiffness", "tendon_damping", "tendon_armature")
        or _any(m, "tendon_stiffnesspoly", "tendon_dampingpoly"),
        "springs and dampers that are no straight line": _any(
            m, "jnt_stiffnesspoly", "dof_dampingpoly"
        ),
        "flexible bodies": bool(getattr(m, "nflex", 0)),
        "plugins": bool(m.nplugin),
    }
    return tuple(what for what, there in found.items() if there)


def _any(m: Any, *names: str) -> bool:
    return any(bool(np.any(getattr(m, name))) for name in names if hasattr(m, name))
