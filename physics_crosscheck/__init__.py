"""Compare physics models with their equations, to nine digits, in every engine that runs them.

This is the one name to import from: in a `system.py`, in tests, in notebooks.

    from physics_crosscheck import Constant, Coordinate, Scenario, System
    from physics_crosscheck import check, compare, load, simulate, solve

`physics_crosscheck.records` has the types of results, `physics_crosscheck.engine` what an
adapter of another engine is made of.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from physics_crosscheck.harness import __version__ as __version__

if TYPE_CHECKING:
    from physics_crosscheck.harness.commands.compare.candidate import CompareError
    from physics_crosscheck.harness.interfaces.api import CheckResults, check
    from physics_crosscheck.harness.interfaces.notebook.ask import simulate, solve
    from physics_crosscheck.harness.interfaces.notebook.comparison import Comparison, compare
    from physics_crosscheck.harness.interfaces.notebook.robot import RobotJoint, RobotModel, load
    from physics_crosscheck.harness.interfaces.notebook.trajectory import MotionError, Trajectory
    from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
    from physics_crosscheck.reference.mechanism.bodies import (
        Coupling,
        ForceElement,
        Joint,
        RigidBody,
        Site,
    )
    from physics_crosscheck.reference.mechanism.declaration import (
        Constant,
        Coordinate,
        DeclarationError,
        Equilibrium,
        Input,
        Output,
        Pose,
        PublishedEquation,
        Quantity,
        Scenario,
        t,
    )
    from physics_crosscheck.reference.mechanism.interactions import (
        Buffer,
        Contact,
        Drive,
        DryFriction,
        Limit,
    )
    from physics_crosscheck.reference.mechanism.kinematics import Frame, ground, rotation
    from physics_crosscheck.reference.mechanism.system import System
    from physics_crosscheck.reference.mechanism.tree import CablePath, Fluid, FrameForce, JointForce

_FROM = {
    "physics_crosscheck.harness.interfaces.api": ("CheckResults", "check"),
    "physics_crosscheck.harness.commands.compare.candidate": ("CompareError",),
    "physics_crosscheck.harness.interfaces.notebook.ask": ("simulate", "solve"),
    "physics_crosscheck.harness.interfaces.notebook.comparison": ("Comparison", "compare"),
    "physics_crosscheck.harness.interfaces.notebook.robot": ("RobotJoint", "RobotModel", "load"),
    "physics_crosscheck.harness.interfaces.notebook.trajectory": ("MotionError", "Trajectory"),
    "physics_crosscheck.reference.mechanism.bodies": (
        "Coupling", "ForceElement", "Joint", "RigidBody", "Site",
    ),
    "physics_crosscheck.reference.mechanism.declaration": (
        "Constant", "Coordinate", "DeclarationError", "Equilibrium", "Input", "Output",
        "Pose", "PublishedEquation", "Quantity", "Scenario", "t",
    ),
    "physics_crosscheck.reference.mechanism.interactions": (
        "Buffer", "DryFriction", "Limit", "Contact", "Drive",
    ),
    "physics_crosscheck.reference.mechanism.assemble": ("MultibodySystem",),
    "physics_crosscheck.reference.mechanism.system": ("System",),
    "physics_crosscheck.reference.mechanism.tree": (
        "CablePath", "Fluid", "FrameForce", "JointForce",
    ),
    "physics_crosscheck.reference.mechanism.kinematics": ("Frame", "ground", "rotation"),
}  # fmt: skip

__all__ = [
    "Buffer",
    "CablePath",
    "CheckResults",
    "CompareError",
    "Comparison",
    "Constant",
    "Contact",
    "Coordinate",
    "Coupling",
    "DeclarationError",
    "Drive",
    "DryFriction",
    "Equilibrium",
    "Fluid",
    "ForceElement",
    "Frame",
    "FrameForce",
    "Input",
    "Joint",
    "JointForce",
    "Limit",
    "MotionError",
    "MultibodySystem",
    "Output",
    "Pose",
    "PublishedEquation",
    "Quantity",
    "RigidBody",
    "RobotJoint",
    "RobotModel",
    "Scenario",
    "Site",
    "System",
    "Trajectory",
    "check",
    "compare",
    "ground",
    "load",
    "rotation",
    "simulate",
    "solve",
    "t",
]  # fmt: skip


def __getattr__(name: str) -> object:
    # Not before it is asked for: a declaration needs sympy, and no engine; help texts neither.
    for module, names in _FROM.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
