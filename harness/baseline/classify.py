"""Changes of cases that were run, for the gate and for a run with a baseline."""

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
from physics_crosscheck.harness.records.outcome import Outcome


@dataclass(frozen=True, kw_only=True)
class Change:
    """A case compared with its accepted result.

    Attributes:
        id: the case, its system called as in the baseline.
        status: see `Status`.
        kinds: what changed: `model`, `numbers`, `engine`, `equations`, `scenario`, `tool`, `text`
            (files alone), `outcome`, `unexplained`.
        messages: sentences, most important first.
        size: largest change of the motion, relative to its displacement over a segment.
        case, measured: of this run, if it ran.
        entry: the accepted result, if there is one.
        now: the result to accept, if the case was judged and measured.
        files: hashes of the files that the case depends on.
        findings: findings of the audit that were not accepted.
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
    """Return the message about a case that is not in the baseline."""
    return f"{case.outcome}, not in the baseline yet"


def classify(
    system: str,
    case: Case,
    measured: Measurement | Failure | None,
    scan: FolderFiles,
    accepted: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
    stale: bool = False,
) -> Change:
    """Compare a case with its accepted result.

    Args:
        system: name of the system; the case lacks it if its declaration could not be loaded.
        case: record of the case.
        measured: measurement of its model, or the reason for its absence.
        scan: the files of the run.
        accepted: the baseline of the system.
        versions: of the engines.
        resolution: of the run.
        stale: whether the files have changed since they were hashed.
    """
    id_ = CaseId(system=system, model=case.model, scenario=case.scenario, engine=case.engine)
    entry = accepted.cases.get(id_) if accepted else None
    model = next((m for m in scan.models if m.model == case.model), None)
    if isinstance(measured, Measurement):
        files = with_reads(model, measured.reads)
    else:
        files = {} if model is None else as_now(model, entry.files if entry else {})
    refused = case.outcome is Outcome.REFUSED
    done = refused or (isinstance(measured, Measurement) and case.outcome.is_run)
    if not done or stale:
        return Change(
            id=id_,
            status=Status.NOT_RUN,
            messages=(_why_not_run(case, measured, stale),),
            case=case,
            entry=entry,
            files=files,
        )
    motion = measured if isinstance(measured, Measurement) else None
    now = entry_of(id_, case, motion, dependencies(files, case.engine, versions, resolution))
    if entry is None or accepted is None:
        return Change(
            id=id_,
            status=Status.NEW,
            messages=(unaccepted(case), *([case.reason] if refused else [])),
            case=case,
            measured=motion,
            now=now,
            files=files,
        )
    difference = compare(entry, now, accepted.snapshot(id_), motion)
    return Change(
        id=id_,
        status=difference.status,
        kinds=difference.kinds,
        messages=(*difference.messages, *difference.causes),
        size=difference.size,
        case=case,
        measured=motion,
        entry=entry,
        now=now,
        files=files,
    )


def _why_not_run(case: Case, measured: Measurement | Failure | None, stale: bool) -> str:
    if not case.outcome.is_run and case.outcome is not Outcome.REFUSED:
        return f"{case.outcome}: {case.reason}"
    if stale:
        return "its files changed during the run; run it again"
    why = f": {measured.reason}" if isinstance(measured, Failure) else ""
    return f"its motion could not be measured{why}"
