"""An MJCF as Newton reads it, and what its own solver leaves out of one."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mjcf_source import option_remarks, read_source_mjcf
from physics_crosscheck.harness.engines.newton.layout import Layout
from physics_crosscheck.harness.engines.newton.reading import (
    Read,
    correct_inertias,
    heard,
    new_builder,
    without_stops,
)
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, Spring
from physics_crosscheck.harness.engines.urdf_copy import followers_of

TENDONS = "Newton's leaving out of tendons"
EQUALITIES = "Newton's leaving out of joint equalities"

DROPS = "Newton's own solvers leave out"


def read_mjcf(spec: ModelSpec, settings: Mapping[str, object]) -> Read:
    """An MJCF whose settings are in order.

    Raises:
        EngineError: for what Newton's own solver leaves out and that isn't added here.
    """
    source = read_source_mjcf(spec.path)
    root = source.root
    builder, said = new_builder(settings["gravity"]), list[str]()  # type: ignore[arg-type]
    with heard(said):
        builder.add_mjcf(str(spec.path), parse_visuals=False, enable_self_collisions=False)
    followers = followers_of(settings, f"{spec.path}.toml")
    for reason in _left_out(root, followers is None):
        raise EngineError(f"{spec.path}: it has {reason}, which {DROPS}")
    if settings["smooth"]:
        without_stops(builder)
    attributes = builder.custom_attributes
    refs = np.zeros(len(builder.joint_qd))
    for dof, value in (attributes["mujoco:dof_ref"].values or {}).items():
        refs[dof] = value
    layout = Layout(builder, _names(root, builder, spec.path), refs)
    lost: dict[str, Mapping[str, object]] = {}
    with heard(said):
        tendons = tuple(_tendons(builder, layout, spec.path))
        if _equal(builder, layout, followers, bool(settings["equalities"])):
            lost[EQUALITIES] = {"equalities": True}
    if tendons and not settings["tendons"]:
        lost[TENDONS] = {"tendons": True}
    corrected = correct_inertias(builder, said) if settings["corrected_inertias"] else ()
    read_over = option_remarks(source, "Newton", frozenset({"timestep", "gravity"}))
    told = {one.message: one.address or "" for one in read_over}
    return Read(
        builder=builder,
        layout=layout,
        springs=tendons if settings["tendons"] else (),
        lost=lost,
        told=told,
        corrected=corrected,
        said=said,
    )


def _left_out(root: ET.Element, all_equalities: bool) -> Iterator[str]:
    """What acts in MuJoCo, not here, and is no smooth thing that this adapter adds."""
    if any(len(one) for one in root.findall("actuator")):
        yield "actuators"
    if all_equalities and {one.tag for one in root.findall("equality/*")} - {"joint"}:
        yield "equalities of other things than joints"
    for one in root.findall("tendon/spatial"):
        if {key for key in ("stiffness", "damping") if float(one.get(key, "0").split()[0])}:
            yield "a tendon between sites that pulls"
    for one in root.findall("option"):
        if any(set(one.get(key, "0").split()) - {"0", "0.0"} for key in MEDIUM):
            yield "a medium"
    if any(float(one.get("gravcomp", "0")) for one in root.iter("body")):
        yield "gravity compensation"
    for one in root.iter("joint"):
        if one.get("type") in ("ball", "free") and float(one.get("stiffness", "0").split()[0]):
            yield "a spring of a ball or free joint"


MEDIUM = ("density", "viscosity", "wind")


def _names(root: ET.Element, builder: Any, path: Path) -> list[list[str]]:
    """Of the coordinates of each of Newton's joints; those of one body become one joint."""
    bodies = [one for world in root.findall("worldbody") for one in world.iter("body")]
    if len(bodies) != len(builder.body_label):
        raise EngineError(
            f"{path}: Newton builds {len(builder.body_label)} bodies from its {len(bodies)}"
        )
    joints = [[one for one in body if one.tag in ("joint", "freejoint")] for body in bodies]
    order = [one for row in joints for one in row]
    found = []
    for child, (lines, _) in zip(builder.joint_child, builder.joint_dof_dim, strict=True):
        row = joints[child]
        slides = [one for one in row if one.get("type") == "slide"]
        if len(row) > 1 and len(slides) != lines:
            raise EngineError(f"{path}: joints of body {bodies[child].get('name')!r} have no type")
        own = row if len(row) < 2 else slides + [one for one in row if one not in slides]
        found.append([one.get("name") or f"joint_{order.index(one)}" for one in own])
    return found


def _tendons(builder: Any, layout: Layout, path: Path) -> Iterator[Spring]:
    """Springs and dampers of combinations of slides and hinges."""
    if "mujoco:tendon_joint" not in builder.custom_attributes or not len(
        builder.custom_attributes["mujoco:tendon_joint"].values or ()
    ):
        return
    found = builder.finalize(device="cpu").mujoco
    names = layout.of_joints
    rest = np.array(builder.joint_rest_q)
    for i, kind in enumerate(found.tendon_type.numpy()):
        first, count = (int(getattr(found, f"tendon_joint_{k}").numpy()[i]) for k in ("adr", "num"))
        k, c = (
            float(getattr(found, f"tendon_{one}").numpy()[i]) for one in ("stiffness", "damping")
        )
        if kind or not (k or c):
            continue
        rows = range(first, first + count)
        joints = [int(found.tendon_joint.numpy()[row]) for row in rows]
        shares = [float(found.tendon_coef.numpy()[row]) for row in rows]
        if any(len(names[j]) != 1 for j in joints):
            raise EngineError(f"{path}: a tendon pulls at a joint of a body that has several")
        lower, upper = map(float, found.tendon_springlength.numpy()[i])
        if lower < 0:  # where the joints' own springs are relaxed
            drawn = [
                rest[builder.joint_q_start[j]] + layout.refs[builder.joint_qd_start[j]]
                for j in joints
            ]
            lower = upper = float(np.dot(shares, drawn))
        if upper > lower:
            raise EngineError(f"{path}: a tendon is slack between two lengths")
        named = {names[j][0]: share for j, share in zip(joints, shares, strict=True)}
        yield Spring(named, k, c, lower)


def _equal(builder: Any, layout: Layout, followers: Collection[str] | None, held: bool) -> bool:
    """Make joints follow others, which Newton's own solver reduces; whether any is let go."""
    lost = False
    rows = zip(
        builder.constraint_mimic_joint0,
        builder.constraint_mimic_joint1,
        builder.constraint_mimic_coef0,
        builder.constraint_mimic_coef1,
        builder.constraint_mimic_enabled,
        strict=True,
    )
    for joint, leader, offset, multiplier, enabled in rows:
        if not enabled or (followers is not None and layout.of_joints[joint][0] not in followers):
            continue
        if held:
            builder.set_joint_mimic(joint, leader, coeffs=(offset, multiplier))
        lost |= not held
    return lost
