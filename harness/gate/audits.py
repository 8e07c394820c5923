"""Audit findings in the gate's result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from physics_crosscheck.harness.baseline.audits import unaccepted
from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.status import counted

MOST_TOLD = 5
"""Maximum number of findings reported for a case."""


def with_audits(
    changes: Sequence[Change], results: Results, systems: Mapping[str, SystemBaseline]
) -> list[Change]:
    """Add new audit findings to the cases that were run.

    A wrong number counts even if no motion depends on it. A model whose audit failed counts as not
    run.

    Args:
        changes: the changes of the cases.
        results: results of the run, with the audits.
        systems: the accepted results, by name of the system.
    """
    moved = {change.id.of_model for change in changes if not change.status.passes}
    return [_with_audit(change, results, systems, moved) for change in changes]


def _with_audit(
    change: Change, results: Results, systems: Mapping[str, SystemBaseline], moved: Set[ModelId]
) -> Change:
    of_model, system_baseline = change.id.of_model, systems.get(change.id.system)
    model = None if change.case is None else results.model_of(change.case)
    if model is None or change.status is Status.NOT_RUN:
        return change
    if model.audit is None:
        failed = f"its audit failed: {model.audit_failure or 'it did not run'}"
        return replace(change, status=Status.NOT_RUN, messages=(failed, *change.messages))
    new = unaccepted(
        model, None if system_baseline is None else system_baseline.audits.get(of_model)
    )
    if not new or (change.status.passes and of_model in moved):
        return change
    messages = (*change.messages, *_told(new))
    if of_model in moved:  # a motion shows it too, in this case or another
        return replace(change, messages=messages, findings=new)
    kinds = tuple(kind for kind in change.kinds if kind != "text")
    return replace(
        change, status=Status.CHANGED, kinds=(*kinds, "audit"), messages=messages, findings=new
    )


def _told(findings: tuple[AuditFinding, ...]) -> list[str]:
    messages = [
        (f"the audit finds {finding.location}: " if finding.location else "the audit: ")
        + finding.message
        for finding in findings[:MOST_TOLD]
    ]
    more = len(findings) - MOST_TOLD
    return messages + ([f"and {counted(more, 'finding')} more"] if more > 0 else [])
