"""One audit from end to end: literals, compiled terms, and what the engine does on its own."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from typing import Any

from harness.audit.finding import Finding
from harness.audit.literals import declared_bindings, literal_findings
from harness.audit.remarks import where
from harness.audit.task import AuditTask, audit_task
from harness.audit.terms import Compiled
from harness.cases.prepare import Prepared
from harness.engines.registry import engines
from harness.engines.remark import Remark
from harness.files.sidecar import Sidecar
from harness.numerics.coordinates import coordinate_map


def run_audit(task: AuditTask) -> list[dict[str, Any]]:
    """The audit's findings as records: {kind, message, where, expected, found, severity}."""
    return [finding.record() for finding in _audit(task)]


def audit(prepared: Prepared, sidecar: Sidecar, engine: str) -> tuple[Finding, ...]:
    """Audit a model file in one engine.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    return _audit(audit_task(prepared, sidecar, engine))


def _audit(task: AuditTask) -> tuple[Finding, ...]:
    declared, lost = declared_bindings(task.system, task.sidecar)
    literals = (*literal_findings(declared), *lost)
    model = engines()[task.engine].load(task.sidecar.spec(task.engine))
    coordinates = coordinate_map(task.system, task.sidecar, model.coordinates)
    compiled = tuple(Compiled.of(task, model, coordinates).findings())
    rounded = max((abs(b.error) for b in declared if b.rounded), default=0.0)
    compiled = tuple(_explained(finding, rounded) for finding in compiled)
    z, w = coordinates.to_engine(task.states)
    wrong = {finding.kind for finding in compiled if finding.severity == "finding"}
    defaults = tuple(_default(r, wrong, task) for r in model.remarks(z, w))
    return (*literals, *compiled, *defaults)


def _explained(finding: Finding, rounded: float) -> Finding:
    """A note for a difference that rounded literals account for; they have notes of their own."""
    if finding.expected is None or finding.found is None or finding.severity != "finding":
        return finding
    if abs(finding.found - finding.expected) > 10 * rounded * abs(finding.expected):
        return finding
    message = f"{finding.message}; no more than its rounded literals"
    return replace(finding, message=message, severity="note")


def _default(remark: Remark, wrong: Set[str], task: AuditTask) -> Finding:
    """A remark that enters a wrong term is a finding; one that enters right ones is a note."""
    severity = "finding" if remark.fault or wrong & set(remark.shows_in) else "note"
    place = where(remark, task.sidecar, task.engine)
    return Finding("default", remark.message, place, None, remark.value, severity)
