"""Built-in systems, prepared once, and what an audit of a model says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from physics_crosscheck.harness.checks.audit import run_audit
from physics_crosscheck.harness.checks.audit_task import audit_task
from physics_crosscheck.harness.checks.prepare import Prepared
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.finding import AuditFinding

MODELS = Path(__file__).parents[2] / "models"

Look = Callable[..., tuple[AuditFinding, ...]]


def audit(prepared: Prepared, sidecar: Sidecar, engine: str) -> tuple[AuditFinding, ...]:
    return run_audit(audit_task(prepared, sidecar, engine)).findings


def said(found: Iterable[AuditFinding], kind: str, severity: str = "finding") -> str:
    """The messages of one kind, as one text."""
    return "\n".join(f.message for f in found if f.kind == kind and f.severity == severity)


def grave(found: Iterable[AuditFinding]) -> list[AuditFinding]:
    return [f for f in found if f.severity == "finding"]
