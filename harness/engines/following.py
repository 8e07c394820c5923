"""Joints that follow others, held on an engine's mass matrix where it holds none itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.engines.protocol import Array, EngineError
from harness.engines.urdf import Mimic


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
                raise EngineError(f"{place}: <mimic> names {joint!r}, which is no moving joint")
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
    """What M a = pull comes to where v = along v' holds: no work is done by what holds it."""
    led: Array = along @ np.linalg.solve(along.T @ mass @ along, along.T @ pull)
    return led
