"""Comparison of audit findings with the accepted ones."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.records.baseline import AcceptedAudit, AcceptedFinding
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.finding import SAME, AuditFinding, is_near
from physics_crosscheck.harness.records.model import Model


def unaccepted(model: Model, audit: AcceptedAudit | None) -> tuple[AuditFinding, ...]:
    """Return the findings about a model that were not accepted."""
    accepted = () if audit is None else audit.findings
    return tuple(
        finding
        for finding in model.findings
        if not any(_same(_plain(finding, model), a) for a in accepted)
    )


def accepted_audit(
    id_: ModelId, model: Model, before: AcceptedAudit | None, reason: str
) -> AcceptedAudit | None:
    """Return the findings to accept for a model: the old ones if nothing is new; None without any.

    Args:
        id_: name of the model, with its system's name in the baseline.
        model: its record.
        before: the accepted findings.
        reason: reason for accepting them.
    """
    findings = tuple(_plain(finding, model) for finding in model.findings)
    if not findings:
        return None
    if (
        before is not None
        and len(before.findings) == len(findings)
        and not unaccepted(model, before)
    ):
        return before
    return AcceptedAudit(
        system=id_.system, model=id_.model, engine=id_.engine, reason=reason, findings=findings
    )


def _plain(finding: AuditFinding, model: Model) -> AcceptedFinding:
    """Convert a finding for the baseline, without the path of its folder on this machine."""
    folder = Path(model.folder)
    folder = folder.parent if folder.name == model.model else folder
    base = "" if folder == Path() else f"{folder}/"
    return AcceptedFinding(
        kind=finding.kind,
        subject=tuple(part.replace(base, "") for part in finding.subject),
        message=finding.message.replace(base, ""),
        expected=finding.expected,
        found=finding.found,
    )


def _same(finding: AcceptedFinding, other: AcceptedFinding) -> bool:
    """Return whether two findings are equal; numbers of a literal must be exactly equal."""
    tolerance = 0.0 if finding.kind == "literal" else SAME
    return (
        (finding.kind, finding.subject) == (other.kind, other.subject)
        and is_near(finding.expected, other.expected, tolerance)
        and is_near(finding.found, other.found, tolerance)
    )
