"""Settings of a URDF's sidecar for PyBullet, joint axes that are not unit vectors, and scales.

PyBullet scales the motion by an axis' length: `btMultiBody::setupRevolute` and `setupPrismatic` use
the axis as given. A slanted axis printed with six digits has a length that differs from 1 by 1e-7.
It multiplies the inertia of a link by `<inertia_scaling>` in its `<contact>`, which no other engine
reads (`ConvertURDF2BulletInternal`: `localInertiaDiagonal *= contactInfo.m_inertiaScaling`).
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from ..protocol import ModelSpec, held_joints
from ..source import shortened
from ..urdf import ROUNDED
from ..urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_limits,
    without_shapes,
    without_visuals,
    zero_missing_inertials,
)
from .inertias import exact_axes

UNIT: Mapping[str, object] = {"unit_axes": True}
"""The adapter's setting that normalizes the file's axes."""

UNSCALED: Mapping[str, object] = {"scaled_inertias": False}
"""The adapter's setting that leaves the file's inertias as they are."""

MOVING = ("revolute", "continuous", "prismatic")


SIX_DIGITS = 1e-6
"""Largest excess length of a unit vector whose numbers have six digits."""


def _long(robot: XmlElement) -> Iterator[tuple[XmlElement, XmlElement, list[float], float]]:
    for joint in robot.findall("joint"):
        axis = joint.find("axis")
        if axis is None or joint.get("type") not in MOVING:
            continue
        numbers = finite_numbers(axis.get("xyz", "")) or []
        length = float(np.linalg.norm(numbers))
        if len(numbers) == 3 and length > 0 and abs(length - 1) > ROUNDED:
            yield joint, axis, numbers, length


def long_axes(robot: XmlElement) -> dict[str, float]:
    """Return the excess length of each joint axis that is not a unit vector."""
    return {joint.get("name", ""): length - 1 for joint, _, _, length in _long(robot)}


def unit_axes(robot: XmlElement) -> None:
    """Normalize these axes."""
    for _, axis, numbers, length in _long(robot):
        axis.set("xyz", " ".join(repr(number / length) for number in numbers))


def length_cause(lengths: Mapping[str, float]) -> str:
    """Return the cause that a diagnosis reports."""
    worst = max(lengths.values(), key=abs)
    size = f"up to {abs(worst):.1e} off 1" if abs(worst) < 1e-3 else f"{1 + worst:.3g} instead of 1"
    return f"PyBullet's own length of the axes of {', '.join(lengths)}, {size}"


def scaled_inertias(robot: XmlElement) -> list[XmlElement]:
    """Return each `<inertia_scaling>` that changes an inertia."""
    scales = [link.find("contact/inertia_scaling") for link in robot.findall("link")]
    return [
        scale
        for scale in scales
        if scale is not None and finite_numbers(scale.get("value", "")) not in ([1.0], None)
    ]


def unscaled_inertias(robot: XmlElement) -> None:
    """Set these scales to 1."""
    for scale in scaled_inertias(robot):
        scale.set("value", "1")


def scale_cause(scales: Sequence[XmlElement]) -> str:
    """Return the cause that a diagnosis reports."""
    lines = [f"{scale.get('value', '')}, line {scale.place[1]}" for scale in scales]
    shown = shortened(lines, 3, "; ")
    return f"PyBullet's own scale of inertias, <inertia_scaling> ({shown})"


DISABLED_EFFECTS: Mapping[str, float | bool] = {
    # Linear and angular damping of every link; PyBullet's default is 0.04.
    "link_damping": 0.0,
    # Whether every joint keeps its velocity motor, which brakes it; PyBullet's default is true.
    "motors": False,
    # Whether inertias are the file's, not those of collision shapes; PyBullet's default is false.
    "inertia_from_file": True,
}
"""PyBullet's own effects, disabled."""

DEFAULTS: Mapping[str, float | bool] = {
    **DISABLED_EFFECTS,
    # Whether the adapter, not PyBullet, rotates tensors with products to principal axes, to the
    # last digits.
    "exact_axes": False,
    # Whether joint axes are normalized, which PyBullet omits.
    "unit_axes": False,
    # Whether a link without an inertial has 1 kg and 1 kg m^2 (PyBullet's default), or no mass.
    "bare_links": True,
    # Whether `<inertia_scaling>` multiplies the inertia of its link (PyBullet's default).
    "scaled_inertias": True,
    # Whether contacts and joint limits are left out.
    "smooth": False,
    # Whether the root link moves freely.
    "floating": False,
    # Whether a plane is at z = 0, whose friction and restitution are 1, so that the link's count.
    "floor": False,
    # Speed of that plane's surface along x, m/s: a belt.
    "floor_speed": 0.0,
}
"""Defaults of all settings."""

REWRITTEN: tuple[tuple[str, bool, Change], ...] = (
    ("exact_axes", True, exact_axes),
    ("unit_axes", True, unit_axes),
    ("bare_links", False, zero_missing_inertials),
    ("scaled_inertias", False, unscaled_inertias),
    ("smooth", True, without_shapes),
    ("smooth", True, without_limits),
)
"""Settings that change the file which PyBullet loads: name, value and change."""


def changes_of(spec: ModelSpec) -> list[Change]:
    """Return the changes that settings make to the file."""
    on = {key: spec.settings.get(key, default) for key, default in DEFAULTS.items()}
    changes = [change for key, value, change in REWRITTEN if on[key] == value]
    if not on[
        "inertia_from_file"
    ]:  # collision shapes then define the moments, so keep them and disable contacts instead
        changes = [without_visuals if change is without_shapes else change for change in changes]
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        changes.append(mimics_of(followers))
    return [*changes, with_held(held)] if (held := held_joints(spec)) else changes
