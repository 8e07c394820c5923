"""A URDF in MuJoCo: changes by settings, and elements that the format lacks."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.harness.engines.mujoco.settings import is_on
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, held_joints
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_shapes,
)


def complete_urdf(tree: Any, spec: ModelSpec, file: UrdfFile) -> None:
    """Add a floating root and the springs of Gazebo and the sidecar, which a URDF can't state for
    MuJoCo.
    """
    if is_on(spec, "floating", otherwise=False):
        root = tree.worldbody.first_body()
        if root is None:
            raise EngineError(f"{spec.path}: it has no link that can float")
        root.add_freejoint().name = file.base
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
    changes_made: list[Change] = (
        [_without_idle_shapes] if is_on(spec, "smooth", otherwise=False) else []
    )
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        changes_made.append(mimics_of(followers))
    return [*changes_made, with_held(held)] if (held := held_joints(spec)) else changes_made


def _without_idle_shapes(robot: XmlElement) -> None:
    """Remove shapes, unless the file computes inertias from them."""
    modes = (one.get("inertiafromgeom") for one in robot.findall("mujoco/compiler"))
    if "true" not in modes:
        without_shapes(robot)
