"""The built-in adapters, and those that other distributions register."""

from __future__ import annotations

from importlib.metadata import entry_points

from harness.engine import Engine
from harness.engines.mujoco import MujocoEngine
from harness.engines.pybullet import PybulletEngine
from harness.engines.pymunk import PymunkEngine


def engines() -> dict[str, Engine]:
    """Return every known adapter by name; an entry point may not take a built-in name."""
    known: dict[str, Engine] = {
        engine.name: engine for engine in (MujocoEngine(), PybulletEngine(), PymunkEngine())
    }
    for point in entry_points(group="crosscheck.engines"):
        engine: Engine = point.load()()
        known.setdefault(engine.name, engine)
    return known
