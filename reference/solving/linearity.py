"""Validity of the linear equations: their error against the nonlinear ones, over amplitude."""

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.dynamics.derive import Equations
from physics_crosscheck.reference.dynamics.linearize import TaylorLinearization, modes
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import SignalPiece
from .integrate import trajectory

AMPLITUDES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 2.5)


@dataclass(frozen=True, kw_only=True)
class LinearityError:
    """Error of the linear equations for one mode about one equilibrium.

    Attributes:
        mode: index of the mode, slowest first.
        period: its linear period, seconds.
        amplitudes: initial displacements of the largest entry of the shape, rad or m.
        errors: largest |linear - nonlinear| position over one period, relative to the amplitude.
    """

    equilibrium: str
    mode: int
    period: float
    amplitudes: tuple[float, ...]
    errors: tuple[float, ...]


def linearity(
    equations: Equations, linearization: TaylorLinearization
) -> tuple[LinearityError, ...]:
    """Release each mode at rest at growing amplitudes, and compare over one of its periods.

    There are no entries for linear equations, rigid-body modes (which have no period), and unstable
    equilibria (which the motion leaves at any amplitude).
    """
    shapes = modes(linearization)
    if equations.linear or any(mode.growth > 0 for mode in shapes):
        return ()
    matrix = linearization.arrays["A"]
    n = len(equations.system.coordinates)
    result = []
    for index, mode in enumerate(shapes):
        if mode.rigid:
            continue
        period = 2 * np.pi / mode.frequency
        times = np.linspace(0.0, period, 101)
        still = SignalPiece(
            start=0.0, stop=period, expressions=tuple(0 * u for u in equations.system.u)
        )
        from scipy.linalg import expm  # slow import, not needed by every command

        flow: Array = expm(matrix[None] * times[:, None, None])
        errors = []
        for amplitude in AMPLITUDES:
            start = np.concatenate([amplitude * mode.shape, np.zeros(n)])
            offset = np.concatenate([linearization.position, np.zeros(n)])
            exact = trajectory(equations, start + offset, (still,), times, rtol=1e-10)
            linear = flow @ start + offset
            errors.append(float(np.max(np.abs(linear - exact)[:, :n]) / amplitude))
        result.append(
            LinearityError(
                equilibrium=linearization.equilibrium,
                mode=index,
                period=period,
                amplitudes=AMPLITUDES,
                errors=tuple(errors),
            )
        )
    return tuple(result)
