"""The rule by which an engine's next state follows from the forces on its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class StepRule:
    """M(q) a = f(q, v), with the engine's documented step.

    Velocities of a ball or free joint are angular, about the axes of the child body; the velocity
    of its origin is along the axes of the parent body. A step rotates the body about one axis.

    Attributes:
        scheme: v' = v + h a, then q' = q + h v'; or the classical Runge-Kutta method of order 4,
            with the forces of each stage.
        damping: D, (nz, nz), N s/m or N m s/rad, evaluated at the step's end: (M + h D) a = f.
            None: all forces are evaluated at the start.
        stiffness: K, (nz, nz), N/m or N m/rad, of springs that are evaluated there too, with v' as
            the velocity: (M + h D + h^2 K) a = f - h K v. None: all are evaluated at the start.
        by_velocity: D is -df/dv of all forces instead.
        coupled: pairs of coordinates to which D is restricted, (nz, nz). None: all.
        besides: other effects that vanish with the step, such as "soft equalities".
    """

    scheme: Literal["semi-implicit Euler", "Runge-Kutta 4"]
    damping: NDArray[np.float64] | None = None
    stiffness: NDArray[np.float64] | None = None
    by_velocity: bool = False
    coupled: NDArray[np.bool_] | None = None
    besides: str = ""

    @property
    def name(self) -> str:
        """The rule in words, such as: semi-implicit Euler, dampers at the step's end."""
        if self.by_velocity:
            return f"{self.scheme}, forces by velocity at the step's end"
        implicit_terms = {"springs": self.stiffness, "dampers": self.damping}
        names = " and ".join(name for name, one in implicit_terms.items() if one is not None)
        return f"{self.scheme}, {names} at the step's end" if names else self.scheme
