"""One audit from end to end: literals, compiled terms, and what the engine does on its own."""

from __future__ import annotations

from collections.abc import Set

import msgspec

from harness.audit.finding import finding
from harness.audit.literals import declared_bindings, literal_findings
from harness.audit.remarks import where
from harness.audit.task import AuditTask
from harness.audit.terms import Compiled
from harness.engines.registry import engines
from harness.engines.remark import Remark
from harness.numerics.coordinates import coordinate_map
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
    defaults = (_default(remark, wrong, task) for remark in model.remarks(z, w))
    return (*literals, *compiled, *defaults)


def _explained(found: AuditFinding, rounded: float) -> AuditFinding:
    """A note for a difference that rounded literals account for; they have notes of their own."""
    if found.expected is None or found.found is None or found.severity != "finding":
        return found
    if abs(found.found - found.expected) > 10 * rounded * abs(found.expected):
        return found
    message = f"{found.message}; no more than its rounded literals"
    return msgspec.structs.replace(found, message=message, severity="note")


def _default(remark: Remark, wrong: Set[str], task: AuditTask) -> AuditFinding:
    """A remark that enters a wrong term is a finding; one that enters right ones is a note."""
    blamed = remark.fault or wrong & set(remark.shows_in)
    return finding(
        "default",
        remark.message,
        where=where(remark, task.sidecar, task.engine),
        found=remark.value,
        severity="finding" if blamed else "note",
    )
