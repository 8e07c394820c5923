"""What Newton makes of a file: one world, and what is to be known of it beside."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.newton.layout import Layout
from physics_crosscheck.harness.engines.protocol import Array, Spring
from physics_crosscheck.harness.engines.source import folded


@dataclass(frozen=True, kw_only=True)
class Read:
    """A file in Newton.

    Attributes:
        builder: Newton's `ModelBuilder`, of one world.
        layout: of its coordinates.
        springs: that are added to it here.
        lost: what Newton's own solver leaves out and the settings let: cause -> what undoes it.
        told: what is to be said of it: sentence -> address.
        corrected: moving bodies whose inertias Newton has changed.
        said: what Newton has warned of.
    """

    builder: Any
    layout: Layout
    springs: tuple[Spring, ...]
    lost: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    told: Mapping[str, str] = field(default_factory=dict)
    corrected: Sequence[str] = ()
    said: Sequence[str] = ()


def new_builder(gravity: Sequence[float]) -> Any:
    """An empty world. Warp prints what it compiles, on stdout, unless told not to."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    import newton

    return newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=tuple(gravity))


@contextmanager
def heard(said: list[str]) -> Iterator[None]:
    """What is warned of meanwhile is kept, and not printed."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    said += [folded(one.message) for one in found]


def without_stops(builder: Any) -> None:
    """Let limits hold nothing: they are springs and dampers."""
    for name in ("joint_limit_ke", "joint_limit_kd"):
        setattr(builder, name, [0.0] * len(getattr(builder, name)))


def limits_of(read: Read) -> Array:
    """Between which positions no limit pulls, (nz, 2)."""
    builder, layout = read.builder, read.layout
    found = np.tile([-np.inf, np.inf], (len(layout.names), 1))
    acts = np.array(builder.joint_limit_ke)[layout.singles] > 0
    bounds = np.stack([builder.joint_limit_lower, builder.joint_limit_upper], axis=1)
    own = layout.singles[acts]
    found[own] = bounds[own] + layout.refs[own, None]
    found[abs(found) > UNLIMITED] = np.inf * np.sign(found[abs(found) > UNLIMITED])
    return found


UNLIMITED = 1e9
"""Newton's own limit where there is none is 1e10."""


COLLAPSED = "Newton's collapse_fixed_joints, which shifts welded bodies' inertias wrongly"


def collapse(builder: Any, wanted: bool) -> dict[str, Mapping[str, object]]:
    """Make one body of those that are welded, as Newton does it where it is asked to.

    It takes moments about the parent's origin and leaves them there (1.8.0): two bodies of 1 kg
    that are 1 m apart get 1 kg m^2 for 0.5.

    Returns:
        Of what its doing so is the cause, with what undoes it.
    """
    count = len(builder.joint_type)
    if wanted:
        builder.collapse_fixed_joints()
    several = len(builder.joint_type) < count
    return {COLLAPSED: {"collapse_fixed_joints": False}} if several else {}


def correct_inertias(builder: Any, said: list[str]) -> list[str]:
    """Let Newton change masses and moments as it does where it finishes a model.

    Returns:
        Names of the moving bodies of which it does.
    """
    import newton

    with heard(said):
        model = builder.finalize(device="cpu")
    pairs = (
        (builder.body_mass, model.body_mass.numpy()),
        (builder.body_inertia, model.body_inertia.numpy()),
    )
    changed = set()
    for own, made in pairs:
        for i, value in enumerate(made):
            if np.any(value != np.array(own[i], dtype=np.float32).reshape(value.shape)):
                changed.add(i)
                own[i] = type(own[i])(value)
    still = {-1}
    rows = zip(builder.joint_type, builder.joint_parent, builder.joint_child, strict=True)
    for kind, parent, child in rows:
        if kind == newton.JointType.FIXED and parent in still:
            still.add(child)
    labels = enumerate(builder.body_label)
    return [name.rpartition("/")[2] for i, name in labels if i in changed - still]
