"""What an audit finds wrong against what was accepted of that."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.records.baseline import AcceptedAudit, AcceptedFinding
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.finding import SAME, AuditFinding, is_near
from physics_crosscheck.harness.records.model import Model


def unaccepted(model: Model, audit: AcceptedAudit | None) -> tuple[AuditFinding, ...]:
    """What is found wrong with a model and was not accepted."""
    known = () if audit is None else audit.findings
    return tuple(
        one for one in model.findings if not any(_same(_plain(one, model), a) for a in known)
    )


def accepted_audit(
    id_: ModelId, model: Model, before: AcceptedAudit | None, reason: str
) -> AcceptedAudit | None:
    """What is to be accepted of a model's audit; as it was where nothing is new; None for nothing.

    Args:
        id_: the model, its system called as in the baseline.
        model: its record.
        before: what was accepted of it.
        reason: why it is accepted.
    """
    findings = tuple(_plain(one, model) for one in model.findings)
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


def _plain(one: AuditFinding, model: Model) -> AcceptedFinding:
    """A finding without the place of this machine that its folder is in."""
    folder = Path(model.folder)
    folder = folder.parent if folder.name == model.model else folder
    base = "" if folder == Path() else f"{folder}/"
    return AcceptedFinding(
        kind=one.kind,
        subject=tuple(part.replace(base, "") for part in one.subject),
        message=one.message.replace(base, ""),
        expected=one.expected,
        found=one.found,
    )


def _same(one: AcceptedFinding, other: AcceptedFinding) -> bool:
    """Whether a finding was accepted; the numbers of a literal are the file's, and exact."""
    tolerance = 0.0 if one.kind == "literal" else SAME
    return (
        (one.kind, one.subject) == (other.kind, other.subject)
        and is_near(one.expected, other.expected, tolerance)
        and is_near(one.found, other.found, tolerance)
    )
