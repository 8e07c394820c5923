"""What robots' files say beyond bodies and joints, counted by its kind, whatever their format."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from physics_crosscheck.harness.modelfiles.robot import LeftOut

HELD = "joints that move nothing with inertia (held still)"

FREE_MIMIC = "mimic without a gear: the joint is free"

Told = tuple[str, str]
"""What, and where: the name of a joint or a link."""


def tallied(told: Iterable[Told], followers: Collection[str]) -> tuple[LeftOut, ...]:
    """All that is told, by its kind, without the mimics of `followers`, which are held."""
    counts: dict[str, int] = {}
    places: dict[str, dict[str, None]] = {}
    for what, where in told:
        if what == FREE_MIMIC and where in followers:
            continue
        counts[what] = counts.get(what, 0) + 1
        places.setdefault(what, {}).update({where: None} if where else {})
    return tuple(
        LeftOut(what=what, count=count, where=tuple(places[what])) for what, count in counts.items()
    )
