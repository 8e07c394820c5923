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
from reference.system import System

__all__ = [
    "Angle", "Body", "Constant", "Coordinate", "DeclarationError", "Equilibrium", "Input", "Link",
    "Output", "Pose", "PublishedEquation", "Quantity", "Scenario", "System", "t",
]  # fmt: skip
