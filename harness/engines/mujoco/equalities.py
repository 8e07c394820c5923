"""Equalities of a compiled model that couple slides and hinges linearly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from physics_crosscheck.harness.engines.mujoco.pulls import acts, joint_name, of_tendon
from physics_crosscheck.reference.mechanism.bodies import Coupling

_CURVED = slice(2, 5)
"""Coefficients of an equality's polynomial that make it nonlinear."""


@dataclass(frozen=True)
class _LinearCoupling:
    """A joint's position as an offset and multiples of others' positions, by index."""

    follower: int
    leaders: Mapping[int, float]
    offset: float


def couplings(m: Any) -> Iterator[Coupling]:
    """Yield joints that linear equalities couple to others or fix."""
    for coupling in straight_equalities(m).values():
        (leader, multiplier), *others = coupling.leaders.items() or [(None, 0.0)]
        yield Coupling(
            follower=joint_name(m, coupling.follower),
            leader=None if leader is None else joint_name(m, leader),
            multiplier=multiplier,
            offset=coupling.offset,
            others=tuple((joint_name(m, joint), x) for joint, x in others if joint is not None),
        )


def equalities_act(m: Any) -> bool:
    """Return whether a model has equalities and its flags leave them on."""
    return bool(m.eq_active0.any()) and acts(m, "EQUALITY") and acts(m, "CONSTRAINT")


def straight_equalities(m: Any) -> dict[int, _LinearCoupling]:
    """Return active linear equalities of joints or fixed tendons, by index.

    Each is the first for its follower, and no leader follows one of its followers.
    """
    couplings_by_row: dict[int, _LinearCoupling] = {}
    leaders: dict[int, set[int]] = {}
    for i in range(m.neq) if equalities_act(m) else ():
        if not m.eq_active0[i] or m.eq_data[i][_CURVED].any():
            continue
        for coupling in _followings(m, i):
            if coupling.follower not in leaders and coupling.follower not in _above(
                coupling.leaders, leaders
            ):
                couplings_by_row[i] = coupling
                leaders[coupling.follower] = set(coupling.leaders)
                break
    return couplings_by_row


def _above(joints: Mapping[int, float], leaders: Mapping[int, set[int]]) -> set[int]:
    """Return these joints and all their leaders, direct and indirect."""
    passed: set[int] = set()
    waiting = list(joints)
    while waiting:
        joint = waiting.pop()
        if joint not in passed:
            passed.add(joint)
            waiting += leaders.get(joint, ())
    return passed


def _followings(m: Any, i: int) -> Iterator[_LinearCoupling]:
    """Yield an equality as possible couplings; for a tendon, its largest coefficient first."""
    import mujoco

    first, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
    start, slope = float(m.eq_data[i][0]), float(m.eq_data[i][1])
    if m.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
        leaders = {other: slope} if other >= 0 else {}
        offset = start + _drawn(m, first) - sum(x * _drawn(m, k) for k, x in leaders.items())
        yield _LinearCoupling(first, leaders, offset)
    if m.eq_type[i] != mujoco.mjtEq.mjEQ_TENDON:
        return
    shares: dict[int, float] = {}
    for tendon, by in ((first, 1.0), *(((other, -slope),) if other >= 0 else ())):
        way = of_tendon(m, tendon, by)
        if not isinstance(way, tuple):
            return
        for joint, share in way:
            shares[joint] = shares.get(joint, 0.0) + share
    whole = start + sum(share * _drawn(m, joint) for joint, share in shares.items())
    for joint in sorted(shares, key=lambda joint: -abs(shares[joint])):
        coefficient = shares[joint]
        if coefficient:
            rest = {k: -share / coefficient for k, share in shares.items() if k != joint and share}
            yield _LinearCoupling(joint, rest, whole / coefficient)


def _drawn(m: Any, joint: int) -> float:
    """Return a joint's position in the drawn configuration."""
    return float(m.qpos0[m.jnt_qposadr[joint]])
