"""Reference equations: declared, derived, linearized and solved; no engine is known here."""

from reference.sketch import Angle, Body, Link
from reference.system import (
    Constant,
    Coordinate,
    DeclarationError,
    Equilibrium,
    Input,
    Output,
    PublishedEquation,
    Scenario,
    System,
    t,
)

__all__ = [
    "Angle", "Body", "Constant", "Coordinate", "DeclarationError", "Equilibrium", "Input", "Link",
    "Output", "PublishedEquation", "Scenario", "System", "t",
]  # fmt: skip
