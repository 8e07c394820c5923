"""Built-in systems, prepared once, and audits of their models."""

from collections.abc import Callable, Iterable
from pathlib import Path

from physics_crosscheck.harness.checks.audit import audit_declared
from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.records import AuditFinding

MODELS = Path(__file__).parents[2] / "models"

AuditCopy = Callable[..., tuple[AuditFinding, ...]]


def audit(prepared: PreparedSystem, sidecar: Sidecar, engine: str) -> tuple[AuditFinding, ...]:
    return audit_declared(model_task(prepared, engine, sidecar)).findings


def messages(findings: Iterable[AuditFinding], kind: str, severity: str = "finding") -> str:
    return "\n".join(f.message for f in findings if f.kind == kind and f.severity == severity)


def severe(findings: Iterable[AuditFinding]) -> list[AuditFinding]:
    return [f for f in findings if f.severity == "finding"]
