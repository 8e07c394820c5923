"""Actuators of two files: which is which, at what they are held, and what differs of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.compare.property import Property, told
from physics_crosscheck.harness.engines.compiled import CompiledActuator, CompiledTree, Numbers
from physics_crosscheck.harness.modelfiles.mjcf.tree import SPREAD, held_controls


@dataclass(frozen=True, kw_only=True)
class ActuatorPairs:
    """Actuators that are taken for one another, by their indices.

    Attributes:
        pairs: (index in A, index in B), in the order of A.
        how: a phrase for each pair whose names differ.
        alone: those without a partner, of A and of B.
    """

    pairs: tuple[tuple[int, int], ...]
    how: tuple[str, ...]
    alone: tuple[tuple[int, ...], tuple[int, ...]]


def pair_actuators(
    a: Sequence[CompiledActuator], b: Sequence[CompiledActuator], joints: Mapping[str, str]
) -> ActuatorPairs:
    """Pair actuators by name, then by what they act on, then by the order of like ones.

    Args:
        a, b: actuators of both files.
        joints: names of A's joints, with those of B's that are their partners.
    """
    found: dict[int, tuple[int, str]] = {}
    for how, of_a, of_b in (
        ("name", lambda one: one.name, lambda one: one.name),
        ("joint", lambda one: joints.get(one.on, one.on), lambda one: one.on),
        ("order", _unnamed_target(set(joints)), _unnamed_target(set(joints.values()))),
    ):
        _add_pairs(found, how, [of_a(one) for one in a], [of_b(one) for one in b])
    taken = {j for j, _ in found.values()}
    return ActuatorPairs(
        pairs=tuple((i, found[i][0]) for i in sorted(found)),
        how=tuple(
            f"actuator {_name(a[i])} of A is {_name(b[j])} of B: by {how}"
            for i, (j, how) in sorted(found.items())
            if a[i].name != b[j].name
        ),
        alone=(
            tuple(i for i in range(len(a)) if i not in found),
            tuple(j for j in range(len(b)) if j not in taken),
        ),
    )


def _unnamed_target(joints: set[str]) -> Callable[[CompiledActuator], str]:
    """Return the transmission of an actuator that acts on no joint that has a partner."""
    return lambda one: "" if one.on in joints else one.kind[0]


def _add_pairs(
    found: dict[int, tuple[int, str]], how: str, of_a: Sequence[str], of_b: Sequence[str]
) -> None:
    """Pair what is left with equal keys, in order."""
    taken = {j for j, _ in found.values()}
    free = [j for j in range(len(of_b)) if j not in taken]
    for i, key in enumerate(of_a):
        partner = next((j for j in free if key and of_b[j] == key), None)
        if i not in found and partner is not None:
            found[i] = partner, how
            free.remove(partner)


def _name(one: CompiledActuator) -> str:
    return one.name or f"on {one.on}"


@dataclass(frozen=True, kw_only=True)
class Held:
    """At what the actuators of a file are held.

    Attributes:
        controls: of each input.
        states: at which each state begins.
    """

    controls: tuple[float, ...]
    states: tuple[float, ...]


def held_alike(a: CompiledTree, b: CompiledTree, pairs: ActuatorPairs) -> tuple[Held, Held]:
    """Return controls and states of A within its ranges; of B the same, and its own where alone.

    A state begins elsewhere than its control would hold it: so its dynamics act.
    """
    one, other = (
        (list(held_controls(compiled)), [_state(compiled, i) for i in range(compiled.states)])
        for compiled in (a, b)
    )
    for i, j in pairs.pairs:
        here, there = a.actuators[i], b.actuators[j]
        other[0][there.control] = one[0][here.control]
        for k, state in zip(here.states, there.states, strict=False):
            other[1][state] = one[1][k]
    first, second = (
        Held(controls=tuple(controls), states=tuple(states)) for controls, states in (one, other)
    )
    return first, second


def _state(compiled: CompiledTree, index: int) -> float:
    """Return where a state begins: within its range, or that of its control, or 0 and 1."""
    owner = next((one for one in compiled.actuators if index in one.states), None)
    ranges = {} if owner is None else dict(owner.ranges)
    low, high = ranges.get("state range") or ranges.get("control range") or (0.0, 1.0)
    return low + (high - low) * (((index + 1) * SPREAD + 0.5) % 1.0)


def actuator_properties(
    a: Sequence[CompiledActuator],
    b: Sequence[CompiledActuator],
    joints: Mapping[str, str],
    acting: bool,
) -> Iterator[Property]:
    """Yield what differs of actuators, and those that one file alone has.

    Args:
        a, b: actuators of both files.
        joints: as `pair_actuators` has them.
        acting: whether they act in the motions that are compared.
    """
    pairs = pair_actuators(a, b, joints)
    for label, own, alone in zip("AB", (a, b), pairs.alone, strict=True):
        for one in (own[i] for i in alone):
            message = f"actuator {_name(one)}: in {label} alone"
            moves = acting and one.covered
            yield told("actuators", one.on, message, 0.0, moves=moves)
    for i, j in pairs.pairs:
        yield from _differences(a[i], b[j], acting)


def _differences(
    one: CompiledActuator, other: CompiledActuator, acting: bool
) -> Iterator[Property]:
    for here, there in zip(one.kind, other.kind, strict=True):
        if here != there:
            message = f"actuator {_name(one)}: {here} in A, {there} in B"
            yield told("actuator", one.on, message, 0.0, moves=acting)
    moves = acting and one.covered and other.covered
    for own, its, acts in (
        (one.numbers, other.numbers, moves),
        (one.ranges, other.ranges, False),
    ):
        of_a, of_b = dict(own), dict(its)
        for what in dict.fromkeys([*of_a, *of_b]):
            values = _shown(of_a.get(what)), _shown(of_b.get(what))
            if values[0] != values[1]:
                message = f"{what} of actuator {_name(one)}: {values[0]} in A, {values[1]} in B"
                yield told("actuator", one.on, message, 0.0, moves=acts)


def _shown(values: Numbers | None) -> str:
    """Return numbers without the zeros that fill a row."""
    if values is None:
        return "none"
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(f"{value:.9g}" for value in values[: last + 1])
