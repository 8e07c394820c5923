"""Tasks for a robot file in one engine, and the mapping of its joints to the equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.engines.protocol import EngineError, Model, ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, identity
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.samples import Samples


class RefusedError(EngineError):
    """An engine that refuses to load a robot file."""


@dataclass(frozen=True, kw_only=True)
class RobotTask:
    """The task of a robot file in one engine.

    Attributes:
        file: the model file.
        folder: the system folder, or the file itself if it is standalone.
        robot: name of the robot.
        scenario: name of its states.
        engine: name of the engine.
        names: names of the coordinates, in the samples' order.
        followers: map to the joints of an engine.
        tree: the tree of the equations.
        samples: states, and the states that the equations reach from them.
        settings: settings of the engine.
        resolution: relative discrepancy to resolve.
        springs: springs of its sidecar.
        motion: the motion from rest, or why it cannot be solved; None if none was requested.
    """

    file: Path
    folder: str
    robot: str
    scenario: str
    engine: str
    names: tuple[str, ...]
    followers: Followers
    tree: Tree
    samples: Samples
    settings: Mapping[str, object]
    resolution: float
    springs: tuple[Spring, ...] = ()
    motion: Motion | str | None = None


def load_robot(task: RobotTask) -> Model:
    """Load the file in its engine.

    Raises:
        RefusedError: naming file, place and remedy.
    """
    spec = ModelSpec(path=task.file, settings=task.settings, springs=task.springs)
    try:
        return engines()[task.engine].load(spec)
    except EngineError as error:
        refused = RefusedError(error.sentence, file=error.file, line=error.line)
        refused.kind = error.kind
        raise refused from error


def placed(task: RobotTask, model: Model) -> tuple[Samples, CoordinateMap, tuple[str, ...]]:
    """Return the states in the engine's coordinates, the coordinate map and the names of the
    states.

    Raises:
        EngineError: if the joints differ.
    """
    order, n = order_of(task, model), len(task.names)
    if len(order) > n:
        return task.samples, task.followers.map(order, task.names), task.names
    engine_names = tuple(model.coordinates)
    return task.samples.ordered(order), replace(identity(n), push_matrix=np.eye(n)), engine_names


def order_of(task: RobotTask, model: Model) -> list[int]:
    """Return the index of the equations' coordinate for each of the engine's coordinates.

    Raises:
        EngineError: naming the joints that only one side has.
    """
    return joints_of(task.followers, model, task.file, task.engine)


def joints_of(followers: Followers, model: Model, file: Path, engine: str) -> list[int]:
    """Return the index of the tree's coordinate for each of the engine's coordinates.

    Raises:
        EngineError: naming the joints that only one side has.
    """
    here, there = set(followers.names), set(model.coordinates)
    if here != there or len(there) != len(model.coordinates):
        missing, more = sorted(here - there), sorted(there - here)
        parts = [f"it has no {', '.join(missing)}"] if missing else []
        parts += [f"it has the additional {', '.join(more)}"] if more else []
        differences = " and ".join(parts) or "two of its joints have the same name"
        raise EngineError(f"{file}: {engine} builds different joints from it: {differences}")
    return [followers.names.index(name) for name in model.coordinates]
