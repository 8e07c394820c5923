"""What engines and formats add to a model, or drop from it, on their own: read, not run.

A third party's model may say so by a method `remarks(z, w) -> Iterable[Remark]`; it is optional.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from harness.engines.protocol import Array, Model
from harness.engines.urdf import read_urdf
from harness.files.sidecar import Sidecar


@dataclass(frozen=True)
class Remark:
    """Something an engine or a format does on its own.

    Attributes:
        fault: whether it is wrong in itself.
        shows_in: kinds of compiled terms that it enters; where one of these differs from the
            equations it is to blame, otherwise it is as it should be.
    """

    message: str
    fault: bool
    where: str = ""
    value: float | None = None
    shows_in: tuple[str, ...] = ()


_PULL = ("rest", "stiffness")


class _Asked(Protocol):
    """What is audited: the sidecar and the engine's name."""

    @property
    def sidecar(self) -> Sidecar: ...
    @property
    def engine(self) -> str: ...


def remarks(task: _Asked, model: Model, z: Array, w: Array) -> Iterator[Remark]:
    """What the engine adds or drops, given the engine states (z, w) that the motions pass."""
    own = getattr(model, "remarks", None)
    if own is not None:
        yield from own(z, w)
        return
    file = task.sidecar.model
    ranges = {
        name: (float(z[:, i].min()), float(z[:, i].max()), float(np.abs(w[:, i]).max()))
        for i, name in enumerate(model.coordinates)
    }
    if file.suffix == ".urdf" and task.engine in ("mujoco", "pybullet"):
        yield from _urdf(file, task.engine, ranges)
    if task.engine == "mujoco":
        yield from _mujoco(model, task.sidecar, z)
    elif task.engine == "pybullet":
        yield Remark(
            "PyBullet's own link damping (0.04), joint motors, speed limit, inertia from collision"
            " shapes and gravity are switched off by the adapter",
            False,
        )
    elif task.engine == "pymunk":
        yield from _pymunk(model, file)


def _line(file: Path, pattern: str) -> str:
    """file:line of the first match, or the file alone."""
    text = file.read_text(encoding="utf-8", errors="replace")
    found = re.search(pattern, text)
    return f"{file}:{text.count(chr(10), 0, found.start()) + 1}" if found else str(file)


def _named(file: Path, tag: str, name: str) -> str:
    return _line(file, rf"<{tag}\b[^>]*\b(name|reference)\s*=\s*[\"']{re.escape(name)}[\"']")


def _urdf(
    file: Path, engine: str, ranges: dict[str, tuple[float, float, float]]
) -> Iterator[Remark]:
    robot = read_urdf(file.read_text(encoding="utf-8"), file)
    moved = {
        child.get("link")
        for joint in robot.findall("joint")
        if joint.get("type") != "fixed" and (child := joint.find("child")) is not None
    }
    for link in robot.findall("link"):
        name = link.get("name", "")
        if name in moved and link.find("inertial") is None:
            takes = "a mass of 1 kg" if engine == "pybullet" else "its geoms' masses, or none"
            yield Remark(
                f"link {name} moves and has no <inertial>: {engine} takes {takes}",
                True,
                _named(file, "link", name),
            )
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        if name not in ranges:
            continue
        where = _named(file, "joint", name)
        low, high, quick = ranges[name]
        limit = joint.find("limit")
        if limit is not None and joint.get("type") in ("revolute", "prismatic"):
            # Without bounds neither engine holds it: PyBullet takes (0, -1), MuJoCo (0, 0).
            lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
            stated = "lower" in limit.attrib and "upper" in limit.attrib
            if stated and (lower < upper or (engine == "pybullet" and lower == upper)):
                yield from _limit(name, lower, upper, low, high, where)
            velocity = float(limit.get("velocity", "inf"))
            if quick >= velocity:
                yield Remark(
                    f"<limit velocity> of {name} is {velocity:g} and the motions reach {quick:.4g};"
                    f" {engine} does not hold it to that here",
                    False,
                    where,
                    velocity,
                )
        dynamics = joint.find("dynamics")
        friction = float(dynamics.get("friction", "0")) if dynamics is not None else 0.0
        if friction and engine == "pybullet":
            yield Remark(
                f"<dynamics friction> of {name} is {friction:g}; PyBullet ignores it",
                True,
                where,
                friction,
            )


