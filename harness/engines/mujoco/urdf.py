"""A URDF in MuJoCo: changes by settings, and elements that the format lacks.

MuJoCo gives limits, dry friction and shapes of a URDF its default softness. It ignores the limits
of continuous joints, and ranges of which one bound is missing (4.0.0; `src/xml/xml_urdf.cc`).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.reference.mechanism.laws import SoftRules
from ..protocol import EngineError, ModelSpec, held_joints
from ..source import shortened
from ..urdf_copy import (
    DEEP,
    Change,
    bare_links,
    collision_shapes,
    followers_of,
    has_form,
    mimics_of,
    temporary_urdf,
    with_forms,
    with_held,
    without_law,
    without_visuals,
)
from .laws import default_softness, laws_of
from .smooth import WITHOUT, apply_settings, is_on
from .whole import MujocoWhole

FORMS = ("box", "sphere", "cylinder", "capsule")
"""Tags of shapes that need no file."""

_EXTENSIONS: Mapping[str, tuple[str, ...]] = MappingProxyType({
    "compiler": (
        "inertiafromgeom", "boundmass", "boundinertia", "balanceinertia", "settotalmass", "angle",
        "eulerseq",
    ),
    "option": ("density", "viscosity", "wind"),
    "option/flag": ("gravity", "spring", "damper"),
})  # fmt: skip

SHAPE_MASSES = "shape_masses"
"""The setting that keeps MuJoCo's masses of links without `<inertial>`, from their shapes."""


def complete_urdf(tree: Any, spec: ModelSpec, file: UrdfFile) -> None:
    """Add a floating root and the springs of Gazebo and the sidecar, which a URDF can't state for
    MuJoCo.
    """
    float_root(tree, spec, file)
    held = held_joints(spec)
    for joint, (stiffness, rest) in file.springs.items():
        if joint in held:
            continue
        element = tree.joint(joint)
        if element is None:
            raise EngineError(f"{spec.path}: <gazebo reference={joint!r}> names no moving joint")
        element.stiffness = spring_terms(stiffness, element.stiffness)
        element.springref = rest
    for index, spring in enumerate(spec.springs):
        tendon = tree.add_tendon(name=f"crosscheck_spring_{index}")
        for joint, coefficient in spring.joints.items():
            tendon.wrap_joint(joint, coefficient)
        tendon.stiffness = spring_terms(spring.stiffness, tendon.stiffness)
        tendon.damping = spring_terms(spring.damping, tendon.damping)
        tendon.springlength = [spring.rest, spring.rest]


def float_root(tree: Any, spec: ModelSpec, file: UrdfFile) -> bool:
    """Add a free joint if the settings ask for one, and the root can float; return whether."""
    floats = is_on(spec, "floating", otherwise=False) and file.can_float
    if floats:
        root = tree.worldbody.first_body()
        if root is None:
            raise EngineError(f"{spec.path}: it has no link that can float")
        root.add_freejoint().name = file.base
    return floats


def spring_terms(value: float, there: Any) -> Any:
    """Return a stiffness or damping as MuJoCo stores it: a polynomial, or a number in earlier
    versions.

    Args:
        value: in N m/rad, N/m or these times seconds.
        there: the value that it replaces.
    """
    return [value, 0.0, 0.0] if np.ndim(there) else value


def changes(spec: ModelSpec) -> list[Change]:
    """Return the changes that settings make to a URDF before it is loaded."""
    changes_made: list[Change] = []
    if any(key.startswith(WITHOUT) for key in spec.settings):
        changes_made.append(partial(_without_extensions, settings=spec.settings))
    if is_on(spec, "smooth", otherwise=False):
        changes_made.append(_without_idle_shapes)
    if not is_on(spec, SHAPE_MASSES, otherwise=True):
        changes_made.append(_without_masses_of_shapes)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        changes_made.append(mimics_of(followers))
    return [*changes_made, with_held(held)] if (held := held_joints(spec)) else changes_made


def extensions(robot: XmlElement) -> Iterator[tuple[XmlElement, str]]:
    """Yield each attribute in `<mujoco>` of a URDF that changes its physics, and its element."""
    for tag, keys in _EXTENSIONS.items():
        for element in robot.findall(f"mujoco/{tag}"):
            yield from ((element, key) for key in keys if key in element.attributes)


def extension_cause(
    element: XmlElement, key: str, stated: Mapping[str, float], compiled: Mapping[str, float]
) -> str:
    """Return the cause that a diagnosis reports, with the masses of bodies that differ, kg."""
    masses = [
        f"{name} {stated[name]:.6g} kg in the file, {mass:.6g} kg in MuJoCo"
        for name, mass in compiled.items()
        if mass != stated.get(name, mass)
    ]
    shown = f" ({shortened(masses, 3, '; ')})" if masses else ""
    value, line = element.get(key), element.place[1]
    return f'MuJoCo\'s own <{element.tag} {key}="{value}">, line {line}{shown}'


def _without_extensions(robot: XmlElement, settings: Mapping[str, object]) -> None:
    """Remove the attributes that settings leave out."""
    for element, key in list(extensions(robot)):
        if settings.get(WITHOUT + key, False):
            del element.attributes[key]


def shaped_links(robot: XmlElement, *, floats: bool) -> list[XmlElement]:
    """Return the links without `<inertial>` whose mass MuJoCo computes from simple shapes."""
    if _inertia_modes(robot):
        return []
    links = bare_links(robot, floats=floats)
    return [one for one in links if any(has_form(s, FORMS) for s in one.findall("collision"))]


def _inertia_modes(robot: XmlElement) -> set[str]:
    modes = {one.get("inertiafromgeom", "auto") for one in robot.findall("mujoco/compiler")}
    return modes - {"auto"}


def _without_idle_shapes(robot: XmlElement) -> None:
    """Remove shapes, except those from which MuJoCo computes inertias."""
    if "true" in _inertia_modes(robot):
        return
    without_visuals(robot)
    with_forms(FORMS)(robot)
    kept = shaped_links(robot, floats=True)
    for link in robot.findall("link"):
        for shape in link.findall("collision") if link not in kept else ():
            link.remove(shape)


def name_collisions(robot: XmlElement) -> None:
    """Name the collision shapes of a URDF as in `Model.shapes`."""
    for link in robot.findall("link"):
        for name, shape in collision_shapes(link):
            shape.set("name", name)


def _without_masses_of_shapes(robot: XmlElement) -> None:
    """Remove the shapes of links without `<inertial>`."""
    for link in shaped_links(robot, floats=True):
        for shape in link.findall("collision"):
            link.remove(shape)


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
