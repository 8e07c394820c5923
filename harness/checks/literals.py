"""Comparison of the literals of a model file with the constants that they are bound to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from physics_crosscheck.harness.checks.audit_finding import finding, source_line
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.modelfiles.bindings import Binding, bindings
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.reference.mechanism.system import System

MOST_LOST = 10
"""Maximum number of unreadable bindings that are reported one by one."""


def declared_bindings(
    system: System, sidecar: Sidecar
) -> tuple[tuple[Binding, ...], tuple[AuditFinding, ...]]:
    """Return every readable binding, and a finding for each unreadable one.

    After ten unreadable bindings the rest are not checked; one finding counts them.
    """
    try:
        return bindings(system, sidecar), ()
    except (LocationError, SidecarError):
        readable: list[Binding] = []
        lost: list[AuditFinding] = []
        for i, (address, expression) in enumerate(sidecar.bindings.items()):
            try:
                single = replace(sidecar, bindings={address: expression})
                readable += bindings(system, single)
            except (LocationError, SidecarError) as error:
                lost.append(finding("binding", (address,), f"the binding can't be read: {error}"))
            if len(lost) == MOST_LOST and i + 1 < len(sidecar.bindings):
                remaining = len(sidecar.bindings) - i - 1
                rest = (
                    f"{remaining} more bindings were not checked, after {MOST_LOST} unreadable ones"
                )
                lost.append(finding("binding", ("bindings",), f"{rest}; fix these first"))
                break
        if not lost:
            raise  # the error is between two bindings
        return tuple(readable), tuple(lost)


def literal_findings(declared: tuple[Binding, ...]) -> Iterator[AuditFinding]:
    """Yield a finding for each literal that differs from its expression, a note for a
    rounded one.
    """
    for b in declared:
        if b.exact:
            continue
        stated = f"{b.address} is {b.place.text}"
        declared_value = f"{b.expression} = {b.correction!r}"
        error = f"{'relative ' if b.expected else ''}error {abs(b.error):.1e}"
        if b.rounded:
            message = f"{stated}, which is {declared_value} rounded ({error})"
        else:
            message = f"{stated}, but {declared_value} ({error})"
        yield finding(
            "rounded" if b.rounded else "literal",
            (b.address,),
            message,
            location=source_line(b.place),
            expected=b.expected,
            found=b.value,
            replacement="" if b.rounded else repr(b.correction),
            severity="note" if b.rounded else "finding",
        )
