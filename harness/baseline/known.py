"""Comparison of a run with the accepted baseline: known differences and changes.

A known difference is a case that does not agree and was accepted with a reason. It counts as passed
and is shown as a known difference until it changes: its outcome, or the motion of the model or of
the equations on the accepted snapshot.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import msgspec

from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.records.baseline import (
    AcceptedCase,
    Measurement,
    RobotOptions,
    Snapshot,
)
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.diff import Diff, Status, bare_diff, numbers_of
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges
from physics_crosscheck.harness.results.status import counted
from .classify import Change, classify, gone, is_accepted, unaccepted, unaccepted_findings
from .diff import diff_cases, motion_of, verdict_change
from .file import SystemBaseline
from .fingerprint import FolderFiles, versions
from .stale import robot_options, scan_target, stale_models
from .store import read_baseline

Measured = Mapping[tuple[str, CaseId], Measurement | Failure]
"""Measurements, or the reasons for their absence, by folder and case."""

_DECISIVE = frozenset(("limit", "equations", "discrepancy"))
"""Changes after which a known difference is a different one."""


@dataclass(frozen=True, kw_only=True)
class Accepted:
    """The accepted results of folders and robot files, with the present state of their files.

    Attributes:
        place: the folder of the baseline.
        systems: the baseline, by name.
        folders: files and accepted results of each folder or robot file.
        versions: versions of the engines.
        resolution: resolution of the run.
        engines: engines to run; empty: all.
        absent: engines of extras that are not installed.
    """

    place: Path
    systems: Mapping[str, SystemBaseline] = field(repr=False)
    folders: Mapping[str, tuple[FolderFiles, SystemBaseline | None]] = field(repr=False)
    versions: Mapping[str, str | None]
    resolution: float
    engines: tuple[str, ...]
    absent: frozenset[str] = frozenset()

    def includes(self, engine: str) -> bool:
        """Return whether a run includes an engine; engines of missing extras are not included."""
        return engine not in self.absent and (not self.engines or engine in self.engines)

    def stale_models(self, folder: str) -> Iterator[tuple[str, str]]:
        """Yield each model file of a folder with each engine whose dependencies changed."""
        return stale_models(*self.folders[folder], self.versions, self.resolution)

    @cached_property
    def snapshots(self) -> Mapping[CaseId, Snapshot]:
        """Snapshots of the cases that a run must measure: known differences and changed cases."""
        snapshots: dict[CaseId, Snapshot] = {}
        for folder, (_, accepted_system) in self.folders.items():
            if accepted_system is None:
                continue
            changed = set(self.stale_models(folder))
            snapshots |= {
                case: snapshot
                for case, entry in accepted_system.cases.items()
                if entry.outcome is not Outcome.AGREES or (case.model, case.engine) in changed
                if (snapshot := accepted_system.snapshot(case)) is not None
            }
        return snapshots

    def system_of(self, folder: str, system: str) -> SystemBaseline | None:
        """Return the baseline of a system: by name for a folder, by path for a robot file."""
        scan, accepted = self.folders.get(folder, (None, None))
        return self.systems.get(system) if scan is None or scan.robot is None else accepted

    def id_of(self, case: Case) -> CaseId:
        """Return the name of a case in the baseline, which names a robot file by its path."""
        accepted = self.system_of(case.folder, case.system)
        system = case.system if accepted is None else accepted.system
        return msgspec.structs.replace(case.id, system=system)

    def snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case that a run must measure."""
        accepted = self.system_of(folder, case.system)
        if accepted is None:
            return None
        return self.snapshots.get(msgspec.structs.replace(case, system=accepted.system))


def accepted(
    place: Path | None,
    targets: Sequence[Path],
    resolution: float,
    only: tuple[str, ...] = (),
    robot: RobotOptions | None = RobotOptions(),  # noqa: B008  # frozen
) -> Accepted | None:
    """Read a baseline for a run of folders and robot files; return None if nothing was accepted.

    Args:
        place: the folder of the baseline.
        targets: folders and robot files.
        resolution: resolution of the run.
        only: engines to run; empty: all.
        robot: options for reading robot files; None: as accepted.

    Raises:
        BaselineError: for an invalid baseline.
    """
    systems = {} if place is None else read_baseline(place)
    if place is None or not systems:
        return None
    folders: dict[str, tuple[FolderFiles, SystemBaseline | None]] = {}
    for target in targets:
        options = robot and robot_options(target, floating=robot.floating, model=robot.model)
        try:
            scan, accepted_system = scan_target(target, place, systems, only, options)
        except OSError:
            continue  # not comparable with the baseline; the run reports the unreadable file
        if accepted_system is not None and accepted_system.robot != scan.robot:
            accepted_system = None  # other options make it a different robot
        folders[str(target)] = scan, accepted_system
    baseline = Accepted(
        place=place,
        systems=systems,
        folders=folders,
        versions=versions(),
        resolution=resolution,
        engines=only,
        absent=frozenset(absent_extras()),
    )
    _ = baseline.snapshots  # now: later changes of files do not count
    return baseline


def mark_known(
    cases: Sequence[Case], measured: Measured, baseline: Accepted | None
) -> tuple[Case, ...]:
    """Mark each known difference with the reason of its acceptance.

    An accepted case that changed since gets a reason that describes the change.
    """
    if baseline is None:
        return tuple(cases)
    return tuple(_marked(case, measured.get((case.folder, case.id)), baseline) for case in cases)


