"""One step of an engine, linearized about an equilibrium: A and B of x' = A x + B u.

Controllers in discrete time are designed with these matrices, and engines that differentiate their
own step return them. They are compared with those of the same rule on the equations
(`harness.numerics.stepping`), computed by the same differences, so that truncation errors cancel.
The spectral radius is the largest growth of a state per step. If it exceeds 1 although the exact
motion decays, the step destabilizes the equilibrium.
"""

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.records.base import number, rows
from physics_crosscheck.harness.records.model import DiscreteLinearization
from physics_crosscheck.harness.records.outcome import differs
from physics_crosscheck.reference.solving.next_state import Stepped
from .coordinates import CoordinateMap
from .differences import OperatingPoint, slopes
from .stepping import ROUNDED_DIGITS, ROUNDING_MARGIN, Steps, steps_alike


def linearize_step(
    model: LoadedModel,
    coordinates: CoordinateMap,
    stepped: Stepped | None,
    point: OperatingPoint,
    resolution: float,
) -> DiscreteLinearization | None:
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
    return DiscreteLinearization(
        step=number(model.step),
        a=rows(a.tolist()),
        b=rows(b.tolist()),
        error=number(error),
        bound=number(bound),
        differs=is_wrong,
        radius=number(np.max(np.abs(np.linalg.eigvals(a)))),
        exact_radius=number(np.max(np.abs(np.linalg.eigvals(exact)))),
    )
