"""One audit from end to end: literals, compiled terms, and what the engine does on its own."""

from __future__ import annotations

from collections.abc import Set

import msgspec

from harness.audit.finding import finding
from harness.audit.literals import declared_bindings, literal_findings
from harness.audit.remarks import Remark, remarks
from harness.audit.task import AuditTask
from harness.audit.terms import Compiled
from harness.engines.registry import engines
from harness.numerics.coordinates import coordinate_map
from harness.records.base import SourceLine
from harness.records.finding import AuditFinding


def run_audit(task: AuditTask) -> tuple[AuditFinding, ...]:
    """The audit's findings: literals, compiled terms, then what the engine does on its own.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    declared, lost = declared_bindings(task.system, task.sidecar)
    literals = (*literal_findings(declared), *lost)
    model = engines()[task.engine].load(task.sidecar.spec(task.engine))
    coordinates = coordinate_map(task.system, task.sidecar, model.coordinates)
    rounded = max((abs(b.error) for b in declared if b.rounded), default=0.0)
    compiled = [
        _explained(one, rounded) for one in Compiled.of(task, model, coordinates).findings()
    ]
    z, w = coordinates.to_engine(task.states)
    wrong = {one.kind for one in compiled if one.severity == "finding"}
    defaults = (_default(remark, wrong) for remark in remarks(task, model, z, w))
    return (*literals, *compiled, *defaults)


def _explained(found: AuditFinding, rounded: float) -> AuditFinding:
    """A note for a difference that rounded literals account for; they have notes of their own."""
    if found.expected is None or found.found is None or found.severity != "finding":
        return found
    if abs(found.found - found.expected) > 10 * rounded * abs(found.expected):
        return found
    message = f"{found.message}; no more than its rounded literals"
    return msgspec.structs.replace(found, message=message, severity="note")


def _default(remark: Remark, wrong: Set[str]) -> AuditFinding:
    """A remark that enters a wrong term is a finding; one that enters right ones is a note."""
    blamed = remark.fault or wrong & set(remark.shows_in)
    return finding(
        "default",
        remark.message,
        where=_source_line(remark.where),
        found=remark.value,
        severity="finding" if blamed else "note",
    )


def _source_line(where: str) -> SourceLine | None:
    file, _, line = where.rpartition(":")
    if line.isdigit():
        return SourceLine(file=file, line=int(line))
    return SourceLine(file=where, line=None) if where else None
