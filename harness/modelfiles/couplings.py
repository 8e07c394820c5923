"""Joints that follow others, if every engine can enforce the coupling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from physics_crosscheck.reference.mechanism.bodies import Coupling


class MimicLeader(NamedTuple):
    """A joint's leader, by name, and its multiplier."""

    leader: str
    multiplier: float


def acyclic(mimics: Mapping[str, MimicLeader]) -> dict[str, MimicLeader]:
    """Return the mimics without cyclic ones."""
    return {name: one for name, one in mimics.items() if not _circular(name, mimics)}


def _circular(name: str, mimics: Mapping[str, MimicLeader]) -> bool:
    passed: set[str] = set()
    while name in mimics and name not in passed:
        passed.add(name)
        name = mimics[name].leader
    return name in passed


def couplings(mimics: Mapping[str, MimicLeader]) -> tuple[Coupling, ...]:
    """Return mimics as couplings of joints."""
    return tuple(
        Coupling(follower=name, leader=one.leader, multiplier=one.multiplier)
        for name, one in mimics.items()
    )
