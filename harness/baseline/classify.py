"""What became of a case that was run, for the gate and for a run that knows a baseline alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from physics_crosscheck.harness.baseline.changes import Status, compare
from physics_crosscheck.harness.baseline.entry import entry_of
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import (
    FolderFiles,
    as_now,
    dependencies,
    with_reads,
)
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.finding import AuditFinding


@dataclass(frozen=True, kw_only=True)
class Change:
    """A case against what was accepted of it.

    Attributes:
        id: the case, its system called as in the baseline.
        status: see `Status`.
        kinds: what changed: `model`, `numbers`, `engine`, `equations`, `scenario`, `tool`, `text`
            (files alone), `outcome`, `unexplained`.
        messages: sentences, the most telling first.
        size: how far a limit moved at most, relative to its movement over a segment; 0 otherwise.
        case, measured: of this run, where there is one.
        entry: what was accepted, where there is something.
        now: what would be accepted, where the case was judged and measured.
        files: hashes of what the case depends on now.
        findings: what the audit of its model finds wrong, and was not accepted.
    """

    id: CaseId
    status: Status
    kinds: tuple[str, ...] = ()
    messages: tuple[str, ...] = ()
    size: float = 0.0
    case: Case | None = field(default=None, repr=False)
    measured: Measurement | None = field(default=None, repr=False)
    entry: AcceptedCase | None = field(default=None, repr=False)
    now: AcceptedCase | None = field(default=None, repr=False)
    files: Mapping[str, str] = field(default_factory=dict, repr=False)
    findings: tuple[AuditFinding, ...] = field(default=(), repr=False)


def unaccepted(case: Case) -> str:
    """What is said of a case that the baseline does not know."""
    return f"{case.outcome}; not accepted yet"


def classify(
    system: str,
    case: Case,
    measured: Measurement | Failure | None,
    scan: FolderFiles,
    one: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
    stale: bool = False,
) -> Change:
    """Hold a case against what was accepted of it.

    Args:
        system: its name, which the case may not know where its declaration can't be loaded.
        case: its record.
        measured: what its model does, or why that is not known.
        scan: the files that it was run from.
        one: what was accepted of the system.
        versions: of the engines.
        resolution: of the run.
        stale: whether the files have changed since they were hashed.
    """
    id_ = CaseId(system=system, model=case.model, scenario=case.scenario, engine=case.engine)
    entry = one.cases.get(id_) if one else None
    model = next((m for m in scan.models if m.model == case.model), None)
    if isinstance(measured, Measurement):
        files = with_reads(model, measured.reads)
    else:
        files = {} if model is None else as_now(model, entry.files if entry else {})
    if not isinstance(measured, Measurement) or stale or _failed(case):
        return Change(
            id=id_,
            status=Status.NOT_RUN,
            messages=(_why_not_run(case, measured, stale),),
            case=case,
            entry=entry,
            files=files,
        )
    now = entry_of(id_, case, measured, dependencies(files, case.engine, versions, resolution))
    if entry is None or one is None:
        return Change(
            id=id_,
            status=Status.NEW,
            messages=(unaccepted(case),),
            case=case,
            measured=measured,
            now=now,
            files=files,
        )
    found = compare(entry, now, one.snapshots[entry.snapshot], measured)
    return Change(
        id=id_,
        status=found.status,
        kinds=found.kinds,
        messages=(*found.messages, *found.causes),
        size=found.size,
        case=case,
        measured=measured,
        entry=entry,
        now=now,
        files=files,
    )


def _failed(case: Case) -> bool:
    return not case.outcome.is_run


def _why_not_run(case: Case, measured: Measurement | Failure | None, stale: bool) -> str:
    if _failed(case):
        return f"{case.outcome}: {case.reason}"
    if stale:
        return "its files changed during the run; run it again"
    reason = "it was not measured"
    if measured is not None and not isinstance(measured, Measurement):
        reason = measured.reason
    return f"its motion could not be measured: {reason}"
