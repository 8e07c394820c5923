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
        stiffness: K, (nz, nz), N/m or N m/rad, of springs that are taken there too, where v' takes
            them: (M + h D + h^2 K) a = f - h K v. None: all are taken at the step's start.
        by_velocity: D is -df/dv of all forces instead,
        coupled: of these pairs of coordinates, (nz, nz); of others it is nothing. None: of all.
        besides: what else acts in a step and goes to nothing with it, such as "soft equalities".
    """

    scheme: Literal["semi-implicit Euler", "Runge-Kutta 4"]
    damping: NDArray[np.float64] | None = None
    stiffness: NDArray[np.float64] | None = None
    by_velocity: bool = False
    coupled: NDArray[np.bool_] | None = None
    besides: str = ""

    @property
    def name(self) -> str:
        """Such as: semi-implicit Euler, dampers at the step's end."""
        if self.by_velocity:
            return f"{self.scheme}, forces by velocity at the step's end"
        late = {"springs": self.stiffness, "dampers": self.damping}
        told = " and ".join(name for name, one in late.items() if one is not None)
        return f"{self.scheme}, {told} at the step's end" if told else self.scheme