def _marked(case: Case, measured: Measurement | Failure | None, baseline: Accepted) -> Case:
    accepted_system = baseline.system_of(case.folder, case.system)
    entry = accepted_system.known_differences.get(baseline.id_of(case)) if accepted_system else None
    if accepted_system is None or entry is None:
        return case
    if case.outcome is entry.outcome is Outcome.REFUSED:
        scan = baseline.folders[case.folder][0]
        is_same = any(model.hashes == entry.files for model in scan.models)
        return msgspec.structs.replace(case, accepted=entry.reason) if is_same else case
    if measured is None:
        return case
    if case.outcome is Outcome.AGREES or not case.outcome.is_run:
        return case
    changed = _why_changed(case, measured, entry, accepted_system.snapshot(entry.id))
    if not changed:
        return msgspec.structs.replace(case, accepted=entry.reason)
    note = f"a difference was accepted here ({entry.reason}), but {changed}"
    return msgspec.structs.replace(case, reason=f"{case.reason}; {note}")


def _why_changed(
    case: Case, measured: Measurement | Failure, entry: AcceptedCase, snapshot: Snapshot | None
) -> str:
    """Return how a case differs from the accepted difference; "" if it does not."""
    numbers = numbers_of(case)
    if numbers.outcome is not entry.outcome:
        return verdict_change(entry.numbers, numbers)
    if isinstance(measured, Failure):
        return measured.reason
    assert snapshot is not None  # measured cases have a snapshot
    # A changed scenario alone leaves the difference accepted, so no message is about it.
    motion = replace(motion_of(entry, snapshot, measured), scenario="")
    diff = diff_cases(entry.id, entry.numbers, numbers, motion=motion)
    return diff.messages[0] if _DECISIVE.intersection(diff.changed) else ""


def mark_models(models: Iterable[Model], baseline: Accepted | None) -> tuple[Model, ...]:
    """Mark the models whose findings were all accepted with the reason of the acceptance."""
    if baseline is None:
        return tuple(models)
    return tuple(_marked_model(model, baseline) for model in models)


def _marked_model(model: Model, baseline: Accepted) -> Model:
    accepted = baseline.system_of(model.folder, model.system)
    if accepted is None or not model.audit:
        return model
    audit = accepted.audits.get(msgspec.structs.replace(model.id, system=accepted.system))
    if audit is None:
        return model
    marked = tuple(
        msgspec.structs.replace(one, accepted=audit.reason)
        if one.severity == "advice" and is_accepted(one, model, audit)
        else one
        for one in model.audit
    )
    model = msgspec.structs.replace(model, audit=marked)
    if not model.findings or unaccepted_findings(model, audit):
        return model
    return msgspec.structs.replace(model, accepted=audit.reason)


def changes_since(
    cases: Sequence[Case], measured: Measured, baseline: Accepted | None
) -> BaselineChanges | None:
    """Return the changes since the baseline, worst first; None without a baseline."""
    if baseline is None:
        return None
    changes = [change for case in cases if (change := _change(case, measured, baseline))]
    changes += map(gone, _missing(cases, baseline))
    changes.sort(key=lambda change: list(Status).index(change.status))
    return BaselineChanges(name=baseline.place.as_posix(), changes=tuple(changes))


def _missing(cases: Sequence[Case], baseline: Accepted) -> Iterator[AcceptedCase]:
    """Yield accepted cases that no longer exist in the folders, unless a failure explains it."""
    seen = {baseline.id_of(case) for case in cases}
    barred = {case_id for case in cases for case_id in _covered_cases(case, baseline)}
    for _, accepted_system in baseline.folders.values():
        entries = {} if accepted_system is None else accepted_system.cases
        for case, entry in entries.items():
            if baseline.includes(case.engine) and case not in seen and case not in barred:
                yield entry


def _covered_cases(case: Case, baseline: Accepted) -> tuple[CaseId, ...]:
    """Return the accepted cases that a failure covers: those of an unreadable model or folder.

    A folder is identified by its path, because the name of its system is unknown after a failure.
    """
    folder_state = baseline.folders.get(case.folder)
    accepted_system = baseline.systems.get(case.system) if folder_state is None else folder_state[1]
    if case.scenario != "-" or accepted_system is None:
        return ()
    whole = case.model == "system.py" or accepted_system.robot is not None
    return tuple(
        accepted
        for accepted in accepted_system.cases
        if (whole or accepted.model == case.model) and baseline.includes(accepted.engine)
    )


def change_of(
    case: Case, measured: Measurement | Failure | None, baseline: Accepted
) -> Change | None:
    """Compare a case with its accepted result; None without one, or if it was not measured."""
    accepted_system = baseline.system_of(case.folder, case.system)
    if accepted_system is None or baseline.id_of(case) not in accepted_system.cases:
        return None
    if measured is None and case.outcome.is_run:
        return None
    return classify(
        accepted_system.system,
        case,
        measured,
        baseline.folders[case.folder][0],
        accepted_system,
        baseline.versions,
        baseline.resolution,
    )


def _change(case: Case, measured: Measured, baseline: Accepted) -> Diff | None:
    after = numbers_of(case)
    if barred := _covered_cases(case, baseline):
        message = f"{case.outcome}; the baseline has {counted(len(barred), 'case')} of it"
        return bare_diff(case.id, Status.NOT_RUN, (message,), after=after)
    accepted_system = baseline.system_of(case.folder, case.system)
    if accepted_system is None or baseline.id_of(case) not in accepted_system.cases:
        return bare_diff(case.id, Status.NEW, (unaccepted(case),), after=after)
    if case.folder not in baseline.folders:
        message = "its folder has an unreadable file"
        return bare_diff(case.id, Status.NOT_RUN, (message,), after=after)
    change = change_of(case, measured.get((case.folder, case.id)), baseline)
    if change is None or change.status in (Status.SAME, Status.EXPECTED, Status.WITHIN):
        return None
    # A run calls a robot file by the robot's name, the baseline by its path.
    return msgspec.structs.replace(change.diff, system=case.system)
