"""Exchanged values of two constants with the same unit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from physics_crosscheck.harness.modelfiles.bindings import at_constants, bindings
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.declaration import DeclarationError


def exchanges(subject: Subject) -> Iterator[Mistake]:
    """Yield each pair of such constants in the model, exchanged in all of their literals."""
    system, sidecar = subject.task.target.system, subject.task.declared
    for first, second in combinations(system.constants, 2):
        if first.unit != second.unit or first.value == second.value:
            continue
        try:
            swapped = at_constants(system, {first.name: second.value, second.name: first.value})
        except DeclarationError:
            continue  # only one of them is positive
        changed = {b.address: b.expected for b in bindings(swapped, sidecar) if not b.exact}
        if not all(_stated(subject, c.name) for c in (first, second)):
            continue
        names = f"{first.name}, {second.name}"
        causes = literal_causes(*changed) | {
            CauseId(kind="exchange", subject=(first.name, second.name)),
            *(CauseId(kind="constant", subject=(c.name,)) for c in (first, second)),
        }
        yield Mistake("two constants exchanged", names, Edit(changed), causes)


def _stated(subject: Subject, name: str) -> bool:
    """Return whether a literal depends on a constant."""
    system, sidecar = subject.task.target.system, subject.task.declared
    value = next(c.value for c in system.constants if c.name == name)
    moved = at_constants(system, {name: 1.01 * value})
    return any(not b.exact for b in bindings(moved, sidecar))
