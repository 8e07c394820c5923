"""Minimization of a find's input: removal of pieces while the same contract still breaks."""

from __future__ import annotations

import time

from soak.fuzz.target import FuzzTarget, attack

MINIMIZE_SECONDS = 60.0
"""Time limit for one find."""


def minimize(target: FuzzTarget, data: bytes) -> bytes:
    """Remove halves, quarters, ... single bytes from an input while it breaks the same contract.

    An input that breaks nothing is returned unchanged.
    """
    first = attack(target, data)
    if first is None:
        return data
    until, size = time.monotonic() + MINIMIZE_SECONDS, max(1, len(data) // 2)
    while time.monotonic() < until:
        shorter = _drop_pieces(target, data, size, first.location, until)
        if len(shorter) == len(data):
            if size == 1:
                break
            size //= 2
        data = shorter
    return data


def _drop_pieces(target: FuzzTarget, data: bytes, size: int, location: str, until: float) -> bytes:
    """Return the input without the pieces of one size that the find does not need."""
    start = 0
    while start < len(data) and time.monotonic() < until:
        shorter = data[:start] + data[start + size :]
        find = attack(target, shorter)
        if find is not None and find.location == location:
            data = shorter
        else:
            start += size
    return data
