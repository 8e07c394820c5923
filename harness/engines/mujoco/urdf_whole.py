"""A URDF in MuJoCo with all its forces, and a floor under a floating root, for single steps.

MuJoCo gives limits, dry friction and shapes of a URDF its default softness. It ignores the limits
of continuous joints, and ranges of which one bound is missing (4.0.0; `src/xml/xml_urdf.cc`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.harness.engines.mujoco.laws import default_softness, laws_of
from physics_crosscheck.harness.engines.mujoco.settings import apply_settings
from physics_crosscheck.harness.engines.mujoco.urdf import (
    FORMS,
    changes,
    float_root,
    name_collisions,
)
from physics_crosscheck.harness.engines.mujoco.whole import MujocoWhole
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf_copy import (
    DEEP,
    temporary_urdf,
    with_forms,
    without_law,
    without_visuals,
)
from physics_crosscheck.reference.mechanism.laws import SoftRules

_FLOOR = "crosscheck_floor"

_EDITS = (
    "couplings released", "a floor under a floating root",
    "no mass of links without <inertial>",
)  # fmt: skip


def urdf_whole(
    spec: ModelSpec, file: UrdfFile, whole_of: Callable[[Any], MujocoWhole]
) -> MujocoWhole:
    """Return a URDF with its limits, dry friction and shapes.

    Args:
        spec: what to load.
        file: the URDF.
        whole_of: returns the model of a compiled one.
    """
    import mujoco

    given = {key: value for key, value in spec.settings.items() if key != "tolerance"}
    settings = {**given, "smooth": False, "couplings": False}
    changed, robot = replace(spec, settings=settings), file.document.root
    edits = [*changes(changed), name_collisions, without_visuals, with_forms(FORMS)]
    with temporary_urdf(robot, spec.path, edits) as path:
        tree = mujoco.MjSpec.from_file(str(path))
    for body in tree.bodies:
        if not body.explicitinertial:  # motions compare masses that MuJoCo computes
            for shape in body.geoms:
                shape.density = 0.0
    floats = float_root(tree, spec, file)
    apply_settings(tree, changed)
    if floats:
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        tree.worldbody.add_geom(name=_FLOOR, type=plane, size=[0.0, 0.0, 1.0])
    model = tree.compile()
    if floats:
        _put_on_floor(model)
    whole = whole_of(model)
    whole.edits = (*whole.edits, *_EDITS)
    whole.uncovered = (*whole.uncovered, *without_law(robot, FORMS))
    laws, _ = laws_of(model)
    whole.rules = SoftRules(
        # No drive exerts the forces that an effort limits.
        laws=replace(laws, limits=(), frictions=(), joint_ranges={}),
        softness=default_softness(tree),
        bodies=tuple(model.body(i).name for i in range(model.nbody)),
        shapes=tuple(model.geom(i).name for i in range(model.ngeom)),
    )
    whole.floor = 0.0 if floats else None
    return whole


def _put_on_floor(model: Any) -> None:
    """Lift the drawn configuration until its lowest shape touches the floor."""
    import mujoco

    data, floor = mujoco.MjData(model), model.geom(_FLOOR).id
    data.qpos[2] = -DEEP
    mujoco.mj_forward(model, data)
    depths = (-contact.dist for contact in data.contact if floor in contact.geom)
    model.qpos0[2] = max(depths, default=DEEP) - DEEP
