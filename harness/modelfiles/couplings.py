"""Joints that follow others, as far as every engine can hold them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from physics_crosscheck.reference.mechanism.bodies import Coupling


class Mimic(NamedTuple):
    """A joint's leader, by its name, and its multiplier."""

    leader: str
    multiplier: float


def acyclic(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Those that do not follow themselves by way of others."""
    return {name: one for name, one in mimics.items() if not _circular(name, mimics)}


def _circular(name: str, mimics: Mapping[str, Mimic]) -> bool:
    passed: set[str] = set()
    while name in mimics and name not in passed:
        passed.add(name)
        name = mimics[name].leader
    return name in passed


def couplings(mimics: Mapping[str, Mimic]) -> tuple[Coupling, ...]:
    """The same as couplings of joints."""
    return tuple(
        Coupling(follower=name, leader=one.leader, multiplier=one.multiplier)
        for name, one in mimics.items()
    )
