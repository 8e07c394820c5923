"""Hold physics models against their equations, to nine digits, in every engine that runs them.

This is the one name to import from: in a `system.py`, in tests, in notebooks.

    from physics_crosscheck import Constant, Coordinate, Scenario, System
    from physics_crosscheck import check, compare, reference, simulate

`physics_crosscheck.records` has the types of what comes out, `physics_crosscheck.engine` what an
adapter of another engine is made of.

Importing this module binds the names `harness` and `reference`, in this process, to the packages
that lie beside it, whatever the working folder, PYTHONPATH or pytest put before them: others use
these names too. They are imported when something of theirs is asked for.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

OWN = ("harness", "reference")
BESIDE = Path(__file__).resolve().parents[1]


class _Own(MetaPathFinder):
    """Finds this distribution's packages where they are."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name not in OWN:
            return None
        return importlib.machinery.PathFinder.find_spec(name, [str(BESIDE)])


def claim() -> None:
    """Bind the names; what a worker process does first.

    Raises:
        ImportError: where a package of one of these names, not ours, is imported already.
    """
    for name in OWN:
        loaded = sys.modules.get(name)
        if loaded is not None and not _ours(getattr(loaded, "__file__", None), name):
            raise ImportError(
                f"a package {name!r} that is not physics-crosscheck's is imported already, from"
                f" {getattr(loaded, '__file__', None) or 'somewhere'}; a process can have one of"
                " that name: run `crosscheck` in one of its own"
            )
    if not any(isinstance(finder, _Own) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Own())


def _ours(file: str | None, name: str) -> bool:
    return file is not None and Path(file).resolve().parent == BESIDE / name


claim()

if TYPE_CHECKING:
    from harness.api import Results, check
    from harness.compare.candidate import CompareError
    from harness.notebook.ask import reference, simulate
    from harness.notebook.comparison import Comparison, compare
    from harness.notebook.trajectory import MotionError, Trajectory
    from reference import (
        Angle,
        Body,
        Constant,
        Coordinate,
        Cord,
        Coupling,
        DeclarationError,
        Equilibrium,
        FrameForce,
        Input,
        Joint,
        JointForce,
        Link,
        Medium,
        MultibodySystem,
        Output,
        Pose,
        PublishedEquation,
        Pull,
        Quantity,
        RigidBody,
        Scenario,
        Site,
        System,
        t,
    )
    from reference.kinematics import Frame, ground, rotation

_FROM = {
    "harness.api": ("Results", "check"),
    "harness.compare.candidate": ("CompareError",),
    "harness.notebook.ask": ("reference", "simulate"),
    "harness.notebook.comparison": ("Comparison", "compare"),
    "harness.notebook.trajectory": ("MotionError", "Trajectory"),
    "reference": (
        "Angle", "Body", "Constant", "Coordinate", "Cord", "Coupling", "DeclarationError",
        "Equilibrium", "FrameForce", "Input", "Joint", "JointForce", "Link", "Medium",
        "MultibodySystem", "Output", "Pose", "PublishedEquation", "Pull", "Quantity", "RigidBody",
        "Scenario", "Site", "System", "t",
    ),
    "reference.kinematics": ("Frame", "ground", "rotation"),
}  # fmt: skip

__all__ = [
    "Angle", "Body", "CompareError", "Comparison", "Constant", "Coordinate", "Cord", "Coupling",
    "DeclarationError", "Equilibrium", "Frame", "FrameForce", "Input", "Joint", "JointForce",
    "Link", "Medium", "MotionError", "MultibodySystem", "Output", "Pose", "PublishedEquation",
    "Pull", "Quantity", "Results", "RigidBody", "Scenario", "Site", "System", "Trajectory",
    "check", "compare", "ground", "reference", "rotation", "simulate", "t",
]  # fmt: skip


def __getattr__(name: str) -> object:
    # Not before it is asked for: a declaration needs sympy, and no engine; help texts neither.
    for module, names in _FROM.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
