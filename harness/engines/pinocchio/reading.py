"""A file as Pinocchio reads it: its model and the frames of its bodies."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.installed import STDERR, STDOUT, capture_output
from physics_crosscheck.harness.engines.protocol import Array, UnsupportedError
from physics_crosscheck.harness.engines.source import load_failure, one_line
from physics_crosscheck.harness.engines.tree_model import Weight


def build_urdf(path: Path, file: Path, root: str) -> Any:
    """Build the model of a URDF, its root fixed or on a joint of that name.

    Raises:
        UnsupportedError: with the text that Pinocchio's parser prints.
    """
    import pinocchio as pin

    try:
        with capture_output((STDOUT, STDERR), again=False) as printed:
            if root:
                return pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer(), root)
            return pin.buildModelFromUrdf(str(path))
    except ValueError as error:
        message = one_line(" ".join(printed)) or one_line(error)
        raise load_failure("Pinocchio", file, message, UnsupportedError) from None


GROUND = "world"
"""A fixed body that carries all others; MuJoCo reserves this name for the world."""


def read_mjcf(path: Path, file: Path) -> Any:
    """Build the model of an MJCF.

    Raises:
        UnsupportedError: with the message of Pinocchio's parser.
    """
    import pinocchio as pin

    try:
        with capture_output((STDOUT, STDERR), again=False):
            model = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError, IndexError) as error:
        message = one_line(error).rpartition("message: ")[2]
        raise UnsupportedError(f"{file}: Pinocchio can't load it: {message}") from None
    return model[0] if isinstance(model, tuple) else model


def lift_models(model: Any, weights: Sequence[Weight]) -> list[tuple[float, Any, Any]]:
    """Return models whose generalized gravity is the compensating force: sign, model, data.

    They have the lifted masses only, with negative ones in a separate model.
    """
    import pinocchio as pin

    models = []
    for sign in (1.0, -1.0):
        chosen = [weight for weight in weights if sign * weight.mass > 0]
        if not chosen:
            continue
        lifted = model.copy()
        for i in range(model.njoints):
            lifted.inertias[i] = pin.Inertia.Zero()
        for weight in chosen:
            frame = model.frames[model.getFrameId(weight.body, pin.FrameType.BODY)]
            centre = frame.placement.act(np.array(weight.centre))
            lifted.inertias[frame.parentJoint] += pin.Inertia(
                sign * weight.mass, centre, np.zeros((3, 3))
            )
        models.append((sign, lifted, lifted.createData()))
    return models


def frames(model: Any, kind: str) -> dict[str, tuple[int, Array]]:
    """Return the frame of each place, and the point in it.

    Centres of mass are those of bodies that are not fixed to others: Pinocchio merges these.

    Args:
        model: Pinocchio's.
        kind: the file's word for a body.
    """
    import pinocchio as pin

    body = pin.FrameType.BODY
    bodies = [(i, frame) for i, frame in enumerate(model.frames) if frame.type == body]
    carriers = [frame.parentJoint for _, frame in bodies]
    result = {f"{kind}:{frame.name}": (i, np.zeros(3)) for i, frame in bodies}
    for i, frame in bodies:
        if frame.parentJoint and carriers.count(frame.parentJoint) == 1:
            inertia = model.inertias[frame.parentJoint]
            result[f"centre:{frame.name}"] = i, frame.placement.actInv(inertia.lever)
    return result
