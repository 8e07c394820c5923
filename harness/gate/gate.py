"""The gate: run what changed since it was accepted, and say of each case what moved and why.

folders --hash--> what changed --run--> records --compare--> changes --> lines, annotations, exit

Nothing heavy is imported until something must be run: an unchanged repository passes in a moment.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harness.baseline.changes import Change, Status
from harness.baseline.classify import judge
from harness.baseline.fingerprint import FolderFiles, folder_files
from harness.baseline.stale import location, match, touched
from harness.baseline.store import SystemBaseline, read_baseline
from harness.engines.registry import engines
from harness.files.folders import FolderError, builtin
from harness.gate.file_diffs import FileDiff, stories

Record = dict[str, Any]


@dataclass(frozen=True)
class GateOptions:
    """What a gate may be told.

    Attributes:
        baseline: folder of the accepted baseline.
        engines: only these; none: all.
        every: run every case, changed or not.
        diagnose: name the cause where a model differs, which takes a while.
        resolution, jobs, limit: as in `harness.run.Options`.
        parents: folders all of whose systems are given, so that one that is missing is gone;
            None: every system of the baseline is expected.
    """

    baseline: Path
    engines: tuple[str, ...] = ()
    every: bool = False
    diagnose: bool = False
    resolution: float = 1e-9
    jobs: int = 0
    limit: float = 120.0
    parents: tuple[Path, ...] | None = None


@dataclass(frozen=True)
class GateResult:
    """What a gate found.

    Attributes:
        changes: a `Change` for every case, worst first.
        stories: what changed in the files, a model or declaration each.
        results: records of what was run, without what a report needs; None where nothing was.
        folders: hashes of every folder given, by name of its system.
        baseline: what was accepted, by name of the system.
        seconds: how long it took.
    """

    changes: tuple[Change, ...]
    stories: tuple[FileDiff, ...]
    results: Record | None = field(repr=False)
    folders: Mapping[str, FolderFiles] = field(repr=False)
    baseline: Mapping[str, SystemBaseline] = field(repr=False)
    seconds: float

    @property
    def passes(self) -> bool:
        """Whether every case passes, and there is one at all."""
        return bool(self.changes) and all(change.status.passes for change in self.changes)

    @property
    def diagnosed(self) -> list[Record]:
        """Records of the models that were diagnosed."""
        models = [] if self.results is None else self.results["models"]
        return [model for model in models if model.get("diagnosis")]

    def of(self, *statuses: Status) -> tuple[Change, ...]:
        """The changes of some statuses."""
        return tuple(change for change in self.changes if change.status in statuses)


def gate(
    folders: Sequence[Path],
    terms: GateOptions,
    progress: Callable[[int, int, Record | None], None],
) -> GateResult:
    """Compare every case of the folders with the baseline, running those that changed.

    Raises:
        BaselineError: for a baseline that can't be believed.
        FolderError: for two folders of one system.
        OSError: for a file that can't be read.
    """
    began = time.perf_counter()
    baseline = read_baseline(terms.baseline)
    versions = {name: engine.version() for name, engine in engines().items()}
    scans = [folder_files(folder, terms.baseline) for folder in folders]
    matched = {scan.folder: match(scan.folder, terms.baseline, baseline) for scan in scans}
    chosen = {
        (str(scan.folder), model.model, engine)
        for scan in scans
        for model in scan.models
        for engine in model.engines
        if (not terms.engines or engine in terms.engines)
        and (
            terms.every
            or touched(scan, model, engine, matched[scan.folder], versions, terms.resolution)
        )
    }
    wanted = {folder for folder, _, _ in chosen}
    running = [s.folder for s in scans if str(s.folder) in wanted or s.broken or not s.models]
    results = _run(running, frozenset(chosen), baseline, terms, progress) if running else None
    changes: list[Change] = []
    names = _names(scans, matched, results)
    if results is not None:
        again = {
            s.folder: folder_files(s.folder, terms.baseline) for s in scans if s.folder in running
        }
        for case in results["cases"]:
            changes.append(_judge(case, names, again, baseline, versions, terms))
    seen = {(change.system, change.key) for change in changes}
    # A declaration or a sidecar that can't be read takes its cases with it: they are not gone.
    failed = {(c.system, c.key.split("/")[0]) for c in changes if c.status is Status.NOT_RUN}
    for system, one in sorted(baseline.items()):
        scan = names.get(system)
        if scan is None and not _expected(one, terms):
            continue
        for key, entry in one.cases.items():
            engine = key.rsplit("[", 1)[1].rstrip("]")
            if (system, key) in seen or (terms.engines and engine not in terms.engines):
                continue
            left = scan is not None and _left_alone(scan, one, key, engine, chosen)
            if left:
                status = Status.SAME if entry["outcome"] == "AGREES" else Status.KNOWN
                changes.append(Change(system, key, status, (), (), entry=entry))
            elif not failed & {(system, "system.py"), (system, key.split("/")[0])}:
                told = ("it was accepted, and there is no such case now",)
                changes.append(Change(system, key, Status.GONE, (), told, entry=entry))
    order = list(Status)
    changes.sort(key=lambda c: (order.index(c.status), -c.size, c.system))
    return GateResult(
        tuple(changes),
        stories(changes, names, terms.baseline),
        results,
        names,
        baseline,
        time.perf_counter() - began,
    )


def accepted_folders(baseline: Path) -> list[Path]:
    """The folders that a baseline names, and the system folders beside them.

    Raises:
        BaselineError: for a baseline that can't be believed.
    """
    parents = set()
    for one in read_baseline(baseline).values():
        name = one.folder
        place = (
            builtin() / name.removeprefix("builtin:")
            if name.startswith("builtin:")
            else baseline / name
        )
        parents.add(Path(os.path.relpath(place.resolve().parent)))
    return sorted(p.parent for parent in parents for p in parent.glob("*/system.py"))


def _run(
    folders: Sequence[Path],
    models: frozenset[tuple[str, str, str]],
    baseline: Mapping[str, SystemBaseline],
    terms: GateOptions,
    progress: Callable[[int, int, Record | None], None],
) -> Record:
    # Imported here: they bring sympy, which costs most of a second.
    from harness.baseline.snapshot import snapshot_from
    from harness.run import Options, Selection, run

    tracks = {
        f"{name}/{key}": snapshot_from(one.tracks[entry["track"]])
        for name, one in baseline.items()
        for key, entry in one.cases.items()
    }
    selection = Selection(models, _Tracks(tracks), terms.diagnose)
    return run(
        folders,
        Options(terms.engines, terms.resolution, terms.jobs, terms.limit, selection=selection),
        progress,
    )


class _Tracks(dict[str, Any]):
    """Tracks by case id; a new case takes the one that its scenario has in the baseline."""

    def __init__(self, tracks: Mapping[str, Any]) -> None:
        super().__init__(tracks)
        self._scenarios = {(case.split("/")[0], one.scenario): one for case, one in tracks.items()}

    def get(self, case: str, default: Any = None) -> Any:
        """The track of a case, or of another case of its scenario."""
        if case in self:
            return self[case]
        system, _, rest = case.split("/", 2)
        return self._scenarios.get((system, rest.rsplit(" [", 1)[0]), default)


def _names(
    scans: Sequence[FolderFiles],
    matched: Mapping[Path, SystemBaseline | None],
    results: Record | None,
) -> dict[str, FolderFiles]:
    """Folders by the name of their system: as it was just loaded, or as it was accepted.

    Raises:
        FolderError: where two folders have one name.
    """
    loaded = {s["folder"]: s["name"] for s in (results or {"systems": ()})["systems"]}
    names: dict[str, FolderFiles] = {}
    for scan in scans:
        one = matched[scan.folder]
        name = loaded.get(str(scan.folder)) or (one.system if one else scan.folder.name)
        if name in names:
            raise FolderError(
                f"{scan.folder} and {names[name].folder} both hold the system {name!r};"
                " a baseline keeps one system of a name"
            )
        names[name] = scan
    return names


def _judge(
    case: Record,
    names: Mapping[str, FolderFiles],
    again: Mapping[Path, FolderFiles],
    baseline: Mapping[str, SystemBaseline],
    versions: Mapping[str, str | None],
    terms: GateOptions,
) -> Change:
    """What became of a case that was run."""
    # Where a declaration can't be loaded, the case is told by its folder; the baseline knows.
    system = next(n for n, scan in names.items() if str(scan.folder) == case["folder"])
    scan = names[system]
    stale = again[scan.folder] != scan
    return judge(system, case, scan, baseline.get(system), versions, terms.resolution, stale)


def _expected(one: SystemBaseline, terms: GateOptions) -> bool:
    """Whether a system of the baseline ought to be among the folders given."""
    if terms.parents is None:
        return True
    return one.folder.rpartition("/")[0] in {location(p, terms.baseline) for p in terms.parents}


def _left_alone(
    scan: FolderFiles,
    one: SystemBaseline,
    key: str,
    engine: str,
    chosen: set[tuple[str, str, str]],
) -> bool:
    """Whether a case of the baseline is still there, and was not run since nothing changed."""
    model, rest = key.split("/", 1)
    if rest.rsplit(" [", 1)[0] not in one.scenarios:
        return False
    here = any(m.model == model and engine in m.engines for m in scan.models)
    return here and (str(scan.folder), model, engine) not in chosen
