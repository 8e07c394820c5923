"""Content of robots' files beyond bodies and joints, counted by kind, for all formats."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from physics_crosscheck.harness.modelfiles.robot import Omission

HELD = "joints that move nothing with inertia (held still)"

FREE_MIMIC = "mimic without a gear: the joint is free"

Note = tuple[str, str]
"""The kind, and the name of a joint or a link."""


def count_notes(notes: Iterable[Note], followers: Collection[str]) -> tuple[Omission, ...]:
    """Count notes by kind, without the mimics of `followers`, which are enforced."""
    counts: dict[str, int] = {}
    places: dict[str, dict[str, None]] = {}
    for what, where in notes:
        if what == FREE_MIMIC and where in followers:
            continue
        counts[what] = counts.get(what, 0) + 1
        places.setdefault(what, {}).update({where: None} if where else {})
    return tuple(
        Omission(what=what, count=count, where=tuple(places[what]))
        for what, count in counts.items()
    )
