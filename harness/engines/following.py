"""Joints that follow others, held on an engine's mass matrix where it holds none itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.engines.urdf import Mimic


def leading(mimics: Sequence[Mimic], names: Sequence[str], place: object) -> Array:
    """G of v = G v', in which v' are the velocities that lead, (n, n - followers).

    Args:
        mimics: which joint follows which.
        names: of all coordinates, n of them.
        place: the file, for messages.

    Raises:
        EngineError: where what follows, or is followed, is no moving joint, or all go in a circle.
    """
    by = {one.joint: one for one in mimics}
    for one in mimics:
        for joint in (one.leader, one.joint):
            if joint not in names:
                raise EngineError(f"{place}: <mimic> names {joint!r}, which is not a moving joint")
    lead = [name for name in names if name not in by]
    rows = np.zeros((len(names), len(lead)))
    for row, name in zip(rows, names, strict=True):
        share, at = 1.0, name
        for _ in names:
            if at not in by:
                break
            share, at = share * by[at].multiplier, by[at].leader
        if at in by:
            raise EngineError(f"{place}: <mimic> of {name!r} leads back to it")
        row[lead.index(at)] = share
    return rows


def held_accelerations(mass: Array, pull: Array, along: Array) -> Array:
    """What M a = pull comes to where v = along v' holds: no work is done by what holds it.

    Args:
        mass: (..., n, n).
        pull: (..., n).
        along: by `leading`, (n, n').
    """
    led = _solved(along.T @ mass @ along, (along.T @ pull[..., None])[..., 0])
    found: Array = (along @ led[..., None])[..., 0]
    return found


def _solved(a: Array, b: Array) -> Array:
    """x of A x = b, (..., k): where few lead, numpy's own solver costs several times as much."""
    if b.shape[-1] == 1:
        return b / a[..., 0]
    if b.shape[-1] > 2:
        return np.asarray(np.linalg.solve(a, b[..., None])[..., 0], dtype=np.float64)
    # Symmetric and positive definite, so that elimination needs no pivots.
    one, both, other = a[..., 0, 0], a[..., 0, 1], a[..., 1, 1]
    share = both / one
    led = np.empty_like(b)
    led[..., 1] = second = (b[..., 1] - share * b[..., 0]) / (other - share * both)
    led[..., 0] = b[..., 0] / one - share * second
    return led
