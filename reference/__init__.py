"""Reference equations: declared, derived, linearized and solved; no engine is known here."""

from reference.declaration import (
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
from reference.pose import Pose
from reference.sketch import Angle, Body, Link
from reference.multibody.bodies import Coupling, Joint, Pull, RigidBody, Site
from reference.multibody.tree import Medium
from reference.multibody.ways import Cord, FrameForce, JointForce
from reference.system import System
from reference.trees import MultibodySystem

__all__ = [
    "Angle", "Body", "Constant", "Coordinate", "Cord", "Coupling", "DeclarationError",
    "Equilibrium", "FrameForce", "Input", "Joint", "JointForce", "Link", "Medium",
    "MultibodySystem", "Output", "Pose", "PublishedEquation", "Pull", "Quantity", "RigidBody",
    "Scenario", "Site", "System", "t",
]  # fmt: skip
