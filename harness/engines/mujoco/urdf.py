"""A URDF in MuJoCo: what settings change in the file, and what the format cannot say."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.settings import is_on
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, held_joints
from physics_crosscheck.harness.engines.urdf import base_name, joint_springs
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_shapes,
)


def complete_urdf(tree: Any, spec: ModelSpec, robot: ET.Element) -> None:
    """Add what a URDF cannot say to MuJoCo: a floating root, Gazebo's and the sidecar's springs."""
    if is_on(spec, "floating", otherwise=False):
        root = tree.worldbody.first_body()
        if root is None:
            raise EngineError(f"{spec.path}: it has no link that can float")
        root.add_freejoint().name = base_name(robot)
    held = held_joints(spec)
    for joint, (stiffness, rest) in joint_springs(robot, spec.path).items():
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
    """A stiffness or damping as MuJoCo has it: a polynomial, in earlier versions a number.

    Args:
        value: in N m/rad, N/m or these times seconds.
        there: what stands in its place.
    """
    return [value, 0.0, 0.0] if np.ndim(there) else value


def changes(spec: ModelSpec) -> list[Change]:
    """What settings change in a URDF before it is loaded."""
    found: list[Change] = [_without_idle_shapes] if is_on(spec, "smooth", otherwise=False) else []
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        found.append(mimics_of(followers))
    return [*found, with_held(held)] if (held := held_joints(spec)) else found


def _without_idle_shapes(robot: ET.Element) -> None:
    """Leave shapes out, unless the file asks that inertias are made of them."""
    made = (one.get("inertiafromgeom") for one in robot.iterfind("mujoco/compiler"))
    if "true" not in made:
        without_shapes(robot)
