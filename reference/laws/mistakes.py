"""Laws with one typical mistake: another mixing rule, cone or unit, or limits that are lost.

An engine with such a law is an engine with a known answer. The diagnosis tries the same laws.

Only the rows and drives whose numbers differ are evaluated again, at the solution of the first
laws: the change of the gradient there, times the inverse of the Hessian, is the effect.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Generic, TypeVar, get_args

import numpy as np

from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    ContactParameters,
    ContactPoint,
    HardJoint,
    Laws,
    Mixing,
    SoftFriction,
    SoftLimit,
    Softness,
    Surface,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from .drives import drive
from .impulses import ImpulseModel
from .step import LawModel, LawSolution, LawStep

M = TypeVar("M", LawModel, ImpulseModel)


@dataclass(frozen=True, kw_only=True)
class LawMistake(Generic[M]):
    """A mistake in the laws of a model.

    Attributes:
        name: in words.
        change: returns the laws with the mistake.
    """

    name: str
    change: Callable[[M], M]


DIMENSIONS = (1, 3, 4, 6)
"""Numbers of directions of a contact's force."""

_MIXING = {
    "largest": "the larger friction of two shapes acts",
    "product": "frictions of two shapes are multiplied",
    "mean": "frictions of two shapes are averaged",
    "harmonic": "the harmonic mean of the frictions of two shapes acts",
    "smallest": "the smaller friction of two shapes acts",
}

_SLIDING = (
    "a wrong dJ/dt v of an equality that moves with a ball joint and slides after it in its body"
)

_UNITS = (
    (180 / np.pi, "gains of drives are multiplied by 180/pi, as if they were per degree"),
    (np.pi / 180, "gains of drives are divided by 180/pi, as if they were per degree"),
)


def soft_mistakes(model: LawModel) -> Iterator[LawMistake[LawModel]]:
    """Yield the mistakes that convex laws have a place for."""
    laws = model.laws
    of_contacts = _contact_mistakes(laws) if laws.surfaces or laws.compliant[1:] else ()
    for name, change in (*of_contacts, *_lost(model), *_drive_mistakes(laws)):
        if change(laws) != laws:
            yield LawMistake(name=name, change=partial(_under, change))
    merged = LawMistake(
        name="damping of drives is merged with that of their joints", change=_merged_damping
    )
    if merged.change(model).laws != laws:
        yield merged


def hard_mistakes(model: ImpulseModel) -> Iterator[LawMistake[ImpulseModel]]:
    """Yield the mistakes that impulses have a place for."""
    for name, change in (*_ruled_mistakes(model), *_lost_joints(model)):
        if change(model).laws != model.laws:
            yield LawMistake(name=name, change=change)


_HardChange = Callable[[ImpulseModel], ImpulseModel]


def _ruled_mistakes(model: ImpulseModel) -> Iterator[tuple[str, _HardChange]]:
    rules = model.laws.rules
    yield "restitution is lost: nothing bounces", partial(_ruled, bounce=np.inf)
    for mixing in get_args(Mixing):
        yield _MIXING[mixing], partial(_ruled, mixing=mixing)
    for factor, name in (*_UNITS, *_by_step(rules.step)) if model.laws.joints else ():
        yield name, partial(_ruled, gain=factor * rules.gain)


def _lost_joints(model: ImpulseModel) -> Iterator[tuple[str, _HardChange]]:
    """Yield limits and efforts of motors that are ignored: all, then each."""
    joints = model.laws.joints
    for what, plural, lost in (
        ("limit", "limits of joints are", _without_limits),
        ("effort", "limits of effort are", _without_effort),
    ):
        concerned = [k for k, joint in enumerate(joints) if lost(joint) != joint]
        if len(concerned) != 1:
            yield f"{plural} ignored", partial(_joints, lost)
        for k in concerned:
            name = model.tree.tree.links[joints[k].joint].name
            yield f"the {what} of joint {name} is ignored", partial(_joints, lost, only=k)


_Change = Callable[[Laws], Laws]


def _under(change: _Change, model: LawModel) -> LawModel:
    return model.under(change(model.laws))


def _contact_mistakes(laws: Laws) -> Iterator[tuple[str, _Change]]:
    for mixing in get_args(Mixing):
        yield _MIXING[mixing], partial(replace, mixing=mixing)
    cone = "a friction pyramid replaces the cone" if laws.elliptic else "a cone replaces pyramids"
    yield cone, partial(replace, elliptic=not laws.elliptic)
    yield (
        "contacts have the impedance of zero depth, as if solimp were wider than any depth",
        _shallow,
    )
    for dimension in DIMENSIONS:
        yield f"contacts have condim {dimension}", partial(_with_dimension, dimension)


