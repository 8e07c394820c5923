"""Acceptance of present results as the baseline, each with a reason."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

import msgspec

from physics_crosscheck.harness.baseline.classify import Change, accepted_audit, summarized
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles
from physics_crosscheck.harness.baseline.stale import location
from physics_crosscheck.harness.baseline.store import write_baseline
from physics_crosscheck.harness.modelfiles.code_reads import digest_of
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.baseline import AcceptedCase, AcceptedDeclaration
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.status import counted
from .result import GateResult

_UNMOVED = (Status.SAME, Status.WITHIN, Status.EXPECTED)


class AcceptError(ValueError):
    """A result that cannot be accepted; the message gives the reason, and nothing was written."""


@dataclass(frozen=True)
class Acceptance:
    """The result of an acceptance.

    Attributes:
        files: baseline files that changed.
        cases: cases with a new or changed entry.
        unchanged: ids of requested cases whose engine is missing, so their entries stay.
    """

    files: tuple[Path, ...]
    cases: tuple[CaseId, ...]
    unchanged: tuple[str, ...]


def accept(
    result: GateResult,
    patterns: Sequence[str],
    reason: str,
    baseline: Path,
    *,
    untested: bool = False,
) -> Acceptance:
    """Write the matching cases of a gate's result to the baseline; all cases without patterns.

    An entry whose motion did not change keeps its numbers and its reason, so that the diff under
    review shows only the changes. An entry named by a pattern takes the given reason.

    Raises:
        AcceptError: for a case that failed, a file that changed meanwhile, or, unless `untested`,
            a file that every engine refuses; nothing was written.
        FolderError: for a pattern that matches nothing; nothing was written.
        OSError: from the file system; nothing was written.
    """
    ids = [change.id for change in _matching(result, patterns)]
    named = ids if patterns else ()
    return accept_each(result, dict.fromkeys(ids, reason), named, baseline, untested=untested)


def accept_each(
    result: GateResult,
    reasons: Mapping[CaseId, str],
    named: Collection[CaseId],
    baseline: Path,
    *,
    untested: bool = False,
) -> Acceptance:
    """Write some cases, each with its reason, which replaces the old reason if `named`.

    Raises:
        AcceptError: for a file that changed meanwhile, or, unless `untested`, one that every engine
            refuses; nothing was written.
        OSError: from the file system; nothing was written.
    """
    requested = [change for change in result.changes if change.id in reasons]
    chosen = [one for one in requested if one.status is not Status.NOT_RUN or _is_refused(one)]
    if not untested:
        _check_tested(result, chosen)
    systems = dict(result.baseline)
    rewritten: list[CaseId] = []
    for change in chosen:
        name, reason = change.id.system, reasons[change.id]
        system_baseline = systems.get(name) or _empty(name)
        old = system_baseline.cases.get(change.id)
        systems[name], new = _with(
            system_baseline, change, _entry(change, reason, change.id in named)
        )
        before, systems[name] = systems[name], _with_audit(systems[name], change, result, reason)
        if new != old or systems[name] != before:
            rewritten.append(change.id)
    texts: dict[tuple[str, str], bytes] = {}
    touched = sorted({change.id.system for change in chosen})
    for name in touched:
        scan = result.folders.get(name)
        if scan is not None:
            systems[name] = _declared(systems[name], scan, result.results, baseline)
            texts |= _texts(scan, [c for c in chosen if c.id.system == name and c.now is not None])
    files = write_baseline(baseline, [systems[name] for name in touched], texts)
    absent = tuple(str(change.id) for change in requested if _absent(change))
    return Acceptance(tuple(files), tuple(rewritten), absent)


def _matching(result: GateResult, patterns: Sequence[str]) -> list[Change]:
    """Select the changes that match the patterns; all without patterns."""
    for pattern in patterns:
        if not any(_matches(change, pattern) for change in result.changes):
            examples = sorted({f"{c.id.path}/{c.id.scenario}" for c in result.changes})[:4]
            raise FolderError(f"no case matches {pattern!r}; cases are {', '.join(examples)}")
    matching = [c for c in result.changes if not patterns or any(_matches(c, p) for p in patterns)]
    failed = [
        c for c in matching if c.status is Status.NOT_RUN and not (_is_refused(c) or _absent(c))
    ]
    if failed:
        raise AcceptError(
            f"{failed[0].id} can't be accepted: {failed[0].messages[0]}; nothing was written"
            + (f" ({counted(len(failed) - 1, 'more case')} could not run)" if failed[1:] else "")
        )
    return matching


def _check_tested(result: GateResult, chosen: Sequence[Change]) -> None:
    """Reject new results of a robot file that no engine loads.

    Raises:
        AcceptError: naming the file and the option that accepts it.
    """
    for system in {one.id.system for one in chosen if one.status not in _UNMOVED}:
        mine = [one for one in result.changes if one.id.system == system]
        entries = [one.now or one.entry for one in mine if one.status is not Status.GONE]
        outcomes = {entry.outcome for entry in entries if entry is not None}
        if outcomes == {Outcome.REFUSED}:
            raise AcceptError(
                f"{system}: every engine refuses it, so nothing is tested; correct the file, or"
                " accept it with --untested; nothing was written"
            )


def _matches(change: Change, pattern: str) -> bool:
    """Return whether a pattern matches a case's id: `*` and `?` are wildcards, brackets are
    literal.
    """
    pattern, name = pattern.replace("[", "[[]"), str(change.id)
    return fnmatchcase(name, pattern) or fnmatchcase(name, f"{pattern} [[]*]")


def _is_refused(change: Change) -> bool:
    return change.now is not None and change.now.outcome is Outcome.REFUSED


def _absent(change: Change) -> bool:
    return change.case is not None and change.case.outcome is Outcome.ABSENT


def _empty(system: str) -> SystemBaseline:
    nothing = AcceptedDeclaration(system=system, folder="", declared="", scenarios=(), constants={})
    return SystemBaseline(declared=nothing, snapshots={}, cases={})


def _entry(change: Change, reason: str, named: bool) -> AcceptedCase | None:
    """Return the entry to accept for a case; None if the case no longer exists."""
    old, now = change.entry, change.now
    if change.status is Status.GONE:
        return None
    if now is None:  # not run
        assert old is not None
        return msgspec.structs.replace(old, reason=reason) if named else old
    if old is None or change.status not in _UNMOVED:
        return msgspec.structs.replace(now, reason=reason)
    return summarized(
        msgspec.structs.replace(
            old,
            reason=reason if named else old.reason,
            files=now.files,
            engine_version=now.engine_version,
            resolution=now.resolution,
            numerics=now.numerics,
            time_step=now.time_step,
            integrator=now.integrator,
            claimed_order=now.claimed_order,
            content=now.content,
        )
    )


def _with(
    system_baseline: SystemBaseline, change: Change, entry: AcceptedCase | None
) -> tuple[SystemBaseline, AcceptedCase | None]:
    """Add an entry to a system's baseline, or remove one whose case no longer exists."""
    cases, snapshots = dict(system_baseline.cases), dict(system_baseline.snapshots)
    if entry is None:
        del cases[change.id]
    else:
        cases[change.id] = entry
        if change.measured is not None:
            snapshots.setdefault(entry.snapshot, change.measured.snapshot)
    return replace(system_baseline, cases=cases, snapshots=snapshots), entry


