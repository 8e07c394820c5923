"""One step of an engine, linearized about an equilibrium: A and B of x' = A x + B u.

Controllers in discrete time are designed with these matrices, and engines that differentiate their
own step return them. They are compared with those of the same rule on the equations
(`harness.numerics.stepping`), computed by the same differences, so that truncation errors cancel.
The spectral radius is the largest growth of a state per step. If it exceeds 1 although the exact
motion decays, the step destabilizes the equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.differences import OperatingPoint, slopes
from physics_crosscheck.harness.numerics.stepping import (
    ROUNDED_DIGITS,
    ROUNDING_MARGIN,
    Steps,
    steps_alike,
)
from physics_crosscheck.harness.records.outcome import differs
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.next_state import Stepped


@dataclass(frozen=True, kw_only=True)
class StepLinearization:
    """One step about an equilibrium.

    Attributes:
        step: the file's own time step, seconds.
        a, b: (2n, 2n) and (2n, inputs).
        error, bound: largest difference from the rule on the equations in any entry, and its
            uncertainty, relative to the largest entry of the rule's step minus identity; nan
            without a rule.
        differs: whether an entry differs by more than its uncertainty, at the requested resolution.
        radius, exact_radius: largest eigenvalue magnitude of `a`, and of the exact motion over the
            same time.
    """

    step: float
    a: Array
    b: Array
    error: float
    bound: float
    differs: bool
    radius: float
    exact_radius: float


def linearize_step(
    model: LoadedModel,
    coordinates: CoordinateMap,
    stepped: Stepped | None,
    point: OperatingPoint,
    resolution: float,
) -> StepLinearization | None:
    """Linearize one step, of the file's own time step, about an equilibrium.

    Args:
        stepped: the equations; None if they depend on time.
        point: the equilibrium.
        resolution: smallest difference that counts, as a share of the largest entry.

    Returns:
        None if a step of the engine is not finite.
    """
    size, deltas = len(point.amplitude), point.deltas
    states, inputs = point.perturbed
    run = Steps(model, coordinates, states, inputs)
    took = run.engine(1)
    ends = took[: len(states)]
    if not np.isfinite(ends).all():
        return None
    lost = ROUNDED_DIGITS * run.digit(ends) + ROUNDING_MARGIN * run.rounding(took)
    engine_slopes = slopes(ends, lost, deltas)
    a, b = engine_slopes.value[:, :size], engine_slopes.value[:, size:]
    error = bound = float("nan")
    is_wrong, rule = False, model.step_rule
    if rule is not None and stepped is not None and steps_alike(rule, coordinates, states):
        wanted = slopes(run.rule(rule, stepped, 1), lost, deltas)
        changed = wanted.value - np.eye(size, len(deltas))
        scale = float(np.max(np.abs(changed))) or 1.0
        off = np.abs(engine_slopes.value - wanted.value) / scale
        # Truncation errors are the same in both; only rounding differs.
        doubt = slopes(0 * ends, 2 * lost, deltas).uncertainty / scale
        error, bound = float(np.max(off)), float(np.max(doubt))
        is_wrong = bool(np.any(differs(off, doubt, resolution)))
    from scipy.linalg import expm  # slow import, not needed by every command

    exact = expm(point.matrices["A"] * model.step)
    return StepLinearization(
        step=model.step,
        a=a,
        b=b,
        error=error,
        bound=bound,
        differs=is_wrong,
        radius=float(np.max(np.abs(np.linalg.eigvals(a)))),
        exact_radius=float(np.max(np.abs(np.linalg.eigvals(exact)))),
    )