def _limit(
    name: str, lower: float, upper: float, low: float, high: float, where: str
) -> Iterator[Remark]:
    for bound, reached, beyond in ((lower, low, low <= lower), (upper, high, high >= upper)):
        if beyond:
            yield Remark(
                f"{name} is limited to [{lower:g}, {upper:g}], and the motions reach"
                f" {reached:.4g}: the limit stops it",
                True,
                where,
                bound,
            )


def _mujoco(model: Any, sidecar: Sidecar, z: Array) -> Iterator[Remark]:
    compiled, file = model.model, sidecar.model
    yield from _mujoco_joints(compiled, file, z)
    yield from _mujoco_options(compiled, sidecar)
    yield from _mujoco_equalities(compiled, sidecar)
    yield from _mujoco_tendons(compiled, file)
    yield from _mujoco_contacts(compiled, file, z)


def _mujoco_joints(m: Any, file: Path, z: Array) -> Iterator[Remark]:
    for i in range(m.njnt):
        name = m.joint(i).name
        where = _named(file, "joint", name)
        if m.dof_armature[i]:
            value = float(m.dof_armature[i])
            yield Remark(
                f"armature of {name} adds an inertia of {value:g}",
                False,
                where,
                value,
                ("inertia",),
            )
        if m.dof_frictionloss[i]:
            value = float(m.dof_frictionloss[i])
            yield Remark(
                f"frictionloss of {name} holds it with {value:g}; friction is not smooth",
                True,
                where,
                value,
            )
        if m.jnt_limited[i] and file.suffix != ".urdf":
            lower, upper = map(float, m.jnt_range[i])
            yield from _limit(name, lower, upper, float(z[:, i].min()), float(z[:, i].max()), where)
        if np.any(m.jnt_stiffness[i]) and m.qpos_spring[i] != 0:
            rest = float(m.qpos_spring[i])
            message = f"the spring of {name} rests at {rest:g} (springref)"
            yield Remark(message, False, where, rest, _PULL)
        if m.qpos0[i]:
            value = float(m.qpos0[i])
            yield Remark(
                f"{name} is {value:g} where the file draws it (ref)", False, where, value, _PULL
            )


def _mujoco_options(m: Any, sidecar: Sidecar) -> Iterator[Remark]:
    gravity = [float(g) for g in m.opt.gravity]
    if "gravity" in {**sidecar.settings, **sidecar.engine_settings.get("mujoco", {})}:
        where = _line(Path(f"{sidecar.model}.toml"), r"(?m)^\s*gravity\s*=")
    else:
        where = _line(sidecar.model, r"\bgravity\s*=")
    shown = ", ".join(f"{g:g}" for g in gravity)
    if sum(g != 0 for g in gravity) > 1:
        yield Remark(f"gravity is tilted: ({shown}) is along no axis", False, where, shows_in=_PULL)
    if not sidecar.model.read_text(encoding="utf-8", errors="replace").count("gravity=") and not (
        where.endswith(".toml") or ".toml:" in where
    ):
        yield Remark(f"no gravity is stated: MuJoCo takes ({shown})", False, where, shows_in=_PULL)
    if m.opt.wind.any() or m.opt.density or m.opt.viscosity:
        yield Remark(
            "a medium (wind, density or viscosity) acts on the bodies",
            True,
            _line(sidecar.model, r"\b(wind|density|viscosity)\s*="),
        )


def _mujoco_equalities(m: Any, sidecar: Sidecar) -> Iterator[Remark]:
    import mujoco

    plain = mujoco.MjSpec().default.equality
    for i in range(m.neq):
        name = m.equality(i).name or f"number {i + 1}"
        where = _named(sidecar.model, r"(?:joint|weld|connect|tendon)", name)
        if not m.eq_active0[i]:
            yield Remark(f"equality {name} is not active", False, where, shows_in=("inertia",))
        elif np.array_equal(m.eq_solref[i], plain.solref):
            yield Remark(
                f"equality {name} is soft: solref is MuJoCo's default, 0.02 s, and wrong at any"
                " step",
                True,
                where,
                float(m.eq_solref[i][0]),
            )
        elif np.array_equal(m.eq_solimp[i], plain.solimp):
            yield Remark(
                f"equality {name} is soft: solimp is MuJoCo's default",
                False,
                where,
                shows_in=("inertia",),
            )


