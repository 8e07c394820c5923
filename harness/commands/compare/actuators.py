"""Actuators of two files: pairs, the controls that hold them, and their differences."""

from collections.abc import Callable, Iterator, Mapping, Sequence

from physics_crosscheck.harness.engines.compiled import CompiledActuator, CompiledTree, Numbers
from physics_crosscheck.harness.modelfiles.mjcf.read import SPREAD, held_controls
from .match import Pairs
from .side import Difference, make_property

Held = tuple[list[float], list[float]]
"""Constant controls of a file's actuators, and initial values of their activation states."""


def pair_actuators(
    a: Sequence[CompiledActuator], b: Sequence[CompiledActuator], joints: Mapping[str, str]
) -> Pairs[int]:
    """Pair actuators by name, then by the joint they act on, then by the order of like ones.

    Args:
        a, b: actuators of both files.
        joints: names of A's joints -> names of B's joints that they are paired with.
    """
    pairs: dict[int, tuple[int, str]] = {}
    for how, of_a, of_b in (
        ("name", lambda one: one.name, lambda one: one.name),
        ("joint", lambda one: joints.get(one.on, one.on), lambda one: one.on),
        ("order", _unnamed_target(set(joints)), _unnamed_target(set(joints.values()))),
    ):
        _add_pairs(pairs, how, [of_a(one) for one in a], [of_b(one) for one in b])
    paired_b = {j for j, _ in pairs.values()}
    return Pairs(
        pairs={i: pairs[i][0] for i in sorted(pairs)},
        notes=tuple(
            f"actuator {_name(a[i])} of A is {_name(b[j])} of B: by {how}"
            for i, (j, how) in sorted(pairs.items())
            if a[i].name != b[j].name
        ),
        unpaired=(
            tuple(i for i in range(len(a)) if i not in pairs),
            tuple(j for j in range(len(b)) if j not in paired_b),
        ),
    )


def _unnamed_target(joints: set[str]) -> Callable[[CompiledActuator], str]:
    """Return a key for actuators on unpaired joints: their kind of transmission."""
    return lambda one: "" if one.on in joints else one.kind[0]


def _add_pairs(
    pairs: dict[int, tuple[int, str]], how: str, of_a: Sequence[str], of_b: Sequence[str]
) -> None:
    paired_b = {j for j, _ in pairs.values()}
    free = [j for j in range(len(of_b)) if j not in paired_b]
    for i, key in enumerate(of_a):
        partner = next((j for j in free if key and of_b[j] == key), None)
        if i not in pairs and partner is not None:
            pairs[i] = partner, how
            free.remove(partner)


def _name(actuator: CompiledActuator) -> str:
    return actuator.name or f"on {actuator.on}"


def held_alike(a: CompiledTree, b: CompiledTree, pairs: Pairs[int]) -> tuple[Held, Held]:
    """Return controls and initial states of A and of B: within A's ranges where paired.

    Unpaired actuators of B take values within B's ranges. A state begins away from the value that
    its control would hold, so that its dynamics act.
    """
    inputs_a, inputs_b = (
        (list(held_controls(compiled)), [_state(compiled, i) for i in range(compiled.states)])
        for compiled in (a, b)
    )
    for i, j in pairs.pairs.items():
        here, there = a.actuators[i], b.actuators[j]
        inputs_b[0][there.control] = inputs_a[0][here.control]
        for k, state in zip(here.states, there.states, strict=False):
            inputs_b[1][state] = inputs_a[1][k]
    return inputs_a, inputs_b


def _state(compiled: CompiledTree, index: int) -> float:
    """Return an initial state: within its range, its control's range, or 0 to 1."""
    owner = next((one for one in compiled.actuators if index in one.states), None)
    ranges = {} if owner is None else dict(owner.ranges)
    low, high = ranges.get("state range") or ranges.get("control range") or (0.0, 1.0)
    return low + (high - low) * (((index + 1) * SPREAD + 0.5) % 1.0)


def actuator_properties(
    a: Sequence[CompiledActuator],
    b: Sequence[CompiledActuator],
    joints: Mapping[str, str],
    acting: bool,
) -> Iterator[Difference]:
    """Yield differences between paired actuators, and actuators that only one file has.

    Args:
        a, b: actuators of both files.
        joints: as for `pair_actuators`.
        acting: whether actuators act in the compared motions.
    """
    pairs = pair_actuators(a, b, joints)
    for label, actuators, unpaired in zip("AB", (a, b), pairs.unpaired, strict=True):
        for actuator in (actuators[i] for i in unpaired):
            message = f"actuator {_name(actuator)}: in {label} alone"
            moves = acting and actuator.covered
            yield make_property("actuators", actuator.on, message, moves=moves)
    for i, j in pairs.pairs.items():
        yield from _differences(a[i], b[j], acting)


def _differences(
    actuator: CompiledActuator, other: CompiledActuator, acting: bool
) -> Iterator[Difference]:
    for here, there in zip(actuator.kind, other.kind, strict=True):
        if here != there:
            message = f"actuator {_name(actuator)}: {here} in A, {there} in B"
            yield make_property("actuator", actuator.on, message, moves=acting)
    moves = acting and actuator.covered and other.covered
    for values_a, values_b, acts in (
        (actuator.numbers, other.numbers, moves),
        (actuator.ranges, other.ranges, False),
    ):
        of_a, of_b = dict(values_a), dict(values_b)
        for what in dict.fromkeys([*of_a, *of_b]):
            values = _shown(of_a.get(what)), _shown(of_b.get(what))
            if values[0] != values[1]:
                message = (
                    f"{what} of actuator {_name(actuator)}: {values[0]} in A, {values[1]} in B"
                )
                yield make_property("actuator", actuator.on, message, moves=acts)


def _shown(values: Numbers | None) -> str:
    if values is None:
        return "none"
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(f"{value:.9g}" for value in values[: last + 1])
