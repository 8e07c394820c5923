"""The built-in adapters, and those that other distributions register."""

import sys
import warnings
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points

from .dart import DartEngine
from .drake import DrakeEngine
from .idyntree import IdyntreeEngine
from .installed import python_path
from .mujoco import MjxEngine, MujocoEngine
from .newton import NewtonEngine
from .physx import PhysxEngine
from .pinocchio import PinocchioEngine
from .protocol import Engine
from .pybullet import PybulletEngine
from .pymunk import PymunkEngine
from .sapien import SapienEngine

BUILT_IN = (
    *(MujocoEngine, PybulletEngine, PymunkEngine),
    *(PinocchioEngine, DrakeEngine, DartEngine, NewtonEngine, MjxEngine),
    *(IdyntreeEngine, SapienEngine, PhysxEngine),
)


def engines() -> dict[str, Engine]:
    """Return every available adapter by name; an entry point may not use a built-in name.

    An adapter that can't be loaded is left out with a warning: the others still run.
    """
    by_name: dict[str, Engine] = {kind.name: kind() for kind in BUILT_IN}
    for point in _points(python_path(), tuple(map(id, sys.meta_path))):
        try:
            engine: Engine = point.load()()
            if not isinstance(engine, Engine):
                raise TypeError("it is not a subclass of harness.engines.protocol.Engine")
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            warnings.warn(
                f"the engine {point.name!r} of {point.value} can't be loaded: {error}", stacklevel=2
            )
            continue
        by_name.setdefault(engine.name, engine)
    able = {
        suffix: adapter for adapter in reversed(by_name.values()) for suffix in adapter.compiles
    }
    for adapter in by_name.values():
        adapter.compilers = able
    return by_name


@lru_cache(maxsize=8)
def _points(*_: object) -> tuple[EntryPoint, ...]:
    """Return the entry points of adapters; scanning all distributions takes longer than loading
    one.
    """
    return tuple(entry_points(group="crosscheck.engines"))


def install_command(engine: Engine) -> str:
    """Return the command that installs an engine."""
    if not isinstance(engine, BUILT_IN):
        return f"pip install {distribution(engine)}"
    return f"pip install 'physics-crosscheck[{engine.extra or 'engines'}]'"


def distribution(engine: Engine) -> str:
    """Return an engine's name in a package index."""
    return engine.distribution or engine.name


def missing(engine: Engine) -> str:
    """Return the message for a missing engine, with the command that installs it."""
    return f"{engine.name}: not installed; {install_command(engine)}"


def absent_extras() -> dict[str, str]:
    """Return engines of extras that are not installed, each with the message for it.

    Files that name them and other engines run without them: no user needs all extras.
    """
    return {
        name: missing(engine)
        for name, engine in engines().items()
        if engine.extra and engine.version() is None
    }


def engines_to_run(suffix: str) -> tuple[Engine, ...]:
    """Return the engines that run a file of this format: the default ones, and installed extras.

    Engines that run only on request are left out. If no engine is installed, return all, so that
    each is reported.
    """
    absent = absent_extras()
    candidates = tuple(engine for engine in engines_reading(suffix) if not engine.on_request)
    return tuple(engine for engine in candidates if engine.name not in absent) or candidates


def default_engines(suffix: str) -> tuple[Engine, ...]:
    """Return the default engines of a format, for a new sidecar; all without one.

    Engines that run only on request are left out.
    """
    candidates = tuple(engine for engine in engines_reading(suffix) if not engine.on_request)
    return tuple(engine for engine in candidates if not engine.extra) or candidates


def engines_reading(suffix: str) -> tuple[Engine, ...]:
    """Return the engines that read a format, starting with those that prefer it."""
    result = [engine for engine in engines().values() if suffix in engine.formats]
    return tuple(sorted(result, key=lambda engine: suffix not in engine.preferred))


def model_formats() -> frozenset[str]:
    """Return the suffixes that identify a model file; a Python file may be anything."""
    return frozenset(s for engine in engines().values() for s in engine.formats) - {".py"}