def _mujoco_tendons(m: Any, file: Path) -> Iterator[Remark]:
    if file.suffix == ".urdf":
        return  # the sidecar's, with a rest of their own
    import mujoco

    for i, tendon in enumerate(mujoco.MjSpec.from_file(str(file)).tendons):
        where = _named(file, r"(?:fixed|spatial)", tendon.name)
        if np.any(m.tendon_stiffness[i]) and np.all(np.asarray(tendon.springlength) == -1):
            value = float(m.tendon_lengthspring[i][0])
            yield Remark(
                f"tendon {tendon.name or i + 1} states no springlength: its spring rests at"
                f" {value:g}, its length where the joints are at their springref",
                False,
                where,
                value,
                _PULL,
            )
        if m.tendon_limited[i] or m.tendon_frictionloss[i]:
            yield Remark(f"tendon {tendon.name or i + 1} has a limit or friction", True, where)


def _mujoco_contacts(m: Any, file: Path, z: Array) -> Iterator[Remark]:
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
        yield Remark(f"geoms {names[0]} and {names[1]} touch along the motions", True, str(file))
    if not touching:
        able = int(np.sum((m.geom_contype > 0) | (m.geom_conaffinity > 0)))
        yield Remark(
            f"{able} geoms can collide (contype, conaffinity); at the motions' states none does",
            False,
            str(file),
        )


def _pymunk(model: Any, file: Path) -> Iterator[Remark]:
    import pymunk

    space, _ = model._module.build()  # another one: as the file builds it, moved by nothing
    if space.damping != 1:
        value = float(space.damping)
        yield Remark(
            f"Space.damping is {value:g}: every velocity loses {1 - value:.3g} of itself a second",
            True,
            _line(file, r"\.damping\s*=[^=]"),
            value,
        )
    gravity = tuple(map(float, space.gravity))
    if gravity[0] and gravity[1]:
        yield Remark(
            f"gravity is tilted: {gravity} is along no axis",
            False,
            _line(file, r"\.gravity\s*="),
            shows_in=_PULL,
        )
    plain = pymunk.PivotJoint(pymunk.Body(1, 1), pymunk.Body(1, 1), (0, 0)).error_bias
    for constraint in space.constraints:
        kind = type(constraint).__name__
        where = _line(file, rf"\b{kind}\(")
        if isinstance(constraint, (pymunk.DampedSpring, pymunk.DampedRotarySpring)):
            continue  # forces, which have no error to correct
        if constraint.error_bias == plain:
            yield Remark(
                f"error_bias of a {kind} is pymunk's default, 0.9**60: at ordinary steps the"
                " joint takes energy out of the motion",
                False,
                where,
                float(plain),
            )
        if constraint.max_force < float("inf") or constraint.max_bias < float("inf"):
            yield Remark(
                f"a {kind} has a largest force or correction: it lets go beyond", False, where
            )
    yield from _pymunk_springs(space.constraints, file)
    shapes = [s for s in space.shapes if not s.sensor and s.filter.mask != 0]
    if len(shapes) > 1:
        yield Remark(f"{len(shapes)} shapes can collide: their filters let them", False, str(file))


def _pymunk_springs(constraints: Iterable[Any], file: Path) -> Iterator[Remark]:
    import pymunk

    for spring in constraints:
        if isinstance(spring, pymunk.DampedSpring) and spring.stiffness:
            start = spring.a.local_to_world(spring.anchor_a)
            end = spring.b.local_to_world(spring.anchor_b)
            here, rest = (end - start).length, spring.rest_length
            what = "length"
        elif isinstance(spring, pymunk.DampedRotarySpring) and spring.stiffness:
            here, rest = spring.a.angle - spring.b.angle, spring.rest_angle
            what = "angle"
        else:
            continue
        if abs(here - rest) > 1e-9 * max(1.0, abs(here)):
            yield Remark(
                f"a {type(spring).__name__} is built at the {what} {here:g} and rests at {rest:g}",
                False,
                _line(file, rf"\b{type(spring).__name__}\("),
                float(rest),
                _PULL,
            )
