"""The built-in adapters, and those that other distributions register."""

from __future__ import annotations

import sys
import warnings
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points

from physics_crosscheck.harness.engines.dart import DartEngine
from physics_crosscheck.harness.engines.drake import DrakeEngine
from physics_crosscheck.harness.engines.idyntree import IdyntreeEngine
from physics_crosscheck.harness.engines.installed import python_path
from physics_crosscheck.harness.engines.mujoco import MjxEngine, MujocoEngine
from physics_crosscheck.harness.engines.newton import NewtonEngine
from physics_crosscheck.harness.engines.pinocchio import PinocchioEngine
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.pybullet import PybulletEngine
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.engines.sapien import SapienEngine

BUILT_IN = (
    *(MujocoEngine, PybulletEngine, PymunkEngine),
    *(PinocchioEngine, DrakeEngine, DartEngine, NewtonEngine, MjxEngine),
    *(IdyntreeEngine, SapienEngine),
)


def engines() -> dict[str, Engine]:
    """Return every known adapter by name; an entry point may not take a built-in name.

    One that can't be loaded is left out with a warning: the others still run.
    """
    known: dict[str, Engine] = {kind.name: kind() for kind in BUILT_IN}
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
        known.setdefault(engine.name, engine)
    able = {suffix: one for one in reversed(known.values()) for suffix in one.compiles}
    for one in known.values():
        one.compilers = able
    return known


@lru_cache(maxsize=8)
def _points(*_: object) -> tuple[EntryPoint, ...]:
    """What registers adapters; every distribution is asked, which takes longer than to load one."""
    return tuple(entry_points(group="crosscheck.engines"))


def installs(engine: Engine) -> str:
    """The command that installs an engine."""
    if not isinstance(engine, BUILT_IN):
        return f"pip install {distribution(engine)}"
    return f"pip install 'physics-crosscheck[{engine.extra or 'engines'}]'"


def distribution(engine: Engine) -> str:
    """What a package index calls an engine."""
    return engine.distribution or engine.name


def missing(engine: Engine) -> str:
    """What installs an engine that is not there."""
    return f"{engine.name}: not installed; {installs(engine)}"


def absent_extras() -> dict[str, str]:
    """Engines of extras that are not installed, each with what installs it.

    What names them beside others runs without them: nobody need install them all.
    """
    return {
        name: missing(engine)
        for name, engine in engines().items()
        if engine.extra and engine.version() is None
    }


def runners(suffix: str) -> tuple[Engine, ...]:
    """The readers of a format that a file alone is run in: the standing ones, and extras there.

    Without those that run it on request only. Where none is there, all: it is told of each.
    """
    absent = absent_extras()
    known = tuple(engine for engine in readers(suffix) if not engine.on_request)
    return tuple(engine for engine in known if engine.name not in absent) or known


def standing(suffix: str) -> tuple[Engine, ...]:
    """The readers of a format that everybody installs, for a new sidecar; all where there is none.

    Without those that run it on request only.
    """
    known = tuple(engine for engine in readers(suffix) if not engine.on_request)
    return tuple(engine for engine in known if not engine.extra) or known


def readers(suffix: str) -> tuple[Engine, ...]:
    """The engines that read a format, first those that are preferred for it."""
    found = [engine for engine in engines().values() if suffix in engine.formats]
    return tuple(sorted(found, key=lambda engine: suffix not in engine.preferred))


def model_formats() -> frozenset[str]:
    """Endings by which a file is known for a model; a Python file may be anything."""
    return frozenset(s for engine in engines().values() for s in engine.formats) - {".py"}
