"""One step of an engine, linearized about an equilibrium: A and B of x' = A x + B u, from it to it.

That is what a controller in discrete time is designed on, and what engines that difference their
own step tell. Beside them stand those of the same rule on the equations
(`harness.numerics.stepping`), differenced alike, so that what differences leave drops out; and how
far a state grows in a step at most, the spectral radius, with that of the exact motion: a step at
which it is above 1 where the motion dies out has no equilibrium to speak of.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.differences import moved, slopes
from physics_crosscheck.harness.numerics.stepping import MARGIN, ROUNDED, Steps, steps_alike
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.next_state import Stepped

LARGEST = 0.02
"""Perturbations, as a share of the motions' sizes."""


@dataclass(frozen=True, kw_only=True)
class DiscreteLinearization:
    """One step about an equilibrium.

    Attributes:
        step: the shipped one, seconds.
        a, b: (2n, 2n) and (2n, inputs).
        error, bound: the largest difference from the rule's on the equations in any entry, and what
            is uncertain there, relative to the largest entry of what the rule's step changes; nan
            where no rule is known.
        differs: whether an entry differs by more than is uncertain, and than was asked for.
        radius, exact_radius: the largest magnitude of the eigenvalues of `a`, and of the exact
            motion's over the same time.
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
    model: Model,
    coordinates: CoordinateMap,
    stepped: Stepped | None,
    *,
    position: Array,
    taylor: Mapping[str, Array],
    amplitude: Array,
    push: Array,
    resolution: float,
) -> DiscreteLinearization | None:
    """Linearize one step of the shipped size about an equilibrium.

    Args:
        stepped: the equations; None where time stands in them.
        position: equilibrium positions, (n,).
        taylor: A of the Taylor linearization, among others.
        amplitude: size of the system's motions, per component, (2n,).
        push: size of its inputs, (inputs,).
        resolution: share of the largest entry from which on a difference counts.

    Returns:
        None where a step of the engine's has no finite end.
    """
    size = len(amplitude)
    origin = np.concatenate([position, np.zeros(size - len(position))])
    deltas = LARGEST * np.concatenate([np.minimum(amplitude, 1.0), push])
    by = moved(deltas)
    states, inputs = origin + by[:, :size], by[:, size:]
    run = Steps(model, coordinates, states, inputs)
    took = run.engine(1)
    ends = took[: len(states)]
    if not np.isfinite(ends).all():
        return None
    lost = ROUNDED * run.digit(ends) + MARGIN * run.rounding(took)
    found = slopes(ends, lost, deltas)
    a, b = found.value[:, :size], found.value[:, size:]
    error = bound = float("nan")
    differs, rule = False, model.step_rule
    if rule is not None and stepped is not None and steps_alike(rule, coordinates, states):
        wanted = slopes(run.rule(rule, stepped, 1), lost, deltas)
        changed = wanted.value - np.eye(size, len(deltas))
        scale = float(np.max(np.abs(changed))) or 1.0
        off = np.abs(found.value - wanted.value) / scale
        # What differences leave is the same in both: rounding alone tells them apart.
        doubt = slopes(0 * ends, 2 * lost, deltas).uncertainty / scale
        error, bound = float(np.max(off)), float(np.max(doubt))
        differs = bool(np.any((off > doubt) & (off + doubt > resolution)))
    from scipy.linalg import expm  # a part of a second, in every command

    exact = expm(taylor["A"] * model.step)
    return DiscreteLinearization(
        step=model.step,
        a=a,
        b=b,
        error=error,
        bound=bound,
        differs=differs,
        radius=float(np.max(np.abs(np.linalg.eigvals(a)))),
        exact_radius=float(np.max(np.abs(np.linalg.eigvals(exact)))),
    )
