"""By what rule an engine's very next state follows from the forces on its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class StepRule:
    """M(q) a = f(q, v), stepped as the engine documents it.

    Of a ball or free joint, velocities are angular, about the axes of what it turns, and those of
    its origin along the axes of what carries it; a step turns it on about one axis.

    Attributes:
        scheme: v' = v + h a, then q' = q + h v'; or the classical rule of order four, of which
            forces are those at each stage.
        damping: D, (nz, nz), N s/m or N m s/rad, of what is taken at the step's end:
            (M + h D) a = f. None: all forces are those at its start.
        by_velocity: D is -df/dv of all forces instead.
        besides: what else acts in a step and goes to nothing with it, such as "soft equalities".
    """

    scheme: Literal["semi-implicit Euler", "Runge-Kutta 4"]
    damping: NDArray[np.float64] | None = None
    by_velocity: bool = False
    besides: str = ""

    @property
    def name(self) -> str:
        """Such as: semi-implicit Euler, dampers at the step's end."""
        if self.by_velocity:
            return f"{self.scheme}, forces by velocity at the step's end"
        return self.scheme if self.damping is None else f"{self.scheme}, dampers at the step's end"
