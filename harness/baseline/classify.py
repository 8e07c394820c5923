"""Changes of cases and audits that were run, for the gate and for a run with a baseline."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.records.base import Number, record_of
from physics_crosscheck.harness.records.baseline import (
    AcceptedAudit,
    AcceptedCase,
    AcceptedFinding,
    Measurement,
)
from physics_crosscheck.harness.records.case import Case, CaseId, ModelId
from physics_crosscheck.harness.records.diff import Diff, Status, bare_diff, numbers_of
from physics_crosscheck.harness.records.finding import SAME, AuditFinding, is_near
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from .content import content_hashes
from .diff import changed_dependencies, diff_accepted
from .file import SystemBaseline, snapshot_key
from .fingerprint import Dependencies, FolderFiles, as_now, dependencies, with_reads

UNTESTED = "nothing that is measured here depends on the edit, so it is not tested"
NO_ENGINE = (
    "every engine refuses the file, so its edit is not tested;"
    " `crosscheck accept --untested` accepts it"
)
"""Messages about edits of robot files."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """A case compared with its accepted result, and what it was compared from.

    Attributes:
        diff: the difference; its system is called as in the baseline.
        case, measured: of this run, if it ran.
        entry: the accepted result, if there is one.
        now: the result to accept, if the case was judged and measured.
        files: hashes of the files that the case depends on.
        findings: findings of the audit that were not accepted.
    """

    diff: Diff
    case: Case | None = field(default=None, repr=False)
    measured: Measurement | None = field(default=None, repr=False)
    entry: AcceptedCase | None = field(default=None, repr=False)
    now: AcceptedCase | None = field(default=None, repr=False)
    files: Mapping[str, str] = field(default_factory=dict, repr=False)
    findings: tuple[AuditFinding, ...] = field(default=(), repr=False)

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return self.diff.id

    @property
    def status(self) -> Status:
        """Status of the case."""
        return self.diff.status

    @property
    def kinds(self) -> tuple[str, ...]:
        """Reasons for the change."""
        return self.diff.kinds

    @property
    def messages(self) -> tuple[str, ...]:
        """Explanations, most important first."""
        return self.diff.messages


def unaccepted(case: Case) -> str:
    """Return the message about a case that is not in the baseline."""
    return f"{case.outcome}, not in the baseline yet"


def gone(entry: AcceptedCase) -> Diff:
    """Return the difference of an accepted case that no longer exists."""
    message = "accepted, but the case no longer exists"
    return bare_diff(entry.id, Status.GONE, (message,), before=entry.numbers)


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
    motion = measured if isinstance(measured, Measurement) else None
    if not done or stale:
        return Change(
            diff=bare_diff(
                id_,
                Status.NOT_RUN,
                (_why_not_run(case, measured, stale),),
                before=None if entry is None else entry.numbers,
                after=numbers_of(case),
            ),
            case=case,
            entry=entry,
            files=files,
        )
    depends = dependencies(files, case.engine, versions, resolution)
    content = msgspec.UNSET if scan.robot is None else content_hashes(scan.folder)
    now = entry_of(id_, case, motion, depends, content)
    if entry is None or accepted is None:
        messages = (unaccepted(case), *([case.reason] if refused else []))
        diff = bare_diff(id_, Status.NEW, messages, after=now.numbers)
    else:
        diff = diff_accepted(entry, now, accepted.snapshot(id_), motion)
        causes = changed_dependencies(entry, now)
        sentences = (causes[cause] for cause in ("engine", "tool") if cause in causes)
        diff = msgspec.structs.replace(diff, messages=(*diff.messages, *sentences))
        if scan.robot is not None:
            diff = _with_edits(diff, entry, now, accepted)
    return Change(diff=diff, case=case, measured=motion, entry=entry, now=now, files=files)


def _with_edits(
    diff: Diff, entry: AcceptedCase, now: AcceptedCase, accepted: SystemBaseline
) -> Diff:
    """Return the difference of a robot file; an edit of its statements never passes.

    It fails if no engine loads the file, and if nothing that was measured depends on the edit.
    """
    is_edited = entry.files != now.files and entry.content != now.content
    if now.outcome is Outcome.REFUSED and diff.status is Status.EXPECTED:
        if entry.files == now.files or not accepted.is_untested:
            return diff
        return msgspec.structs.replace(diff, status=Status.NOT_RUN, messages=(NO_ENGINE,))
    if not is_edited or not diff.status.passes or entry.outcome is Outcome.REFUSED:
        return diff
    kinds = [kind for kind in diff.kinds if kind != "text"]
    messages = diff.messages
    if not diff.changed:
        kinds, messages = ["untested", *kinds], (UNTESTED, *messages)
    return msgspec.structs.replace(
        diff, status=Status.CHANGED, kinds=tuple(kinds or ["model"]), messages=messages
    )


def _why_not_run(case: Case, measured: Measurement | Failure | None, stale: bool) -> str:
    if not case.outcome.is_run and case.outcome is not Outcome.REFUSED:
        return f"{case.outcome}: {case.reason}"
    if stale:
        return "its files changed during the run; run it again"
    why = f": {measured.reason}" if isinstance(measured, Failure) else ""
    return f"its motion could not be measured{why}"


def entry_of(
    case_id: CaseId,
    case: Case,
    measured: Measurement | None,
    now: Dependencies,
    content: dict[str, str] | msgspec.UnsetType = msgspec.UNSET,
) -> AcceptedCase:
    """Build the baseline entry of a case that was judged and measured, without a reason yet.

    Args:
        case_id: name of the case, with its system's name in the baseline.
        case: record of the case.
        measured: measurement of its model; None for a file that the engine refuses.
        now: present dependencies of the case.
        content: hashes of the statements in a robot's files.
    """
    assert case.verdict is not None or measured is None  # measured cases have a verdict
    numbers, full_run = numbers_of(case), case.full_run
    robot = measured if measured and measured.integrator else None
    return summarized(
        AcceptedCase(
            system=case_id.system, model=case_id.model, scenario=case_id.scenario,
            engine=case_id.engine, summary="", reason="", outcome=case.outcome,
            outcome_reason=case.reason.replace(f"{case.folder}: ", f"{case.model}: "),
            discrepancy=numbers.discrepancy, uncertainty=numbers.uncertainty,
            component=numbers.component, constants=measured.constants if measured else {},
            global_error=numbers.global_error, global_order=full_run.order if full_run else None,
            time_step=robot.time_step if robot else numbers.time_step,
            integrator=robot.integrator if robot else numbers.integrator, order=numbers.order,
            claimed_order=numbers.claimed_order, engine_version=now.engine_version,
            resolution=now.resolution, numerics=now.numerics, files=dict(now.files),
            snapshot=snapshot_key(measured.snapshot) if measured else "",
            end=measured.end if measured else (),
            end_uncertainty=measured.uncertainty if measured else (),
            steps=(robot and robot.steps) or msgspec.UNSET, content=content,
        )
    )  # fmt: skip


def summarized(entry: AcceptedCase) -> AcceptedCase:
    """Add a one-line summary for reviewers to an entry."""

    def short(value: Number, form: str) -> str:
        return "unknown" if value is None else format(value, form)

    if entry.outcome is Outcome.REFUSED:
        return msgspec.structs.replace(entry, summary=f"{entry.outcome}: {entry.outcome_reason}")
    summary = (
        f"{entry.outcome}, E {short(entry.discrepancy, '.0e')} U {short(entry.uncertainty, '.0e')}"
    )
    if entry.integrator and entry.content is not msgspec.UNSET:  # separate states: no full run
        summary += f"; {short(entry.time_step, 'g')} s, {entry.integrator}"
    elif entry.integrator:
        summary += (
            f"; global error {short(entry.global_error, '.2%')}"
            f" at {short(entry.time_step, 'g')} s, {entry.integrator}"
        )
    return msgspec.structs.replace(entry, summary=summary)


def unaccepted_findings(model: Model, audit: AcceptedAudit | None) -> tuple[AuditFinding, ...]:
    """Return the findings about a model that were not accepted."""
    return tuple(one for one in model.findings if not is_accepted(one, model, audit))


def is_accepted(finding: AuditFinding, model: Model, audit: AcceptedAudit | None) -> bool:
    """Return whether a finding about a model was accepted."""
    accepted = () if audit is None else audit.findings
    return any(_same(_plain(finding, model), one) for one in accepted)


def accepted_audit(
    id_: ModelId, model: Model, before: AcceptedAudit | None, reason: str
) -> AcceptedAudit | None:
    """Return findings and advice to accept: the old ones if nothing is new; None without any.

    Args:
        id_: name of the model, with its system's name in the baseline.
        model: its record.
        before: the accepted findings.
        reason: reason for accepting them.
    """
    present = (*model.findings, *(one for one in model.audit or () if one.severity == "advice"))
    if not present:
        return None
    is_old = all(is_accepted(one, model, before) for one in present)
    if before is not None and len(before.findings) == len(present) and is_old:
        return before
    findings = tuple(_plain(one, model) for one in present)
    return record_of(AcceptedAudit, id_, reason=reason, findings=findings, seal="")


def _plain(finding: AuditFinding, model: Model) -> AcceptedFinding:
    """Convert a finding for the baseline, without the path of its folder on this machine."""
    folder = Path(model.folder)
    folder = folder.parent if folder.name == model.model else folder
    base = "" if folder == Path() else f"{folder}/"
    subject = tuple(part.replace(base, "") for part in finding.subject)
    message = finding.message.replace(base, "")
    return record_of(AcceptedFinding, finding, subject=subject, message=message)


def _same(finding: AcceptedFinding, other: AcceptedFinding) -> bool:
    """Return whether two findings are equal; numbers of a literal must be exactly equal."""
    tolerance = 0.0 if finding.kind == "literal" else SAME
    return (
        (finding.kind, finding.subject) == (other.kind, other.subject)
        and is_near(finding.expected, other.expected, tolerance)
        and is_near(finding.actual, other.actual, tolerance)
    )
