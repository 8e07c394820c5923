"""What the audit says of a model that was run, in what the gate says of its cases."""

from __future__ import annotations

from dataclasses import replace

from harness.baseline.audits import unaccepted
from harness.baseline.changes import Status
from harness.baseline.classify import Change
from harness.baseline.file import SystemBaseline
from harness.records.finding import AuditFinding
from harness.records.model import Model

MOST_TOLD = 5
"""Findings told of a case."""


def with_audit(change: Change, model: Model | None, one: SystemBaseline | None) -> Change:
    """A case that was run, with what the audit of its model finds wrong and was not accepted.

    A number that no motion depends on is wrong all the same. What could not be audited did not run.

    Args:
        change: what became of the case.
        model: the record of its model; None where it was not begun.
        one: what was accepted of the system.
    """
    if model is None or change.status is Status.NOT_RUN:
        return change
    if model.audit is None:
        failed = f"its audit failed: {model.audit_failure or 'it was not done'}"
        return replace(change, status=Status.NOT_RUN, messages=(failed, *change.messages))
    new = unaccepted(model, None if one is None else one.audits.get(change.id.of_model))
    if not new:
        return change
    kinds = [kind for kind in change.kinds if kind != "text"]
    return replace(
        change,
        status=change.status if change.status is Status.NEW else Status.CHANGED,
        kinds=(*kinds, "audit"),
        messages=(*change.messages, *_told(new)),
        findings=new,
    )


def _told(findings: tuple[AuditFinding, ...]) -> list[str]:
    told = [
        f"the audit finds {one.where}: {one.message}" if one.where else f"the audit: {one.message}"
        for one in findings[:MOST_TOLD]
    ]
    more = len(findings) - MOST_TOLD
    return told + ([f"and {more} findings more"] if more > 0 else [])
