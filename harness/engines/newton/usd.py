"""A USD stage as Newton reads it; a drive's target outside of the limits becomes their middle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import free_name
from physics_crosscheck.harness.documents.usd import UsdStage
from ..protocol import ModelSpec, UnsupportedError, held_joints
from ..source import open_stage
from ..urdf_copy import followers_of
from .layout import Layout
from .mjcf import EQUALITIES, equal_joints
from .reading import (
    ParsedModel,
    collect_warnings,
    correct_inertias,
    new_builder,
    without_limit_forces,
)

ORPHANS = "Newton's leaving out of joints without a PhysicsArticulationRootAPI"

USD_NON_PHYSICAL: Mapping[str, str] = {
    r".*@(physics:(lower|upper)Limit|limit:.*|newton:limit.*)": "joint limits",
    r".*@(newton:friction|physics:\w+Friction)": "dry friction",
    r".*@(drive:.*:maxForce|newton:velocityLimit)": "actuator limits",
    r".*@(mjc|physx\w*|state):.*": "other namespaces",
}
"""Numbers of a stage that need not affect a smooth motion, by purpose."""


def read_usd(spec: ModelSpec, settings: Mapping[str, object]) -> ParsedModel:
    """Read a stage whose settings are valid.

    Raises:
        UnsupportedError: for units that Newton does not convert, and joints of several axes.
    """
    stage = open_stage(spec)
    _check_units(stage)
    for name, prim in stage.joints.items():
        if settings["smooth"] and stage.is_outside(prim):
            stage.switch_off(prim)
        elif name in held_joints(spec):
            stage.fix_joint(prim)
    builder, messages = new_builder(settings["gravity"]), list[str]()  # type: ignore[arg-type]
    import newton

    with collect_warnings(messages):
        builder.add_usd(
            stage.stage,
            schema_resolvers=[newton.usd.SchemaResolverNewton()],
            load_visual_shapes=False,
            load_static_visual_shapes=False,
            enable_self_collisions=False,
            apply_up_axis_from_stage=True,
        )
    followers = followers_of(settings, f"{spec.path}.toml")
    if settings["smooth"]:
        without_limit_forces(builder)
    layout = Layout(builder, _joint_names(stage, builder), np.zeros(len(builder.joint_qd)))
    lost: dict[str, Mapping[str, object]] = {}
    if orphans := [i for i, one in enumerate(builder.joint_articulation) if one < 0]:
        if settings["articulations"]:
            builder.add_articulation(orphans)
        elif inner := [i for i in orphans if builder.joint_parent[i] >= 0]:
            place = stage.place(stage.stage.GetPrimAtPath(builder.joint_label[inner[0]]))
            problem = f"joint {place.address} is in no articulation, and Newton refuses that. "
            problem += "Apply PhysicsArticulationRootAPI above the bodies"
            raise UnsupportedError(problem, file=place.file, line=place.line)
        else:
            lost[ORPHANS] = {"articulations": True}
    with collect_warnings(messages):
        if equal_joints(builder, layout, followers, bool(settings["equalities"])):
            lost[EQUALITIES] = {"equalities": True}
    corrected = _point_bodies(stage, builder, is_kept=bool(settings["corrected_inertias"]))
    if settings["corrected_inertias"]:
        corrected += correct_inertias(builder, messages)
    return ParsedModel(
        builder=builder,
        layout=layout,
        springs=spec.springs,
        lost=lost,
        corrected=corrected,
        messages=messages,
    )


def _check_units(stage: UsdStage) -> None:
    for name, unit in (("metersPerUnit", stage.unit), ("kilogramsPerUnit", stage.mass_unit)):
        if unit != 1.0:
            problem = f"{name} is {unit:g}; Newton converts no units of rigid bodies"
            problem, line = f"{problem}. Rewrite the stage in m and kg", stage.header_line(name)
            raise UnsupportedError(problem, file=stage.path, line=line)


def _joint_names(stage: UsdStage, builder: Any) -> list[list[str]]:
    joints = {str(prim.GetPath()): name for name, prim in stage.joints.items()}
    bodies = {str(prim.GetPath()): name for name, prim in stage.bodies.items()}
    names = []
    rows = zip(builder.joint_label, builder.joint_child, builder.joint_dof_dim, strict=True)
    for label, child, (lines, turns) in rows:
        name = joints.get(label) or free_name(bodies[builder.body_label[child]], joints.values())
        stack = _stack(stage, name)
        if len(stack) == lines + turns > 1:  # as Newton stacks them: slides first
            names.append(sorted(stack, key=lambda one: _is_hinge(stage.joints[one])))
            continue
        if lines + turns > 1 and (lines, turns) not in ((3, 3), (0, 3)):
            place = stage.place(stage.stage.GetPrimAtPath(label))
            problem = f"Newton gives joint {place.address} several axes. Write one joint for each"
            raise UnsupportedError(problem, file=place.file, line=place.line)
        names.append([name][: lines + turns])
    return names


def _is_hinge(prim: Any) -> bool:
    return bool(prim.GetTypeName() == "PhysicsRevoluteJoint")


def _stack(stage: UsdStage, name: str) -> list[str]:
    ends = {
        other: {*stage.targets(prim, "physics:body0"), *stage.targets(prim, "physics:body1")}
        for other, prim in stage.joints.items()
    }
    return [other for other in ends if ends[other] == ends.get(name)]


def _point_bodies(stage: UsdStage, builder: Any, *, is_kept: bool) -> list[str]:
    """Return bodies without moments, for which Newton invents some; drop them unless `is_kept`."""
    names = []
    for i, label in enumerate(builder.body_label):
        tensor = builder.body_inertia[i]
        if _is_point(stage, stage.stage.GetPrimAtPath(label)) and np.any(tensor):
            names += [label.rpartition("/")[2]] if is_kept else []
            builder.body_inertia[i] = tensor if is_kept else type(tensor)(0.0)
    return names


def _is_point(stage: UsdStage, body: Any) -> bool:
    """Return whether a body has no moments, for which Newton takes those of a ball."""
    if (six := stage.stated(body, "newton:inertia")) is not None:
        return not np.any(six)
    usd, shape = stage.pxr.Usd, stage.pxr.UsdPhysics.CollisionAPI
    below = usd.PrimRange(body, usd.TraverseInstanceProxies())
    moments = stage.value(body, "physics:diagonalInertia", (0.0,) * 3)
    return not np.any(moments) and not any(prim.HasAPI(shape) for prim in below)