def _lost(model: LawModel) -> Iterator[tuple[str, _Change]]:
    """Yield limits, dry friction and equalities that are ignored: all, then each."""
    laws = model.laws

    def name(row: SoftLimit | SoftFriction) -> str:
        links = model.tree.tree.links
        return f"joint {links[row.joint].name}" if row.joint >= 0 else f"tendon {row.path + 1}"

    if len(laws.limits) > 1:
        yield "limits of joints and tendons are ignored", partial(replace, limits=())
    for limit in laws.limits:
        yield f"the limit of {name(limit)} is ignored", partial(_without_limit, limit)
    if len(laws.frictions) > 1:
        yield "dry friction is ignored", partial(replace, frictions=())
    for friction in laws.frictions:
        yield f"dry friction of {name(friction)} is ignored", partial(_without_friction, friction)
    yield "equalities are ignored", partial(replace, equalities=())
    if any(one.kind == "ball" and not one.mass for one in model.tree.tree.links):
        yield _SLIDING, partial(replace, sliding_drift=bool(laws.equalities))


def _without_limit(limit: SoftLimit, laws: Laws) -> Laws:
    return replace(laws, limits=tuple(one for one in laws.limits if one != limit))


def _without_friction(friction: SoftFriction, laws: Laws) -> Laws:
    return replace(laws, frictions=tuple(one for one in laws.frictions if one != friction))


def _shallow(laws: Laws) -> Laws:
    """Return laws whose contacts are never deep enough for another impedance."""

    def soft(softness: Softness) -> Softness:
        start, full, _, *rest = softness.impedance
        return replace(softness, impedance=(start, full, np.inf, *rest))

    def pair(touch: ContactParameters) -> ContactParameters:
        return replace(touch, softness=soft(touch.softness))

    return _surfaces(laws, lambda one: replace(one, softness=soft(one.softness)), pair)


def _with_dimension(dimension: int, laws: Laws) -> Laws:
    return _surfaces(
        laws,
        lambda one: replace(one, dimension=dimension),
        lambda touch: replace(touch, dimension=dimension),
    )


def _surfaces(
    laws: Laws,
    surface: Callable[[Surface], Surface],
    pair: Callable[[ContactParameters], ContactParameters],
) -> Laws:
    pairs = tuple((first, other, pair(touch)) for first, other, touch in laws.pairs)
    return replace(laws, surfaces=tuple(map(surface, laws.surfaces)), pairs=pairs)


def _by_step(h: float) -> Sequence[tuple[float, str]]:
    return (
        (h, "gains of drives are multiplied by the time step"),
        (1 / h, "gains of drives are divided by the time step"),
    )


def _drive_mistakes(laws: Laws) -> Iterator[tuple[str, _Change]]:
    for factor, name in (*_UNITS, *_by_step(laws.step)):
        yield name, partial(_drives, partial(_scaled, factor))
    yield "force limits of drives are ignored", _unclipped
    yield "ranges of controls are ignored", partial(_drives, partial(replace, control_range=None))


def _drives(change: Callable[[Actuator], Actuator], laws: Laws) -> Laws:
    return replace(laws, drives=tuple(map(change, laws.drives)))


def _unclipped(laws: Laws) -> Laws:
    free = _drives(partial(replace, force_range=None), laws)
    return replace(free, sums=(), joint_ranges={})


def _scaled(factor: float, drive: Actuator) -> Actuator:
    """Return a servo with other gains; a drive without feedback has none."""
    if drive.bias != "affine" or not any(drive.biases[1:3]):
        return drive
    gains = tuple(factor * gain for gain in drive.gains)
    return replace(drive, gains=gains, biases=tuple(factor * bias for bias in drive.biases))


def _merged_damping(model: LawModel) -> LawModel:
    """Return laws with the damping of servos on joints added to that of the joints."""
    links, drives = list(model.tree.tree.links), list(model.laws.drives)
    for k, servo in enumerate(drives):
        joints = model.tree.paths[servo.path].joints
        if servo.bias != "affine" or len(joints) != 1 or not servo.biases[2] or not servo.on:
            continue
        (joint, gear), (start, stiffness, damping, *rest) = joints[0], servo.biases
        added = -damping * gear**2
        links[joint] = replace(links[joint], damping=links[joint].damping + added)
        drives[k] = replace(servo, biases=(start, stiffness, 0.0, *rest))
    tree = replace(model.tree, tree=replace(model.tree.tree, links=tuple(links)))
    changed = model.under(replace(model.laws, drives=tuple(drives)))
    return replace(changed, tree=tree) if links != list(model.tree.tree.links) else changed


def _ruled(model: ImpulseModel, **rules: Any) -> ImpulseModel:
    changed = replace(model.laws.rules, **rules)
    return model.under(replace(model.laws, rules=changed))


def _joints(
    change: Callable[[HardJoint], HardJoint], model: ImpulseModel, only: int = -1
) -> ImpulseModel:
    joints = tuple(
        change(joint) if only in (-1, k) else joint for k, joint in enumerate(model.laws.joints)
    )
    return model.under(replace(model.laws, joints=joints))


def _without_limits(joint: HardJoint) -> HardJoint:
    return replace(joint, lower=1.0, upper=0.0) if joint.lower <= joint.upper else joint


