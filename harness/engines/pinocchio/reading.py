"""A file as Pinocchio reads it: its model, and where its bodies are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.captured import STDERR, STDOUT, captured
from physics_crosscheck.harness.engines.protocol import Array, UnsupportedError
from physics_crosscheck.harness.engines.source import folded
from physics_crosscheck.harness.engines.tree_model import Weight


def built(path: Path, file: Path, root: str) -> Any:
    """The model of a URDF, its root fixed or on a joint of that name.

    Raises:
        UnsupportedError: with what Pinocchio's parser prints.
    """
    import pinocchio as pin

    try:
        with captured((STDOUT, STDERR), again=False) as said:
            if root:
                return pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer(), root)
            return pin.buildModelFromUrdf(str(path))
    except ValueError as error:
        told = folded(" ".join(said)) or folded(error)
        raise UnsupportedError(f"{file}: Pinocchio can't load it: {told}") from None


GROUND = "world"
"""A body that stands still and carries all others; MuJoCo keeps this name for the world."""


def read_mjcf(path: Path, file: Path) -> Any:
    """The model of an MJCF.

    Raises:
        UnsupportedError: with what Pinocchio's parser says.
    """
    import pinocchio as pin

    try:
        with captured((STDOUT, STDERR), again=False):
            found = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError, IndexError) as error:
        told = folded(error).rpartition("message: ")[2]
        raise UnsupportedError(f"{file}: Pinocchio can't load it: {told}") from None
    return found[0] if isinstance(found, tuple) else found


def lifting(model: Any, weights: Sequence[Weight]) -> list[tuple[float, Any, Any]]:
    """Return models of which the generalized gravity is what lifts bodies: sign, model, data.

    They have the lifted masses alone, those that weigh more apart.
    """
    import pinocchio as pin

    found = []
    for sign in (1.0, -1.0):
        chosen = [one for one in weights if sign * one.mass > 0]
        if not chosen:
            continue
        alone = model.copy()
        for i in range(model.njoints):
            alone.inertias[i] = pin.Inertia.Zero()
        for one in chosen:
            frame = model.frames[model.getFrameId(one.body, pin.FrameType.BODY)]
            at = frame.placement.act(np.array(one.centre))
            alone.inertias[frame.parentJoint] += pin.Inertia(sign * one.mass, at, np.zeros((3, 3)))
        found.append((sign, alone, alone.createData()))
    return found


def frames(model: Any, kind: str) -> dict[str, tuple[int, Array]]:
    """The frame of each place, and where in it.

    Of centres of mass those of bodies with which no other moves as one: others are lumped.

    Args:
        model: Pinocchio's.
        kind: what a body is called in the file.
    """
    import pinocchio as pin

    body = pin.FrameType.BODY
    bodies = [(i, one) for i, one in enumerate(model.frames) if one.type == body]
    carriers = [one.parentJoint for _, one in bodies]
    found = {f"{kind}:{one.name}": (i, np.zeros(3)) for i, one in bodies}
    for i, one in bodies:
        if one.parentJoint and carriers.count(one.parentJoint) == 1:
            inertia = model.inertias[one.parentJoint]
            found[f"centre:{one.name}"] = i, one.placement.actInv(inertia.lever)
    return found
