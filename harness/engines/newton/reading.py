"""A file as Newton parses it: one world, with notes for remarks."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..protocol import Array, Spring
from ..source import one_line
from .layout import Layout


@dataclass(frozen=True, kw_only=True)
class ParsedModel:
    """A file in Newton.

    Attributes:
        builder: Newton's `ModelBuilder`, of one world.
        layout: of its coordinates.
        springs: added by the adapter.
        lost: elements that Newton's solver leaves out under the settings: cause -> correction.
        notes: remarks: sentence -> address.
        corrected: moving bodies whose inertias Newton has changed.
        messages: warnings of Newton.
    """

    builder: Any
    layout: Layout
    springs: tuple[Spring, ...]
    lost: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    corrected: Sequence[str] = ()
    messages: Sequence[str] = ()


def new_builder(gravity: Sequence[float]) -> Any:
    """Return an empty world, with Warp's compilation messages on stdout disabled."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    import newton

    return newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=tuple(gravity))


@contextmanager
def collect_warnings(messages: list[str]) -> Iterator[None]:
    """Collect warnings in this block instead of printing them."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    messages += [one_line(one.message) for one in caught]


def without_limit_forces(builder: Any) -> None:
    """Remove joint limits: their springs and dampers, and that drives do not act beyond them."""
    values = {"ke": 0.0, "kd": 0.0, "lower": -UNLIMITED, "upper": UNLIMITED}
    for name, value in values.items():
        setattr(builder, f"joint_limit_{name}", [value] * len(builder.joint_limit_ke))


def limits_of(read: ParsedModel) -> Array:
    """Return the positions between which no limit acts, (nz, 2)."""
    builder, layout = read.builder, read.layout
    result = np.tile([-np.inf, np.inf], (len(layout.names), 1))
    acts = np.array(builder.joint_limit_ke)[layout.singles] > 0
    bounds = np.stack([builder.joint_limit_lower, builder.joint_limit_upper], axis=1)
    indices = layout.singles[acts]
    result[indices] = bounds[indices] + layout.refs[indices, None]
    result[abs(result) > UNLIMITED] = np.inf * np.sign(result[abs(result) > UNLIMITED])
    return result


UNLIMITED = 1e9
"""Newton stores 1e10 for a missing limit."""


COLLAPSED = "Newton's collapse_fixed_joints, which shifts welded bodies' inertias wrongly"


def collapse(builder: Any, wanted: bool) -> dict[str, Mapping[str, object]]:
    """Merge welded bodies with Newton's own function if the settings request it.

    Newton 1.8.0 does not shift moments of inertia from the parent's origin: two bodies of 1 kg that
    are 1 m apart get 1 kg m^2 instead of 0.5.

    Returns:
        The cause of the resulting error, with the setting that corrects it.
    """
    count = len(builder.joint_type)
    if wanted:
        builder.collapse_fixed_joints()
    several = len(builder.joint_type) < count
    return {COLLAPSED: {"collapse_fixed_joints": False}} if several else {}


def correct_inertias(builder: Any, messages: list[str]) -> list[str]:
    """Let Newton change masses and moments as it does when it finalizes a model.

    Returns:
        Names of the moving bodies that it changes.
    """
    import newton

    with collect_warnings(messages):
        model = builder.finalize(device="cpu")
    pairs = (
        (builder.body_mass, model.body_mass.numpy()),
        (builder.body_inertia, model.body_inertia.numpy()),
    )
    changed = set()
    for values, result in pairs:
        for i, value in enumerate(result):
            if np.any(value != np.array(values[i], dtype=np.float32).reshape(value.shape)):
                changed.add(i)
                values[i] = type(values[i])(value)
    still = {-1}
    rows = zip(builder.joint_type, builder.joint_parent, builder.joint_child, strict=True)
    for kind, parent, child in rows:
        if kind == newton.JointType.FIXED and parent in still:
            still.add(child)
    labels = enumerate(builder.body_label)
    return [name.rpartition("/")[2] for i, name in labels if i in changed - still]
