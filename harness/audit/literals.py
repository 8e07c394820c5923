"""Literals against their bindings: what the file says, and what the constants say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from physics_crosscheck.harness.audit.finding import finding, source_line
from physics_crosscheck.harness.files.bindings import Binding, bindings
from physics_crosscheck.harness.files.locations import LocationError
from physics_crosscheck.harness.files.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.reference.system import System

MOST_LOST = 10
"""Bindings that can't be read and are told one by one."""


def declared_bindings(
    system: System, sidecar: Sidecar
) -> tuple[tuple[Binding, ...], tuple[AuditFinding, ...]]:
    """Every binding that can be read, and a finding for each that can't.

    Beyond some that can't, the rest are not looked at: one finding says how many they are.
    """
    try:
        return bindings(system, sidecar), ()
    except (LocationError, SidecarError):
        found: list[Binding] = []
        lost: list[AuditFinding] = []
        for i, (address, expression) in enumerate(sidecar.bindings.items()):
            try:
                alone = replace(sidecar, bindings={address: expression})
                found += bindings(system, alone)
            except (LocationError, SidecarError) as error:
                lost.append(finding("literal", (address,), f"the binding can't be read: {error}"))
            if len(lost) == MOST_LOST and i + 1 < len(sidecar.bindings):
                left = len(sidecar.bindings) - i - 1
                rest = f"{left} more bindings were not looked at, after {MOST_LOST} that can't be"
                lost.append(finding("literal", ("bindings",), f"{rest} read; mend these first"))
                break
        if not lost:
            raise  # what is wrong is between two of them
        return tuple(found), tuple(lost)


def literal_findings(declared: tuple[Binding, ...]) -> Iterator[AuditFinding]:
    """A finding for each literal that is not its expression, a note for each that is rounded."""
    for b in declared:
        if b.exact:
            continue
        says = f"{b.address} is {b.place.text}"
        is_to_be = f"{b.expression} = {b.correction!r}"
        off = f"{abs(b.error):.1e} {'relative' if b.expected else 'off'}"
        if b.rounded:
            message = f"{says}, {is_to_be} rounded to its digits ({off})"
        else:
            message = f"{says} where {is_to_be} ({off})"
        yield finding(
            "literal",
            (b.address,),
            message,
            location=source_line(b.place),
            expected=b.expected,
            found=b.value,
            replacement="" if b.rounded else repr(b.correction),
            severity="note" if b.rounded else "finding",
        )