def _with_audit(
    system_baseline: SystemBaseline, change: Change, result: GateResult, reason: str
) -> SystemBaseline:
    """Add the audit findings of a model that was run to the accepted ones."""
    there = {case.of_model for case in system_baseline.cases}
    audits = {model: audit for model, audit in system_baseline.audits.items() if model in there}
    model = None if change.case is None else result.model_of(change.case)
    if model is not None and model.audit is not None:
        of_model = change.id.of_model
        audit = accepted_audit(of_model, model, audits.pop(of_model, None), reason)
        audits |= {} if audit is None else {of_model: audit}
    return replace(system_baseline, audits=audits)


def _declared(
    system_baseline: SystemBaseline, scan: FolderFiles, results: Results | None, baseline: Path
) -> SystemBaseline:
    """Update the accepted declaration if it was loaded."""
    now = msgspec.structs.replace(
        system_baseline.declared,
        folder=location(scan.folder, baseline),
        robot=msgspec.UNSET if scan.robot is None else scan.robot,
    )
    for system in results.systems if results else ():
        if system.folder == str(scan.folder):
            now = msgspec.structs.replace(
                now,
                declared=scan.system,
                scenarios=tuple(scenario.name for scenario in system.scenarios),
                constants={constant.name: constant.value for constant in system.constants},
            )
    return replace(system_baseline, declared=now)


def _texts(scan: FolderFiles, changes: Sequence[Change]) -> dict[tuple[str, str], bytes]:
    """Return the texts of the accepted models.

    Raises:
        AcceptError: for a text that changed after the run.
    """
    texts = {}
    for change in changes:
        model = change.id.model
        for name in next(files.copies for files in scan.models if files.model == model):
            data = (scan.base / name).read_bytes()
            if digest_of(data) != change.files[name]:
                raise AcceptError(
                    f"{scan.base / name}: changed during the run. Run crosscheck accept again."
                )
            texts[change.id.system, name] = data
    return texts
