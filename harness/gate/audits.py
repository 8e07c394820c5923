"""What the audit says of a model that was run, in what the gate says of its cases."""

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
"""Findings told of a case."""


def with_audits(
    changes: Sequence[Change], results: Results, systems: Mapping[str, SystemBaseline]
) -> list[Change]:
    """The cases that were run, with what the audits find wrong and was not accepted.

    A number that no motion depends on is wrong all the same. What could not be audited did not run.

    Args:
        changes: what became of the cases.
        results: of the run, with the audits.
        systems: what was accepted, by name.
    """
    moved = {change.id.of_model for change in changes if not change.status.passes}
    return [_with_audit(change, results, systems, moved) for change in changes]


def _with_audit(
    change: Change, results: Results, systems: Mapping[str, SystemBaseline], moved: Set[ModelId]
) -> Change:
    of_model, one = change.id.of_model, systems.get(change.id.system)
    model = None if change.case is None else results.model_of(change.case)
    if model is None or change.status is Status.NOT_RUN:
        return change
    if model.audit is None:
        failed = f"its audit failed: {model.audit_failure or 'it did not run'}"
        return replace(change, status=Status.NOT_RUN, messages=(failed, *change.messages))
    new = unaccepted(model, None if one is None else one.audits.get(of_model))
    if not new or (change.status.passes and of_model in moved):
        return change
    told = (*change.messages, *_told(new))
    if of_model in moved:  # a motion tells it too, in this case or another
        return replace(change, messages=told, findings=new)
    kinds = tuple(kind for kind in change.kinds if kind != "text")
    return replace(
        change, status=Status.CHANGED, kinds=(*kinds, "audit"), messages=told, findings=new
    )


def _told(findings: tuple[AuditFinding, ...]) -> list[str]:
    told = [
        (f"the audit finds {one.location}: " if one.location else "the audit: ") + one.message
        for one in findings[:MOST_TOLD]
    ]
    more = len(findings) - MOST_TOLD
    return told + ([f"and {counted(more, 'finding')} more"] if more > 0 else [])
