"""Reference equations: declared, derived, linearized and solved; no engine is known here."""

from reference.system import (
    Constant, Coordinate, DeclarationError, Equilibrium, Input, Output, Printed, Scenario, System,
    t,
)  # fmt: skip

__all__ = [
    "Constant", "Coordinate", "DeclarationError", "Equilibrium", "Input", "Output", "Printed",
    "Scenario", "System", "t",
]  # fmt: skip
