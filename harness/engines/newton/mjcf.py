"""An MJCF as Newton reads it, and the elements that its own solver leaves out."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from ..mjcf_source import MjcfSource, option_remarks, read_source_mjcf
from ..protocol import EngineError, ModelSpec, Spring
from ..urdf_copy import followers_of
from .layout import Layout
from .reading import (
    ParsedModel,
    collect_warnings,
    correct_inertias,
    new_builder,
    without_limit_forces,
)

TENDONS = "Newton's leaving out of tendons"
EQUALITIES = "Newton's leaving out of joint equalities"

DROPS = "Newton's own solvers leave out"


def read_mjcf(spec: ModelSpec, settings: Mapping[str, object]) -> ParsedModel:
    """Read an MJCF whose settings are valid.

    Raises:
        EngineError: for elements that Newton's solver leaves out and the adapter does not add.
    """
    source = read_source_mjcf(spec.path)
    root = source.root
    builder, messages = new_builder(settings["gravity"]), list[str]()  # type: ignore[arg-type]
    with collect_warnings(messages):
        builder.add_mjcf(str(spec.path), parse_visuals=False, enable_self_collisions=False)
    followers = followers_of(settings, f"{spec.path}.toml")
    for reason in _left_out(source, followers is None):
        raise EngineError(f"{spec.path}: it has {reason}, which {DROPS}")
    if settings["smooth"]:
        without_limit_forces(builder)
    attributes = builder.custom_attributes
    refs = np.zeros(len(builder.joint_qd))
    for dof, value in (attributes["mujoco:dof_ref"].values or {}).items():
        refs[dof] = value
    layout = Layout(builder, _names(root, builder, spec.path), refs)
    lost: dict[str, Mapping[str, object]] = {}
    with collect_warnings(messages):
        tendons = tuple(_tendons(builder, layout, source))
        if equal_joints(builder, layout, followers, bool(settings["equalities"])):
            lost[EQUALITIES] = {"equalities": True}
    if tendons and not settings["tendons"]:
        lost[TENDONS] = {"tendons": True}
    corrected = correct_inertias(builder, messages) if settings["corrected_inertias"] else ()
    ignored_options = option_remarks(source, "Newton", frozenset({"timestep", "gravity"}))
    notes = {one.message: one.address or "" for one in ignored_options}
    for flag, numbers in (("spring", builder.joint_stiffness), ("damper", builder.joint_damping)):
        if source.disabled(flag):
            numbers[:] = [0.0] * len(numbers)
            notes[f"Newton ignores <flag {flag}>; the adapter applies it"] = f"option/flag@{flag}"
    return ParsedModel(
        builder=builder,
        layout=layout,
        springs=tendons if settings["tendons"] else (),
        lost=lost,
        notes=notes,
        corrected=corrected,
        messages=messages,
    )


def _left_out(source: MjcfSource, all_equalities: bool) -> Iterator[str]:
    """Yield elements with an effect in MuJoCo that neither Newton nor this adapter supports."""
    root, flags = source.root, {"stiffness": "spring", "damping": "damper"}
    pulls = [key for key, flag in flags.items() if not source.disabled(flag)]
    drives = root.findall("actuator") if not source.disabled("actuation") else ()
    if any(element.children for element in drives):
        yield "actuators"
    if all_equalities and {element.tag for element in root.findall("equality/*")} - {"joint"}:
        yield "equalities of other things than joints"
    for element in root.findall("tendon/spatial"):
        if any(float(element.get(key, "0").split()[0]) for key in pulls):
            yield "a tendon between sites that pulls"
    for element in root.findall("option"):
        if any(set(element.get(key, "0").split()) - {"0", "0.0"} for key in FLUID_OPTIONS):
            yield "a medium"
    if any(float(element.get("gravcomp", "0")) for element in root.iter("body")):
        yield "gravity compensation"
    rows = [one for one in root.iter("joint") if one.get("type") in ("ball", "free")]
    if any(float(one.get("stiffness", "0").split()[0]) for one in rows) and "stiffness" in pulls:
        yield "a spring of a ball or free joint"


FLUID_OPTIONS = ("density", "viscosity", "wind")


def _names(root: XmlElement, builder: Any, path: Path) -> list[list[str]]:
    bodies = [one for world in root.findall("worldbody") for one in world.iter("body")]
    if len(bodies) != len(builder.body_label):
        raise EngineError(
            f"{path}: Newton builds {len(builder.body_label)} bodies from its {len(bodies)}"
        )
    joints = [[one for one in body if one.tag in ("joint", "freejoint")] for body in bodies]
    order = [one for row in joints for one in row]
    result = []
    for child, (lines, _) in zip(builder.joint_child, builder.joint_dof_dim, strict=True):
        row = joints[child]
        slides = [one for one in row if one.get("type") == "slide"]
        if len(row) > 1 and len(slides) != lines:
            raise EngineError(f"{path}: joints of body {bodies[child].get('name')!r} have no type")
        ordered = row if len(row) < 2 else slides + [one for one in row if one not in slides]
        result.append([one.get("name") or f"joint_{order.index(one)}" for one in ordered])
    return result


def _tendons(builder: Any, layout: Layout, source: MjcfSource) -> Iterator[Spring]:
    """Yield springs and dampers of combinations of slides and hinges."""
    if "mujoco:tendon_joint" not in builder.custom_attributes or not len(
        builder.custom_attributes["mujoco:tendon_joint"].values or ()
    ):
        return
    model = builder.finalize(device="cpu").mujoco
    names = layout.of_joints
    rest = np.array(builder.joint_rest_q)
    for i, kind in enumerate(model.tendon_type.numpy()):
        first, count = (int(getattr(model, f"tendon_joint_{k}").numpy()[i]) for k in ("adr", "num"))
        k, c = (
            float(getattr(model, f"tendon_{key}").numpy()[i]) * (not source.disabled(flag))
            for key, flag in (("stiffness", "spring"), ("damping", "damper"))
        )
        if kind or not (k or c):
            continue
        rows = range(first, first + count)
        joints = [int(model.tendon_joint.numpy()[row]) for row in rows]
        shares = [float(model.tendon_coef.numpy()[row]) for row in rows]
        if any(len(names[j]) != 1 for j in joints):
            raise EngineError(f"{source.path}: a tendon pulls at a joint of a body with several")
        lower, upper = map(float, model.tendon_springlength.numpy()[i])
        if lower < 0:  # the length at which the joints' own springs are relaxed
            drawn = [
                rest[builder.joint_q_start[j]] + layout.refs[builder.joint_qd_start[j]]
                for j in joints
            ]
            lower = upper = float(np.dot(shares, drawn))
        if upper > lower:
            raise EngineError(f"{source.path}: a tendon is slack between two lengths")
        named = {names[j][0]: share for j, share in zip(joints, shares, strict=True)}
        yield Spring(named, k, c, lower)


def equal_joints(
    builder: Any, layout: Layout, followers: Collection[str] | None, held: bool
) -> bool:
    """Add mimic joints, which Newton's solver enforces; return whether any is left out."""
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
