"""An MJCF as MuJoCo compiles it, taken apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from harness.engines.compiled import CompiledBody, CompiledJoint, CompiledTree, Numbers
from harness.engines.mujoco.mjcf import refusal, sources
from harness.engines.mujoco.smooth import besides, uncovered
from harness.engines.mujoco.warnings import Warnings


def compiled_tree(path: Path) -> CompiledTree:
    """Compile a file and read its bodies and joints.

    Raises:
        EngineError: naming file and reason.
    """
    import mujoco

    found = sources(path)
    try:
        with Warnings().heard():
            tree: Any = mujoco.MjSpec.from_file(str(path))
            m: Any = tree.compile()
    except Exception as error:
        raise refusal(error, path, found) from None
    x, y, z = map(float, m.opt.gravity)
    return CompiledTree(
        bodies=tuple(_body(m, i) for i in range(1, m.nbody)),
        gravity=(x, y, z),
        medium=bool(m.opt.wind.any() or m.opt.density or m.opt.viscosity),
        name=tree.modelname,
        besides=besides(m),
        uncovered=uncovered(m),
    )


def _body(m: Any, i: int) -> CompiledBody:
    first, count = int(m.body_jntadr[i]), int(m.body_jntnum[i])
    return CompiledBody(
        name=m.body(i).name,
        parent=int(m.body_parentid[i]),
        at=_numbers(m.body_pos[i]),
        turn=_numbers(m.body_quat[i]),
        mass=float(m.body_mass[i]),
        centre=_numbers(m.body_ipos[i]),
        principal=_numbers(m.body_iquat[i]),
        moments=_numbers(m.body_inertia[i]),
        joints=tuple(_joint(m, j) for j in range(first, first + count)),
        ordinary=not (m.body_mocapid[i] >= 0 or m.body_gravcomp[i]),
    )


def _joint(m: Any, j: int) -> CompiledJoint:
    import mujoco

    q, d = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
    return CompiledJoint(
        name=m.joint(j).name,
        kind=mujoco.mjtJoint(m.jnt_type[j]).name.removeprefix("mjJNT_").lower(),
        at=_numbers(m.jnt_pos[j]),
        axis=_numbers(m.jnt_axis[j]),
        zero=float(m.qpos0[q]),
        rest=float(m.qpos_spring[q]),
        stiffness=_powers(m, "jnt_stiffness", j),
        damping=_powers(m, "dof_damping", d),
        armature=float(m.dof_armature[d]),
        friction=float(m.dof_frictionloss[d]),
        limits=(float(m.jnt_range[j][0]), float(m.jnt_range[j][1])) if m.jnt_limited[j] else None,
    )


def _powers(m: Any, name: str, index: int) -> Numbers:
    """A stiffness or damping; MuJoCo 4 has polynomials."""
    higher = getattr(m, f"{name}poly")[index] if hasattr(m, f"{name}poly") else ()
    return (*_numbers(getattr(m, name)[index]), *_numbers(higher))


def _numbers(values: Any) -> Numbers:
    return tuple(float(value) for value in np.ravel(values))
