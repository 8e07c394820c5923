"""A declared system, checked on construction.

Missing, unknown, dimensionally inconsistent or non-differentiable entries are rejected with a
sentence that names them.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from .declaration import Declaration, Scenario
from .frames import check_frames
from .interactions import Interaction, check_interactions
from .validation import check


@dataclass(frozen=True, kw_only=True)
class System(Declaration):
    """A mechanism: the complete data of its equations of motion.

    Attributes:
        interactions: forces that switch: contacts, joint limits, dry friction, buffers, drives.

    Raises:
        DeclarationError: with one sentence that names the missing or wrong entry.
    """

    interactions: tuple[Interaction, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self, equilibria=not self.interactions)
        check_frames(self)
        check_interactions(self, self.interactions)

    def forces(self) -> tuple[sp.Expr, ...]:
        """Return the generalized forces Q of the inputs, one per coordinate."""
        return tuple(
            sp.Add(*(sp.sympify(i.on.get(c, 0)) * i.symbol for i in self.inputs))
            for c in self.coordinates
        )

    def scenario(self, name: str) -> Scenario:
        """Return the scenario of that name; raise KeyError with the known names otherwise."""
        for scenario in self.scenarios:
            if scenario.name == name:
                return scenario
        names = ", ".join(s.name for s in self.scenarios)
        raise KeyError(f"{self.name} has no scenario {name!r}; it has {names}")
