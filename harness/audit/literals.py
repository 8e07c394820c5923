"""Literals against their bindings: what the file says, and what the constants say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from harness.audit.finding import finding, source_line
from harness.files.bindings import Binding, bindings
from harness.files.locations import LocationError
from harness.files.sidecar import Sidecar, SidecarError
from harness.records.finding import AuditFinding
from reference.system import System


def declared_bindings(
    system: System, sidecar: Sidecar
) -> tuple[tuple[Binding, ...], tuple[AuditFinding, ...]]:
    """Every binding that can be read, and a finding for each that can't."""
    try:
        return bindings(system, sidecar), ()
    except (LocationError, SidecarError):
        found: list[Binding] = []
        lost = []
        for address, expression in sidecar.bindings.items():
            try:
                alone = replace(sidecar, bindings={address: expression})
                found += bindings(system, alone)
            except (LocationError, SidecarError) as error:
                lost.append(finding("literal", f"the binding can't be read: {error}"))
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
            message,
            where=source_line(b.place),
            expected=b.expected,
            found=b.value,
            severity="note" if b.rounded else "finding",
        )
