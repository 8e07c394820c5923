"""Mimic joints, constrained through the mass matrix of an engine that ignores them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.engines.urdf import Mimic


def leader_matrix(mimics: Sequence[Mimic], names: Sequence[str], place: object) -> Array:
    """Return G of v = G v', (n, n - followers), where v' are the velocities of the leaders.

    Args:
        mimics: which joint follows which.
        names: of all n coordinates.
        place: the file, for messages.

    Raises:
        EngineError: if a follower or leader is not a moving joint, or the couplings form a loop.
    """
    by = {mimic.joint: mimic for mimic in mimics}
    for mimic in mimics:
        for joint in (mimic.leader, mimic.joint):
            if joint not in names:
                raise EngineError(f"{place}: <mimic> names {joint!r}, which is not a moving joint")
    lead = [name for name in names if name not in by]
    rows = np.zeros((len(names), len(lead)))
    for row, name in zip(rows, names, strict=True):
        share, joint_name = 1.0, name
        for _ in names:
            if joint_name not in by:
                break
            share, joint_name = share * by[joint_name].multiplier, by[joint_name].leader
        if joint_name in by:
            raise EngineError(f"{place}: <mimic> of {name!r} leads back to it")
        row[lead.index(joint_name)] = share
    return rows


def constrained_accelerations(mass: Array, force: Array, along: Array) -> Array:
    """Solve M a = force subject to v = along v'; the constraint forces do no work.

    Args:
        mass: (..., n, n).
        force: (..., n).
        along: by `leading`, (n, n').
    """
    led = _solve(along.T @ mass @ along, (along.T @ force[..., None])[..., 0])
    result: Array = (along @ led[..., None])[..., 0]
    return result


def _solve(a: Array, b: Array) -> Array:
    """Solve A x = b, (..., k); faster than numpy's solver for up to two leaders."""
    if b.shape[-1] == 1:
        return b / a[..., 0]
    if b.shape[-1] > 2:
        return np.asarray(np.linalg.solve(a, b[..., None])[..., 0], dtype=np.float64)
    # Symmetric and positive definite, so elimination needs no pivots.
    first, both, last = a[..., 0, 0], a[..., 0, 1], a[..., 1, 1]
    share = both / first
    led = np.empty_like(b)
    led[..., 1] = second = (b[..., 1] - share * b[..., 0]) / (last - share * both)
    led[..., 0] = b[..., 0] / first - share * second
    return led
