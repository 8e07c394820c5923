"""A USD stage as Newton reads it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import free_name
from physics_crosscheck.harness.documents.usd import UsdStage, unique_tails
from physics_crosscheck.harness.engines.newton.layout import Layout
from physics_crosscheck.harness.engines.newton.mjcf import EQUALITIES, equal_joints
from physics_crosscheck.harness.engines.newton.reading import (
    ParsedModel,
    collect_warnings,
    correct_inertias,
    new_builder,
    without_limit_forces,
)
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, held_joints
from physics_crosscheck.harness.engines.source import open_stage
from physics_crosscheck.harness.engines.urdf_copy import followers_of


def read_usd(spec: ModelSpec, settings: Mapping[str, object]) -> ParsedModel:
    """Read a stage whose settings are valid.

    Raises:
        EngineError: for units that Newton does not convert, and for joints of several axes.
    """
    stage = open_stage(spec)
    if (stage.unit, stage.mass_unit) != (1.0, 1.0):
        units = f"metersPerUnit {stage.unit:g} and kilogramsPerUnit {stage.mass_unit:g}"
        raise EngineError(f"{spec.path}: Newton converts no units; it has {units}, expected 1")
    joints = _names(stage, stage.pxr.UsdPhysics.Joint)
    _hold(stage, [path for path, name in joints.items() if name in held_joints(spec)])
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
    bodies = _names(stage, None)
    names = []
    for label, child, (lines, turns) in zip(
        builder.joint_label, builder.joint_child, builder.joint_dof_dim, strict=True
    ):
        name = joints.get(label) or free_name(bodies[builder.body_label[child]], joints.values())
        if lines + turns > 1 and (lines, turns) not in ((3, 3), (0, 3)):
            raise EngineError(f"{spec.path}: joint {name!r} has several axes")
        names.append([name][: lines + turns])
    layout = Layout(builder, names, np.zeros(len(builder.joint_qd)))
    lost: dict[str, Mapping[str, object]] = {}
    with collect_warnings(messages):
        if equal_joints(builder, layout, followers, bool(settings["equalities"])):
            lost[EQUALITIES] = {"equalities": True}
    corrected = correct_inertias(builder, messages) if settings["corrected_inertias"] else ()
    return ParsedModel(
        builder=builder,
        layout=layout,
        springs=spec.springs,
        lost=lost,
        corrected=corrected,
        messages=messages,
    )


def _names(stage: UsdStage, kind: Any) -> dict[str, str]:
    """Return the names of all joints, or of all bodies, by their paths."""
    rigid = stage.pxr.UsdPhysics.RigidBodyAPI
    prims = [one for one in stage.prims if (one.IsA(kind) if kind else one.HasAPI(rigid))]
    paths = [str(one.GetPath()) for one in prims]
    return dict(zip(paths, unique_tails(paths), strict=True))


def _hold(stage: UsdStage, paths: list[str]) -> None:
    """Fix joints where their frames meet, in a layer over the file."""
    for path in paths:
        stage.set_type(path, "PhysicsFixedJoint")
