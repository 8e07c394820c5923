"""What MuJoCo adds to a model, or drops from it, on its own: read in the compiled model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harness.engines.mujoco.mjcf import doubled_remarks, override_remarks, stated
from harness.engines.protocol import Array, ModelSpec
from harness.engines.remark import PULL, Remark, limit_remarks
from harness.engines.source import XmlSource
from harness.engines.urdf import UrdfReader, urdf_remarks

_URDF = UrdfReader(name="mujoco", no_inertial="its geoms' masses, or none")


def model_remarks(
    m: Any, spec: ModelSpec, found: Sequence[XmlSource], z: Array, w: Array
) -> Iterator[Remark]:
    """All there is to say of a compiled model along the states (z, w), (K, nz) each.

    `z` are (K, nq), as in qpos; `found`: its files, as far as they are XML.
    """
    import mujoco

    urdf = spec.path.suffix == ".urdf"
    if urdf:
        names = [m.joint(i).name for i in range(m.njnt)]
        yield from urdf_remarks(_URDF, spec.path, names, z, w)
    for i in range(m.njnt):
        if int(m.jnt_type[i]) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            yield from _joint(m, i, "robot" if urdf else "body", z[:, m.jnt_qposadr[i]])
    yield from _options(m, spec, found)
    yield from override_remarks(found, spec)
    yield from doubled_remarks(found)
    yield from _equalities(m, urdf)
    if not urdf:  # there they are the sidecar's, with a rest of their own
        yield from _tendons(m, spec.path)
    yield from _contacts(m, z)


def _joint(m: Any, i: int, parent: str, z: Array) -> Iterator[Remark]:
    name = m.joint(i).name
    address = f"{parent}/joint[{name}]"
    dof = int(m.jnt_dofadr[i])
    if m.dof_armature[dof]:
        value = float(m.dof_armature[dof])
        yield Remark(
            message=f"armature of {name} adds an inertia of {value:g}",
            subject=(name, "armature"),
            address=f"{address}@armature",
            value=value,
            shows_in=("inertia",),
        )
    if m.dof_frictionloss[dof]:
        value = float(m.dof_frictionloss[dof])
        yield Remark(
            message=f"frictionloss of {name} holds it with {value:g}; friction is not smooth",
            subject=(name, "frictionloss"),
            fault=True,
            address=f"{address}@frictionloss",
            value=value,
        )
    lower, upper = map(float, m.jnt_range[i])
    if parent == "body" and not m.jnt_limited[i] and lower > upper:
        yield Remark(
            message=f"the range [{lower:g}, {upper:g}] of {name} holds nothing: the lower is above"
            " the upper",
            address=f"{address}@range",
        )
    if m.jnt_limited[i] and parent == "body":
        yield from limit_remarks(
            name,
            bounds=(lower, upper),
            reached=(float(z.min()), float(z.max())),
            address=f"{address}@range",
        )
    if np.any(m.jnt_stiffness[i]) and m.qpos_spring[m.jnt_qposadr[i]] != 0:
        rest = float(m.qpos_spring[m.jnt_qposadr[i]])
        yield Remark(
            message=f"the spring of {name} rests at {rest:g} (springref)",
            subject=(name, "springref"),
            address=f"{address}@springref",
            value=rest,
            shows_in=PULL,
        )
    if m.qpos0[m.jnt_qposadr[i]]:
        value = float(m.qpos0[m.jnt_qposadr[i]])
        yield Remark(
            message=f"{name} is {value:g} where the file draws it (ref)",
            subject=(name, "ref"),
            address=f"{address}@ref",
            value=value,
            shows_in=PULL,
        )


def _options(m: Any, spec: ModelSpec, found: Sequence[XmlSource]) -> Iterator[Remark]:
    gravity = [float(g) for g in m.opt.gravity]
    shown = ", ".join(f"{g:g}" for g in gravity)
    if sum(g != 0 for g in gravity) > 1:
        yield Remark(
            message=f"gravity is tilted: ({shown}) is along no axis",
            address=f"{'sidecar:settings.' if 'gravity' in spec.settings else 'option@'}gravity",
            shows_in=PULL,
        )
    # What only MuJoCo can read may well state it.
    if "gravity" not in spec.settings and found and not any(stated(found, "gravity")):
        yield Remark(
            message=f"no gravity is stated: MuJoCo takes ({shown})", address="", shows_in=PULL
        )
    acting = [key for key in ("wind", "density", "viscosity") if np.any(getattr(m.opt, key))]
    if acting:
        yield Remark(
            message="a medium (wind, density or viscosity) acts on the bodies",
            fault=True,
            address=f"option@{acting[0]}",
        )


def _equalities(m: Any, urdf: bool) -> Iterator[Remark]:
    import mujoco

    plain = mujoco.MjSpec().default.equality
    for i in range(m.neq):
        name = m.equality(i).name or f"number {i + 1}"
        tag = mujoco.mjtEq(m.eq_type[i]).name.removeprefix("mjEQ_").lower()
        address = f"{'robot' if urdf else 'equality'}/{tag}[{name}]"
        if not m.eq_active0[i]:
            yield Remark(
                message=f"equality {name} is not active", address=address, shows_in=("inertia",)
            )
        elif np.array_equal(m.eq_solref[i], plain.solref):
            yield Remark(
                message=f"equality {name} is soft: solref is MuJoCo's default, 0.02 s, and wrong at"
                " any step",
                fault=True,
                address=address,
                value=float(m.eq_solref[i][0]),
            )
        elif np.array_equal(m.eq_solimp[i], plain.solimp):
            yield Remark(
                message=f"equality {name} is soft: solimp is MuJoCo's default",
                address=address,
                shows_in=("inertia",),
            )


def _tendons(m: Any, file: Path) -> Iterator[Remark]:
    import mujoco

    for i, tendon in enumerate(mujoco.MjSpec.from_file(str(file)).tendons):
        fixed = m.wrap_type[m.tendon_adr[i]] == mujoco.mjtWrap.mjWRAP_JOINT
        address = f"tendon/{'fixed' if fixed else 'spatial'}[{tendon.name}]"
        if np.any(m.tendon_stiffness[i]) and np.all(np.asarray(tendon.springlength) == -1):
            value = float(m.tendon_lengthspring[i][0])
            yield Remark(
                message=f"tendon {tendon.name or i + 1} states no springlength: its spring rests at"
                f" {value:g}, its length where the joints are at their springref",
                subject=(str(tendon.name or i + 1), "springlength"),
                address=address,
                value=value,
                shows_in=PULL,
            )
        if m.tendon_limited[i] or m.tendon_frictionloss[i]:
            yield Remark(
                message=f"tendon {tendon.name or i + 1} has a limit or friction",
                fault=True,
                address=address,
            )


def _contacts(m: Any, z: Array) -> Iterator[Remark]:
    import mujoco

    if not (m.geom_contype.any() and m.geom_conaffinity.any()) and not m.npair:
        return
    if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        return
    data = mujoco.MjData(m)
    touching: set[tuple[int, int]] = set()
    for place in z:
        data.qpos[:] = place
        mujoco.mj_kinematics(m, data)
        mujoco.mj_comPos(m, data)
        mujoco.mj_collision(m, data)
        touching |= {(int(c.geom[0]), int(c.geom[1])) for c in data.contact}
    for one, other in sorted(touching):
        names = [m.geom(g).name or f"of body {m.body(m.geom_bodyid[g]).name}" for g in (one, other)]
        yield Remark(
            message=f"geoms {names[0]} and {names[1]} touch along the motions",
            fault=True,
            address="",
        )
    if not touching:
        able = int(np.sum((m.geom_contype > 0) | (m.geom_conaffinity > 0)))
        yield Remark(
            message=f"{able} geoms can collide (contype, conaffinity); at the motions' states none"
            " does",
            address="",
            beyond=True,
        )
