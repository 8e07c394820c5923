"""Reference equations: declared, derived, linearized and solved, independently of any engine."""

from physics_crosscheck.reference.mechanism.declaration import (
    Constant,
    Coordinate,
    DeclarationError,
    Equilibrium,
    Input,
    Output,
    PublishedEquation,
    Quantity,
    Scenario,
    t,
)
from physics_crosscheck.reference.mechanism.pose import Pose
from physics_crosscheck.reference.mechanism.bodies import (
    Coupling,
    Joint,
    ForceElement,
    RigidBody,
    Site,
)
from physics_crosscheck.reference.mechanism.tree import Fluid
from physics_crosscheck.reference.mechanism.force_paths import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem

__all__ = [
    "CablePath",
    "Constant",
    "Coordinate",
    "Coupling",
    "DeclarationError",
    "Equilibrium",
    "Fluid",
    "ForceElement",
    "FrameForce",
    "Input",
    "Joint",
    "JointForce",
    "MultibodySystem",
    "Output",
    "Pose",
    "PublishedEquation",
    "Quantity",
    "RigidBody",
    "Scenario",
    "Site",
    "System",
    "t",
]  # fmt: skip
