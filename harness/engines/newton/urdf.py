"""A URDF as Newton reads it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.newton.layout import Layout
from physics_crosscheck.harness.engines.newton.reading import (
    ParsedModel,
    collapse,
    collect_warnings,
    correct_inertias,
    new_builder,
    without_limit_forces,
)
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.engines.urdf_copy import with_changes
from physics_crosscheck.harness.engines.urdf_engine import UrdfModel

READER = UrdfReader(
    name="newton",
    no_inertial="the mass of its collision shapes at 1000 kg/m^3, or none",
    equal_bounds=True,
    no_friction="Newton",
)


def without_idle_shapes(robot: XmlElement) -> None:
    """Remove shapes, except those from which Newton computes a mass."""
    for link in robot.findall("link"):
        tags = ("visual",) if link.find("inertial") is None else ("visual", "collision")
        for shape in [shape for tag in tags for shape in link.findall(tag)]:
            link.remove(shape)


def stopped_turns(robot: XmlElement) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield continuous joints with limits, which other engines ignore."""
    for joint in robot.findall("joint"):
        stated = {} if (limit := joint.find("limit")) is None else limit.attributes
        if joint.get("type") == "continuous" and {"lower", "upper"} <= set(stated):
            bounds = float(stated["lower"]), float(stated["upper"])
            if bounds[0] <= bounds[1]:  # the file's copy has no others
                yield joint.get("name", ""), bounds


def read_urdf(model: UrdfModel) -> ParsedModel:
    """Read a URDF and its sidecar's declarations.

    Raises:
        EngineError: naming file and joint.
    """
    robot = with_changes(model.declared.robot, model.declared.changes)
    builder, messages = new_builder(model.gravity), list[str]()
    with collect_warnings(messages):
        text = robot.written().decode()
        builder.add_urdf(text, floating=model.floats, enable_self_collisions=False)
    if model.settings["smooth"]:
        without_limit_forces(builder)
    corrected = correct_inertias(builder, messages) if model.settings["corrected_inertias"] else ()
    lost = collapse(builder, bool(model.settings["collapse_fixed_joints"]))
    prefix = f"{robot.get('name')}/" if robot.get("name") else ""
    names: list[list[str]] = []
    for label, (lines, turns) in zip(builder.joint_label, builder.joint_dof_dim, strict=True):
        name = label.removeprefix(prefix)
        if lines + turns > 1 and not (model.floats and not names):
            raise EngineError(f"{model.path}: joint {name!r} is neither a slide nor a hinge")
        names.append([model.root if model.floats and not names else name][: lines + turns])
    layout = Layout(builder, names, np.zeros(len(builder.joint_qd)))
    springs = model.declared.springs
    return ParsedModel(
        builder=builder,
        layout=layout,
        springs=springs,
        lost=lost,
        corrected=corrected,
        messages=messages,
    )
