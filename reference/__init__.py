"""Reference equations: declared, derived, linearized and solved; no engine is known here."""

from physics_crosscheck.reference.declaration import (
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
from physics_crosscheck.reference.pose import Pose
from physics_crosscheck.reference.sketch import Angle, Body, Link
from physics_crosscheck.reference.multibody.bodies import Coupling, Joint, Pull, RigidBody, Site
from physics_crosscheck.reference.multibody.tree import Medium
from physics_crosscheck.reference.multibody.ways import Cord, FrameForce, JointForce
from physics_crosscheck.reference.system import System
from physics_crosscheck.reference.trees import MultibodySystem

__all__ = [
    "Angle", "Body", "Constant", "Coordinate", "Cord", "Coupling", "DeclarationError",
    "Equilibrium", "FrameForce", "Input", "Joint", "JointForce", "Link", "Medium",
    "MultibodySystem", "Output", "Pose", "PublishedEquation", "Pull", "Quantity", "RigidBody",
    "Scenario", "Site", "System", "t",
]  # fmt: skip
