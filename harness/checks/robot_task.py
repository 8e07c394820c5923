"""A robot's file in one engine: what is to be run, and which of the equations' its joints are."""

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
    """An engine would not load a robot's file."""


@dataclass(frozen=True, kw_only=True)
class RobotTask:
    """A robot's file in one engine.

    Attributes:
        file: the model file.
        folder: whose case it is: the system's, or the file itself where it is given alone.
        robot: its name.
        scenario: what its states are called.
        engine: that runs it.
        names: of the coordinates, in the samples' order.
        followers: what follows them.
        tree: whose equations they are.
        samples: states, and where the equations take them.
        settings: with which the engine runs it.
        resolution: that is asked.
        springs: of its sidecar.
        motion: from rest; why it can't be solved; None if none is wanted.
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
    """The file as its engine loads it.

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
    """The states as the engine's coordinates have them, those maps, and the names of the states.

    Raises:
        EngineError: where they are not the same joints.
    """
    order, n = order_of(task, model), len(task.names)
    if len(order) > n:
        return task.samples, task.followers.map(order, task.names), task.names
    own = tuple(model.coordinates)
    return task.samples.ordered(order), replace(identity(n), push_matrix=np.eye(n)), own


def order_of(task: RobotTask, model: Model) -> list[int]:
    """Which of the equations' coordinates each of the engine's is.

    Raises:
        EngineError: naming those that only one of them has.
    """
    return joints_of(task.followers, model, task.file, task.engine)


def joints_of(followers: Followers, model: Model, file: Path, engine: str) -> list[int]:
    """Which of a tree's coordinates each of the engine's is.

    Raises:
        EngineError: naming those that only one of them has.
    """
    here, there = set(followers.names), set(model.coordinates)
    if here != there or len(there) != len(model.coordinates):
        missing, more = sorted(here - there), sorted(there - here)
        parts = [f"it has no {', '.join(missing)}"] if missing else []
        parts += [f"it has the additional {', '.join(more)}"] if more else []
        told = " and ".join(parts) or "two of its joints have the same name"
        raise EngineError(f"{file}: {engine} builds different joints from it: {told}")
    return [followers.names.index(name) for name in model.coordinates]
