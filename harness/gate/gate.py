"""The gate: run what changed since it was accepted, and say of each case what moved and why.

folders --hash--> what changed --run--> records --compare--> changes --> lines, annotations, exit

Nothing heavy is imported until something must be run: an unchanged repository passes in a moment.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.classify import Change, classify
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles, folder_files
from physics_crosscheck.harness.baseline.store import named_folders
from physics_crosscheck.harness.gate.audits import with_audits
from physics_crosscheck.harness.gate.file_diffs import file_diffs
from physics_crosscheck.harness.gate.options import GateOptions
from physics_crosscheck.harness.gate.result import GateResult
from physics_crosscheck.harness.gate.survey import (
    Survey,
    by_name,
    is_expected,
    survey,
    was_left_alone,
)
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.baseline import AcceptedCase, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.run import Options, Run, Selection, run

Progress = Callable[[int, int, Case | None], None]
"""Called with (cases done, cases known, the case just done or None)."""

_GONE = "accepted, but the case no longer exists"


def gate(folders: Sequence[Path], options: GateOptions, progress: Progress) -> GateResult:
    """Compare every case of the folders with the baseline, running those that changed.

    Raises:
        BaselineError: for a baseline that can't be believed.
        FolderError: for two folders of one system.
        OSError: for a file that can't be read.
    """
    began = time.perf_counter()
    found = survey(folders, options)
    ran = _run(found, options, progress) if found.running else None
    names = by_name(found, ran.results if ran else None)
    changes: list[Change] = []
    if ran is not None:
        moved = list(_of_run(ran, names, found, options))
        changes = with_audits(moved, ran.results, found.baseline)
    changes += _of_the_rest(changes, names, found, options)
    order = list(Status)
    changes.sort(key=lambda c: (order.index(c.status), -c.size, c.id.system))
    return GateResult(
        changes=tuple(changes),
        file_diffs=file_diffs(changes, names, options.baseline),
        results=ran.results if ran else None,
        folders=names,
        baseline=found.baseline,
        seconds=time.perf_counter() - began,
    )


def accepted_folders(baseline: Path) -> list[Path]:
    """The folders that a baseline names, and the system folders beside them.

    Raises:
        BaselineError: for a baseline that can't be read.
    """
    parents = set()
    for name in named_folders(baseline):
        place = (
            builtin() / name.removeprefix("builtin:")
            if name.startswith("builtin:")
            else baseline / name
        )
        parents.add(Path(os.path.relpath(place.resolve().parent)))
    return sorted(p.parent for parent in parents for p in parent.glob("*/system.py"))


def _run(found: Survey, options: GateOptions, progress: Progress) -> Run:
    selection = Selection(
        models=found.chosen,
        snapshots=SnapshotsToRepeat(found.baseline),
        diagnose=options.diagnose,
    )
    return run(
        found.running,
        Options(
            engines=options.engines,
            resolution=options.resolution,
            jobs=options.jobs,
            limits=options.limits,
            selection=selection,
        ),
        progress,
    )


class SnapshotsToRepeat(Mapping[CaseId, Snapshot]):
    """Accepted snapshots by case; a new case takes the one that its scenario has."""

    def __init__(self, baseline: Mapping[str, SystemBaseline]) -> None:
        self._cases = {case: one.snapshot(case) for one in baseline.values() for case in one.cases}
        self._scenarios = {
            (case.system, snapshot.scenario): snapshot for case, snapshot in self._cases.items()
        }

    def __getitem__(self, case: CaseId) -> Snapshot:
        if case in self._cases:
            return self._cases[case]
        return self._scenarios[case.system, case.scenario]

    def __iter__(self) -> Iterator[CaseId]:
        return iter(self._cases)

    def __len__(self) -> int:
        return len(self._cases)


def _of_run(
    ran: Run, names: Mapping[str, FolderFiles], found: Survey, options: GateOptions
) -> Iterator[Change]:
    """What became of the cases that were run."""
    again = {folder: folder_files(folder, options.baseline) for folder in found.running}
    # Where a declaration can't be loaded, the case is told by its folder; the baseline knows.
    systems = {str(scan.folder): name for name, scan in names.items()}
    for case in ran.results.cases:
        system = systems[case.folder]
        scan = names[system]
        yield classify(
            system,
            case,
            ran.measured.get((case.folder, case.id)),
            scan,
            found.baseline.get(system),
            found.versions,
            options.resolution,
            stale=again[scan.folder] != scan,
        )


def _of_the_rest(
    ran: Sequence[Change], names: Mapping[str, FolderFiles], found: Survey, options: GateOptions
) -> Iterator[Change]:
    """What became of the cases of the baseline that were not run: as accepted, or gone."""
    seen = {change.id for change in ran}
    # A declaration or a sidecar that can't be read takes its cases with it: they are not gone.
    failed = {(c.id.system, c.id.model) for c in ran if c.status is Status.NOT_RUN}
    for system, one in sorted(found.baseline.items()):
        scan = names.get(system)
        if scan is None and not is_expected(one, options):
            continue
        for case, entry in one.cases.items():
            if case in seen or case.engine in found.left_out:
                continue
            if scan is not None and was_left_alone(scan, one, case, found):
                yield _as_accepted(entry)
            elif not failed & {(system, "system.py"), (system, case.model)}:
                yield Change(id=case, status=Status.GONE, messages=(_GONE,), entry=entry)


def _as_accepted(entry: AcceptedCase) -> Change:
    status = Status.SAME if entry.outcome is Outcome.AGREES else Status.KNOWN
    return Change(id=entry.id, status=status, entry=entry)
