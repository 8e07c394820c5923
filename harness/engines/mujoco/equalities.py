"""Equalities of a compiled model that make slides and hinges follow others by straight lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from physics_crosscheck.harness.engines.compiled import CompiledCoupling
from physics_crosscheck.harness.engines.mujoco.pulls import acts
from physics_crosscheck.harness.engines.mujoco.ways import of_tendon

_CURVED = slice(2, 5)
"""Coefficients of an equality's polynomial that make it no straight line."""


@dataclass(frozen=True)
class _Following:
    """A joint's position as an offset and multiples of those of others, by their indices."""

    follower: int
    leaders: Mapping[int, float]
    offset: float


def couplings(m: Any) -> Iterator[CompiledCoupling]:
    """Joints that equalities make follow others, or stand still, by a straight line."""
    for one in straight_equalities(m).values():
        (leader, multiplier), *others = one.leaders.items() or [(None, 0.0)]
        yield CompiledCoupling(
            follower=one.follower,
            leader=leader,
            multiplier=multiplier,
            offset=one.offset,
            others=tuple((joint, share) for joint, share in others if joint is not None),
        )


def equalities_act(m: Any) -> bool:
    """Return whether a model has equalities and its flags leave them on."""
    return bool(m.eq_active0.any()) and acts(m, "EQUALITY") and acts(m, "CONSTRAINT")


def straight_equalities(m: Any) -> dict[int, _Following]:
    """Those that are active, of joints or fixed tendons, by their indices, and what follows.

    Each is the first for its joint, and no leader follows one of its followers.
    """
    found: dict[int, _Following] = {}
    leaders: dict[int, set[int]] = {}
    for i in range(m.neq) if equalities_act(m) else ():
        if not m.eq_active0[i] or m.eq_data[i][_CURVED].any():
            continue
        for one in _followings(m, i):
            if one.follower not in leaders and one.follower not in _above(one.leaders, leaders):
                found[i] = one
                leaders[one.follower] = set(one.leaders)
                break
    return found


def _above(joints: Mapping[int, float], leaders: Mapping[int, set[int]]) -> set[int]:
    """Joints, and all that they follow."""
    passed: set[int] = set()
    waiting = list(joints)
    while waiting:
        joint = waiting.pop()
        if joint not in passed:
            passed.add(joint)
            waiting += leaders.get(joint, ())
    return passed


def _followings(m: Any, i: int) -> Iterator[_Following]:
    """An equality as a joint that follows: of a tendon's, any of them, the most felt first."""
    import mujoco

    one, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
    start, slope = float(m.eq_data[i][0]), float(m.eq_data[i][1])
    if m.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
        leaders = {other: slope} if other >= 0 else {}
        offset = start + _drawn(m, one) - sum(x * _drawn(m, k) for k, x in leaders.items())
        yield _Following(one, leaders, offset)
    if m.eq_type[i] != mujoco.mjtEq.mjEQ_TENDON:
        return
    shares: dict[int, float] = {}
    for tendon, by in ((one, 1.0), *(((other, -slope),) if other >= 0 else ())):
        way = of_tendon(m, tendon, by)
        if not isinstance(way, tuple):
            return
        for joint, share in way:
            shares[joint] = shares.get(joint, 0.0) + share
    whole = start + sum(share * _drawn(m, joint) for joint, share in shares.items())
    for joint in sorted(shares, key=lambda joint: -abs(shares[joint])):
        own = shares[joint]
        if own:
            rest = {k: -share / own for k, share in shares.items() if k != joint and share}
            yield _Following(joint, rest, whole / own)


def _drawn(m: Any, joint: int) -> float:
    """Its position where the file draws it."""
    return float(m.qpos0[m.jnt_qposadr[joint]])
