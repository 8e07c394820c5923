"""Changes that MuJoCo makes to a model, read from the compiled model."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.urdf import UrdfFile
from ..protocol import Array, ModelSpec
from ..remark import POSITION_FORCE_TERMS, Remark, limit_remarks
from ..urdf import UrdfReader, urdf_remarks
from .mjcf import doubled_remarks, load_error, override_remarks, stated
from .pulls import UNCOUPLED, acts, actuators, joint_name, split_tendons
from .shapes import without_idle_files
from .smooth import Warnings

_URDF = UrdfReader(name="mujoco", no_inertial="its geoms' masses, or none")


def model_remarks(
    m: Any,
    spec: ModelSpec,
    file: UrdfFile | None,
    xml_sources: Sequence[Document],
    z: Array,
    w: Array,
) -> Iterator[Remark]:
    """Yield all remarks about a compiled model along the states (z, w), (K, nz) each.

    `z` are (K, nq), as in qpos; `file` is the content of a URDF; `xml_sources` are its files that
    are XML.
    """
    import mujoco

    urdf = file is not None
    if file is not None:
        names = [m.joint(i).name for i in range(m.njnt)]
        yield from urdf_remarks(_URDF, file, names, z, w)
    for i in range(m.njnt):
        if int(m.jnt_type[i]) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            yield from _joint(m, i, "robot" if urdf else "body", z[:, m.jnt_qposadr[i]])
    yield from _options(m, spec, xml_sources)
    yield from override_remarks(xml_sources, spec)
    yield from doubled_remarks(xml_sources)
    yield from _equalities(m, urdf)
    if not urdf:  # a URDF's tendons are the sidecar's springs, with their own rest lengths
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
            kind="dry friction",
            message=f"frictionloss of {name} is {value:g}; dry friction is not smooth",
            subject=(name, "frictionloss"),
            fault=True,
            address=f"{address}@frictionloss",
            value=value,
        )
    lower, upper = map(float, m.jnt_range[i])
    if parent == "body" and not m.jnt_limited[i] and lower > upper:
        yield Remark(
            kind="empty limit",
            message=(
                f"the range [{lower:g}, {upper:g}] of {name} has no effect: the lower "
                "limit is above the upper"
            ),
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
            shows_in=POSITION_FORCE_TERMS,
        )
    if m.qpos0[m.jnt_qposadr[i]]:
        value = float(m.qpos0[m.jnt_qposadr[i]])
        yield Remark(
            message=f"{name} is {value:g} in the file's drawn pose (ref)",
            subject=(name, "ref"),
            address=f"{address}@ref",
            value=value,
            shows_in=POSITION_FORCE_TERMS,
        )


def _options(m: Any, spec: ModelSpec, xml_sources: Sequence[Document]) -> Iterator[Remark]:
    gravity = [float(g) for g in m.opt.gravity]
    shown = ", ".join(f"{g:g}" for g in gravity)
    if sum(g != 0 for g in gravity) > 1:
        yield Remark(
            message=f"gravity is tilted: ({shown}) is not along an axis",
            address=f"{'sidecar:settings.' if 'gravity' in spec.settings else 'option@'}gravity",
            shows_in=POSITION_FORCE_TERMS,
        )
    # Files that only MuJoCo can read may state it.
    if "gravity" not in spec.settings and xml_sources and not any(stated(xml_sources, "gravity")):
        yield Remark(
            message=f"the file sets no gravity: MuJoCo uses ({shown})",
            address="",
            shows_in=POSITION_FORCE_TERMS,
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
                kind="constraint",
                message=f"equality {name} is not active",
                address=address,
                shows_in=("inertia",),
            )
        elif np.array_equal(m.eq_solref[i], plain.solref):
            yield Remark(
                kind="constraint",
                message=(
                    f"equality {name} is soft: solref is MuJoCo's default, 0.02 s, and "
                    "adds an error at every time step"
                ),
                fault=True,
                address=address,
                value=float(m.eq_solref[i][0]),
            )
        elif np.array_equal(m.eq_solimp[i], plain.solimp):
            yield Remark(
                kind="constraint",
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
                message=(
                    f"tendon {tendon.name or i + 1} sets no springlength: its spring "
                    f"rests at {value:g}, its length with the joints at springref"
                ),
                subject=(str(tendon.name or i + 1), "springlength"),
                address=address,
                value=value,
                shows_in=POSITION_FORCE_TERMS,
            )
        if m.tendon_limited[i] or m.tendon_frictionloss[i]:
            yield Remark(
                kind="dry friction",
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
    for first, second in sorted(touching):
        names = [
            m.geom(g).name or f"of body {m.body(m.geom_bodyid[g]).name}" for g in (first, second)
        ]
        yield Remark(
            kind="contact",
            message=f"geoms {names[0]} and {names[1]} touch during the motions",
            fault=True,
            address="",
        )
    if not touching:
        able = int(np.sum((m.geom_contype > 0) | (m.geom_conaffinity > 0)))
        yield Remark(
            message=(
                f"{able} geoms can collide (contype, conaffinity), but none does during the motions"
            ),
            address="",
            kind="reach",
        )


UNCOMPENSATED = "actuatorgravcomp without an actuator compensates no gravity"
"""The cause that a diagnosis reports."""

LISTED = 3
"""The most bodies that a remark names; it counts the others."""

_OFF: Mapping[str, object] = {
    "settotalmass": -1.0, "boundmass": 0.0, "boundinertia": 0.0, "balanceinertia": False,
}  # fmt: skip
"""Attributes that replace masses and inertias, and the values that disable them."""


def file_remarks(copy: Path, path: Path) -> Iterator[Remark]:
    """Yield remarks about numbers that MuJoCo's compiler changes.

    Args:
        copy: the file that MuJoCo reads.
        path: the original file.

    Raises:
        EngineError: naming file and reason.
    """
    address = "compiler" if path.suffix == ".xml" else "mujoco/compiler"
    tree, m = _read(copy, path, ())
    stated_here = [key for key, off in _OFF.items() if getattr(tree.compiler, key) != off]
    for key in stated_here:
        for what in _replaced(key, (tree, m), copy, path):
            yield Remark(
                kind="replaced",
                message=f"<compiler {key}> replaces {what}",
                fault=path.suffix == ".urdf",  # other engines read a URDF without it
                address=f"{address}@{key}",
                shows_in=("inertia",),
            )
    yield from _idle_compensation(m)
    for i, pair in split_tendons(m):
        name = m.tendon(i).name
        yield Remark(
            kind="ignored",
            message=f"tendon {name or i + 1} has an armature across branches: MuJoCo leaves out its"
            f" coupling between {' and '.join(pair)}",
            fault=True,
            address=f"tendon/fixed{f'[{name}]' if name else ''}@armature",
            cause=UNCOUPLED,
            value=float(m.tendon_armature[i]),
            shows_in=("inertia",),
        )


def _read(copy: Path, path: Path, off: Sequence[str]) -> tuple[Any, Any]:
    """Read a specification and its model, with some attributes of the compiler disabled.

    Raises:
        EngineError: naming file and reason.
    """
    import mujoco

    try:
        with Warnings().collecting():
            tree = mujoco.MjSpec.from_file(str(copy))
            without_idle_files(tree)
            for key in off:
                setattr(tree.compiler, key, _OFF[key])
            return tree, tree.compile()
    except Exception as error:
        raise load_error(error, path, ()) from None


def _replaced(key: str, compiled: tuple[Any, Any], copy: Path, path: Path) -> Iterator[str]:
    """Yield values that a compiler attribute replaces: the file's, and MuJoCo's."""
    tree, m = compiled
    if key == "balanceinertia":
        _, unscaled = _read(copy, path, ("settotalmass",))
        yield from _listed("inertia", list(_balanced(tree, unscaled)))
        return
    _, original = _read(copy, path, (key,))
    if key == "settotalmass":
        before, after = float(np.sum(original.body_mass)), float(np.sum(m.body_mass))
        if before != after:
            yield f"the total mass: {before:g} kg in the file, {after:g} kg in MuJoCo"
        return
    _, scaled = _read(copy, path, ("settotalmass",))  # settotalmass also scales each mass
    _, original = _read(copy, path, (key, "settotalmass"))
    mass = key == "boundmass"
    before, after = (x.body_mass if mass else x.body_inertia for x in (original, scaled))
    changed = [
        (_name(m, i), _numbers(before[i]), _numbers(after[i]))
        for i in range(1, m.nbody)
        if np.any(before[i] != after[i])
    ]
    yield from _listed("mass" if mass else "inertia", changed)


_Change = tuple[str, str, str]
"""A body, the file's value and MuJoCo's."""


def _balanced(tree: Any, m: Any) -> Iterator[_Change]:
    """Yield bodies whose moments violated the triangle inequality and were set to their mean."""
    for i, body in enumerate(tree.bodies):
        full = np.array(body.fullinertia)
        moments = np.array(body.inertia)
        if np.isfinite(full[0]):
            xx, yy, zz, xy, xz, yz = full
            moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        smallest, middle, largest = np.sort(moments)
        if body.explicitinertial and smallest + middle < largest:
            yield _name(m, i), _numbers(moments), _numbers(m.body_inertia[i])


def _listed(what: str, changes: list[_Change]) -> Iterator[str]:
    """Yield the changes as a phrase that names the first bodies."""
    if not changes:
        return
    shown = "; ".join(
        f"{body}: {before} in the file, {after} in MuJoCo"
        for body, before, after in changes[:LISTED]
    )
    more = len(changes) - LISTED
    count = f"{len(changes)} {'body' if len(changes) == 1 else 'bodies'}"
    yield f"the {what} of {count} ({shown}{f'; and {more} more' if more > 0 else ''})"


def _name(m: Any, i: int) -> str:
    return str(m.body(i).name) or f"body_{i}"


def _numbers(values: Any) -> str:
    return " ".join(f"{value:g}" for value in np.ravel(values))


def idle_compensation(m: Any) -> list[int]:
    """Return joints whose gravity compensation acts through actuators, in a file in which no
    actuator acts.
    """
    if (actuators(m) and acts(m, "ACTUATION")) or not np.any(m.body_gravcomp):
        return []
    return [int(joint) for joint in np.flatnonzero(m.jnt_actgravcomp)]


def _idle_compensation(m: Any) -> Iterator[Remark]:
    for joint in idle_compensation(m):
        name = m.joint(joint).name
        yield Remark(
            kind="ignored",
            message=f"actuatorgravcomp of {joint_name(m, joint)} compensates nothing: MuJoCo"
            " applies it with the forces of actuators, and no actuator acts",
            fault=True,
            address=f"body/joint{f'[{name}]' if name else ''}@actuatorgravcomp",
            cause=UNCOMPENSATED,
            shows_in=POSITION_FORCE_TERMS,
        )
