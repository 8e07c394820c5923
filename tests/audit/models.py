"""Built-in systems, prepared once, and what an audit of a model says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from physics_crosscheck.harness.checks.audit import audit_declared
from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.finding import AuditFinding

MODELS = Path(__file__).parents[2] / "models"

Look = Callable[..., tuple[AuditFinding, ...]]


def audit(prepared: PreparedSystem, sidecar: Sidecar, engine: str) -> tuple[AuditFinding, ...]:
    return audit_declared(model_task(prepared, engine, sidecar)).findings


def said(found: Iterable[AuditFinding], kind: str, severity: str = "finding") -> str:
    """The messages of one kind, as one text."""
    return "\n".join(f.message for f in found if f.kind == kind and f.severity == severity)


def grave(found: Iterable[AuditFinding]) -> list[AuditFinding]:
    return [f for f in found if f.severity == "finding"]