def _without_effort(joint: HardJoint) -> HardJoint:
    return replace(joint, effort=ENDLESS_EFFORT) if joint.effort > 0 else joint


ENDLESS_EFFORT = 1e12
"""Effort that no motor reaches, N or N m."""


T = TypeVar("T")


def changed_step(model: LawModel, other: LawModel, solved: LawSolution) -> tuple[Array, LawStep]:
    """Return accelerations and the step under other numbers on the same tree, to first order.

    They are those of `solved` where nothing that differs acts.

    Args:
        model: the laws that `solved` solves.
        other: the same tree under other laws.
        solved: one state.
    """
    first, second = differing(model.laws, other.laws)
    force = np.zeros(len(solved.acceleration))
    contacts = _contacts(first, second, solved.contacts)
    for laws, sign in ((first, -1.0), (second, 1.0)):
        rows = model.under(laws).rows(solved.posture, contacts)
        if rows.kinds:
            given = solved.law.problem
            problem = rows.problem(given.mass, given.free)
            force += sign * problem.jacobian.T @ problem.forces(solved.acceleration)[0]
    driven = solved.law.driven
    if not second.drives and not force.any():
        return solved.acceleration, solved.law
    if second.drives:
        accelerations = model.weights.path_accelerations
        driven = drive(second, solved.posture, accelerations, solved.controls, solved.states)
        force += driven.joint_forces - solved.law.driven.joint_forces
    acceleration = solved.acceleration + solved.effect(force)
    return acceleration, replace(solved.law, driven=driven)


OPTIONS = (
    "step",
    "elliptic",
    "mixing",
    "friction_ratio",
    "least_friction",
    "drift",
    "sliding_drift",
    "safe",
    "light",
)
"""Numbers of the laws that all rows depend on."""


def differing(first: Laws, second: Laws) -> tuple[Laws, Laws]:
    """Return both laws without the rows, and without the drives, in which they agree."""
    same_drives = all(_equal(first, second, name) for name in ("drives", "sums", "joint_ranges"))
    if same_drives:
        first, second = replace(first, drives=()), replace(second, drives=())
    if not _same_options(first, second):
        return first, second
    limits = _differing(first.limits, second.limits)
    frictions = _differing(first.frictions, second.frictions)
    equalities = _differing(first.equalities, second.equalities)
    return (
        replace(first, limits=limits[0], frictions=frictions[0], equalities=equalities[0]),
        replace(second, limits=limits[1], frictions=frictions[1], equalities=equalities[1]),
    )


def single_changes(first: Laws, second: Laws) -> Iterator[Laws]:
    """Yield the first laws with one row of the second ones at a time, of those that differ.

    Surfaces that touch no other one are left out.
    """
    for name in ("limits", "frictions", "equalities", "surfaces", "drives"):
        rows, others = getattr(first, name), getattr(second, name)
        for i, row in enumerate(others[: len(rows)]):
            if row != rows[i] and (name != "surfaces" or any(i in pair for pair in first.touching)):
                changed: dict[str, Any] = {name: (*rows[:i], row, *rows[i + 1 :])}
                yield replace(first, **changed)
    for joint, row in second.joint_ranges.items():
        if row != first.joint_ranges.get(joint):
            yield replace(first, joint_ranges={**first.joint_ranges, joint: row})


def _equal(first: Laws, second: Laws, name: str) -> bool:
    return bool(getattr(first, name) == getattr(second, name))


def _same_options(first: Laws, second: Laws) -> bool:
    return all(_equal(first, second, name) for name in OPTIONS)


def _differing(first: Sequence[T], second: Sequence[T]) -> tuple[tuple[T, ...], tuple[T, ...]]:
    if len(first) != len(second):
        return tuple(first), tuple(second)
    rows = [pair for pair in zip(first, second, strict=True) if pair[0] != pair[1]]
    return tuple(one for one, _ in rows), tuple(two for _, two in rows)


def _contacts(first: Laws, second: Laws, contacts: Sequence[ContactPoint]) -> list[ContactPoint]:
    """Return the contacts whose numbers differ."""
    if not _same_options(first, second):
        return list(contacts)
    both = ((*laws.surfaces, *laws.compliant) for laws in (first, second))  # one is empty
    pairs = zip(*both, strict=True)
    moved = {i for i, (one, two) in enumerate(pairs) if one != two}
    stated = [{frozenset(pair[:2]): pair[2] for pair in laws.pairs} for laws in (first, second)]
    return [
        contact
        for contact in contacts
        if moved & set(contact.surfaces)
        or len({laws.get(frozenset(contact.surfaces)) for laws in stated}) > 1
    ]


def same_rule(first: Laws, second: Laws) -> bool:
    """Return whether the rule of the next state is the same for equal accelerations."""
    names = ("step", "integrator", "dampers", "damps_implicitly")
    return all(_equal(first, second, name) for name in names)
