"""First-order effect of other numbers of the laws on accelerations and the next state.

Only the rows and drives whose numbers differ are evaluated again, at the solution of the first
laws: the change of the gradient there, times the inverse of the Hessian, is the effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from physics_crosscheck.reference.laws.drives import drive
from physics_crosscheck.reference.laws.step import LawModel, LawSolution, LawStep
from physics_crosscheck.reference.mechanism.laws import ContactPoint, Laws
from physics_crosscheck.reference.mechanism.numeric import Array

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
