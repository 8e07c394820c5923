"""A find's input made small: pieces are taken out as long as the same contract breaks."""

from __future__ import annotations

import time

from soak.fuzz.target import Target, attack

PATIENCE = 60.0
"""Seconds that one find is worth."""


def smallest(target: Target, data: bytes) -> bytes:
    """Take out halves, quarters, ... single bytes; the input itself where it breaks nothing."""
    first = attack(target, data)
    if first is None:
        return data
    until, size = time.monotonic() + PATIENCE, max(1, len(data) // 2)
    while time.monotonic() < until:
        shorter = _without(target, data, size, first.place, until)
        if len(shorter) == len(data):
            if size == 1:
                break
            size //= 2
        data = shorter
    return data


def _without(target: Target, data: bytes, size: int, place: str, until: float) -> bytes:
    """One pass over the pieces of a size."""
    at = 0
    while at < len(data) and time.monotonic() < until:
        less = data[:at] + data[at + size :]
        found = attack(target, less)
        if found is not None and found.place == place:
            data = less
        else:
            at += size
    return data
