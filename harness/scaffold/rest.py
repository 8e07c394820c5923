"""Rest position of a mechanism from its energy, within the joint limits if possible."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.optimize
import sympy as sp

from physics_crosscheck.harness.scaffold.constants import quarter
from physics_crosscheck.harness.scaffold.folder import NewError
from physics_crosscheck.harness.scaffold.mechanism import FormulaJoint
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function
from physics_crosscheck.reference.mechanism.system import System

ROOM = 0.02
"""Share of a joint's range that a motion keeps clear at both ends."""


def clipped(value: float, joint: FormulaJoint) -> float:
    """Return the value, or the middle of the limits if it is too close to them."""
    if joint.limits is None:
        return value
    low, high = joint.limits
    room = ROOM * (high - low)
    return value if low + room < value < high - room else (low + high) / 2


def rest_position(system: System, joints: Sequence[FormulaJoint]) -> Array:
    """Return a stable rest position well within the limits, if there is one.

    Otherwise return one at a limit or beyond it, for example if a spring holds a joint at its
    limit.

    Raises:
        NewError: if there is no rest position.
    """
    gradient = [sp.diff(system.V, q).xreplace(system.values) for q in system.q]
    slopes = compile_function(gradient, system.q)
    energy = compile_function([system.V.xreplace(system.values)], system.q)
    pulled = [q in system.V.free_symbols for q in system.q]
    middle = np.array([clipped(0.0, joint) for joint in joints])
    if not any(pulled):
        return middle
    tries = [
        middle + np.where(pulled, 0.1 * k * (-1.0) ** np.arange(len(middle)), 0.0)
        for k in (1, -7, 13, -22)
    ]
    size = max(float(np.max(np.abs(slopes(start)))) for start in tries) or 1.0

    def rests(position: Array) -> bool:
        return bool(np.max(np.abs(slopes(position))) < 1e-6 * size)

    def inside(position: Array) -> bool:
        return all(clipped(x, joint) == x for x, joint in zip(position, joints, strict=True))

    candidates: list[Array] = []
    for start in tries:
        down = scipy.optimize.minimize(
            lambda q: float(energy(q)[0]), start, jac=slopes, method="BFGS", tol=1e-10 * size
        )
        near = scipy.optimize.least_squares(slopes, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        candidates += [_unwound(np.asarray(x), joints) for x in (down.x, near.x)]
        if rests(candidates[-2]) and inside(candidates[-2]):
            return candidates[-2]  # a minimum
    if resting := [at for at in candidates if rests(at)]:
        return min(resting, key=lambda at: (not inside(at), float(np.max(np.abs(at - middle)))))
    names = ", ".join(j.name for j, p in zip(joints, pulled, strict=True) if p)
    raise NewError(
        "no rest position found, within the limits or beyond: gravity or springs "
        f"always pull {names}. A folder needs one to linearize engines about: give "
        "the joint a spring, or use `crosscheck new` without a model"
    )


def _unwound(position: Array, joints: Sequence[FormulaJoint]) -> Array:
    turns = [j.hinge and j.limits is None for j in joints]
    return np.where(turns, (position + math.pi) % (2 * math.pi) - math.pi, position)


def named_position(rest: Array, joints: Sequence[FormulaJoint]) -> tuple[tuple[str, ...], bool]:
    """Return each coordinate as text, and whether one is neither zero nor a quarter turn."""
    names = []
    search = False
    for value, joint in zip(rest, joints, strict=True):
        quarters = round(float(value) * 2 / math.pi) if joint.hinge else 0
        if abs(value - quarters * math.pi / 2) < 1e-5:
            names.append(quarter(quarters * math.pi / 2) or "0")
        else:
            names.append(f"{value:.6g}")
            search = True
    return tuple(names), search
