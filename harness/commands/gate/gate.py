"""The gate: run the cases whose inputs changed, and report what changed and why.

folders --hash--> changed cases --run--> records --compare--> changes --> lines, annotations, exit

Heavy modules are imported only if something must run, so that an unchanged repository passes at
once.

Changes in files since they were accepted: literals and lines, with their places.
"""

from __future__ import annotations

import difflib
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from physics_crosscheck.harness.baseline.classify import Change, classify, gone, unaccepted_findings
from physics_crosscheck.harness.baseline.content import MOST_SHOWN, changed_value, element_changes
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import (
    OTHER_FILES,
    FolderFiles,
    changed_names,
    hashed_again,
)
from physics_crosscheck.harness.baseline.stale import match
from physics_crosscheck.harness.baseline.store import accepted_text, named_targets, read_baseline
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.expanded import in_source, source_of
from physics_crosscheck.harness.modelfiles.code_reads import ABSENT, digest
from physics_crosscheck.harness.modelfiles.folders import builtin, is_robot
from physics_crosscheck.harness.modelfiles.locations import find_in
from physics_crosscheck.harness.modelfiles.parts import included
from physics_crosscheck.harness.modelfiles.robot_targets import (
    robots_below,
    source_file,
    source_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.harness.planning.options import Options, Selection
from physics_crosscheck.harness.planning.result_builder import Progress
from physics_crosscheck.harness.records.baseline import AcceptedCase, ChangedLine, FileDiff
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.diff import Status, bare_diff
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.status import counted
from .result import GateResult
from .survey import Survey, by_name, is_expected, survey, was_left_alone

if TYPE_CHECKING:
    from physics_crosscheck.harness.run import Run

MOST_LINES = 12
"""Maximum number of changed lines reported for a file; beyond it, a diff is more useful."""

MOST_CHANGES = 200
"""Maximum number of changed attributes and elements reported for a robot file."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")

_LAST_NAME = re.compile(r"""([A-Za-z_][\w.-]*)\s*(?:=|>|\[|\()[^=<>]*$""")
"""Name of the attribute, element or variable that a number belongs to."""


def file_diffs(
    changes: Sequence[Change], folders: Mapping[str, FolderFiles], baseline: Path
) -> tuple[FileDiff, ...]:
    """Return the differences of every changed file of the cases that were run."""
    diffs = []
    for (system, name, accepted), models in sorted(_changed(changes).items()):
        scan = folders.get(system)
        if scan is None:
            continue
        diff = _file_diff(scan, system, name, accepted, sorted(models), baseline)
        diffs += _in_sources(diff)
    return tuple(diffs)


def _in_sources(diff: FileDiff) -> list[FileDiff]:
    """Return the changes of an expanded file by the files of its source, with their lines."""
    places = [(in_source(diff.path, line.line), line) for line in diff.changes]
    if not any(place for place, _ in places):
        return [diff]
    groups: dict[str, list[ChangedLine]] = {}
    for place, line in places:
        path, number = place or (diff.path, line.line)
        groups.setdefault(path, []).append(msgspec.structs.replace(line, line=number))
    return [
        msgspec.structs.replace(diff, path=path, changes=tuple(lines))
        for path, lines in groups.items()
    ]


def _changed(changes: Sequence[Change]) -> dict[tuple[str, str, str], set[str]]:
    """Return the models by (system, name of a changed file, its accepted hash)."""
    models: dict[tuple[str, str, str], set[str]] = {}
    for change in changes:
        if change.entry is None or change.case is None or not change.files:
            continue
        was = change.entry.files
        for name in changed_names(was, change.files):
            about = (change.id.system, name, was.get(name, ""))
            models.setdefault(about, set()).add(change.id.model)
    return models


def _file_diff(
    scan: FolderFiles, system: str, name: str, accepted: str, models: Sequence[str], baseline: Path
) -> FileDiff:
    """Return the changes of one file; a single line for the whole file if its lines are unknown."""
    file = scan.base / name
    whole = _whole_change(file, name, accepted)
    old = None if whole else accepted_text(baseline, system, name, accepted)
    if old is None:
        if not whole and scan.robot is not None and name not in scan.models[0].copies:
            whole = f"its content changed, {accepted} -> {digest(file)}"
        whole = whole or "changed; the accepted text is not kept, so its lines are unknown"
        changes, more = [ChangedLine(line=1, message=whole)], 0
    else:
        changes, more = _changed_lines(scan, name, old, models)
    return FileDiff(
        system=system,
        file=name,
        path=str(file if file.is_file() else scan.folder),
        models=tuple(models),
        changes=tuple(changes),
        more=more,
    )


def _whole_change(file: Path, name: str, accepted: str) -> str:
    if name == OTHER_FILES:
        return "a file beside the models changed, or was added or removed"
    if file.is_dir():
        return f"files were added to or removed from {name}"
    if not file.is_file():
        return f"{name} was removed"
    if accepted == ABSENT:
        return "was added"
    return "" if accepted else "is read now and was not read before"


def _changed_lines(
    scan: FolderFiles, name: str, old: str, models: Sequence[str]
) -> tuple[list[ChangedLine], int]:
    """Return the changed numbers and lines, and the number of lines that are not listed."""
    file = scan.base / name
    new = file.read_text(encoding="utf-8", errors="replace")
    if scan.robot is None:
        changed = _literals(file, name, old, new, models)
    elif changed := element_changes(file, old, new):
        return changed[:MOST_CHANGES], max(0, len(changed) - MOST_CHANGES)
    changed_lines = {one.line for one in changed}
    lines = [one for one in _lines(old, new) if one.line not in changed_lines]
    return changed + lines[:MOST_LINES], max(0, len(lines) - MOST_LINES)


def _literals(
    file: Path, name: str, old: str, new: str, models: Sequence[str]
) -> list[ChangedLine]:
    """Return the bound literals whose number changed."""
    changed = []
    is_sidecar = name.endswith(".toml")
    for model in models:
        try:
            sidecar = read_sidecar(file.parent / f"{model}.toml")
        except SidecarError:
            continue
        if name not in (model, f"{model}.toml"):
            continue
        for address, expression in sidecar.bindings.items():
            if address.startswith("sidecar:") != is_sidecar:
                continue
            within = address.removeprefix("sidecar:")
            before, after = (_place(file, text, within) for text in (old, new))
            if before and after and before.value != after.value:
                moved = changed_value(after.line or 0, within, before.text, after.text)
                message = f"{moved.message}, bound to {expression}"
                changed.append(msgspec.structs.replace(moved, message=message))
    return changed


def _place(file: Path, text: str, address: str) -> Number | None:
    try:
        return find_in(text.encode(), file, [address])[address]
    except LocationError:
        return None


def _lines(old: str, new: str) -> list[ChangedLine]:
    before, after = old.splitlines(), new.splitlines()
    changed = []
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    for tag, a, b, c, d in matcher.get_opcodes():
        if tag == "equal":
            continue
        for i in range(c, d):
            was = before[a + i - c] if b - a == d - c else None
            changed.append(_changed_line(i + 1, was, after[i]))
        if c == d:
            gone = [line for line in before[a:b] if line.strip()] or before[a:b]
            text = _short(gone[0])
            changed.append(
                ChangedLine(line=max(c, 1), message=f"- {text}", edit=f"removed: {text}")
            )
    return changed


def _changed_line(line: int, old: str | None, new: str) -> ChangedLine:
    """Describe a changed line: the number, if only one number changed, otherwise the new text."""
    message = f"+ {_short(new)}"
    if old is None:
        return ChangedLine(line=line, message=message, edit=f"added: {_short(new)}")
    was, now = (list(_NUMBER.finditer(text)) for text in (old, new))
    if len(was) == len(now) and _NUMBER.sub("0", old) == _NUMBER.sub("0", new):
        pairs = [(x, y) for x, y in zip(was, now, strict=True) if x[0] != y[0]]
        if len(pairs) == 1:
            (before, after), *_ = pairs
            name = _LAST_NAME.search(new[: after.start()])
            edit = f"{f'{name[1]} ' if name else ''}{before[0]} -> {after[0]}"
            return ChangedLine(line=line, message=message, edit=edit, old=before[0])
    return ChangedLine(line=line, message=message, edit=f"changed to: {_short(new)}")


def _short(line: str) -> str:
    line = line.strip()
    return line if len(line) <= MOST_SHOWN else f"{line[:MOST_SHOWN]}..."


def gate(targets: Sequence[Path], options: Options, progress: Progress) -> GateResult:
    """Compare every case of folders and robot files with the baseline, running those that changed.

    Raises:
        BaselineError: for an invalid baseline.
        FolderError: if two folders declare one system.
        OSError: for an unreadable file.
    """
    began = time.perf_counter()
    state = survey(targets, options)
    ran = _run(state, options, progress) if state.running else None
    names = by_name(state, ran.results if ran else None)
    changes: list[Change] = []
    if ran is not None:
        moved = list(_of_run(ran, names, state, options))
        changes = with_audits(moved, ran.results, state.systems)
    changes += _of_the_rest(changes, names, state, options)
    order = list(Status)
    changes.sort(key=lambda c: (order.index(c.status), -c.diff.size, c.id.system))
    return GateResult(
        changes=tuple(changes),
        file_diffs=file_diffs(changes, names, state.place),
        results=ran.results if ran else None,
        folders=names,
        baseline=state.systems,
        seconds=time.perf_counter() - began,
    )


def accepted_targets(baseline: Path) -> list[Path]:
    """Return the folders and robot files that a baseline names, and those in the same folders.

    Raises:
        BaselineError: for an unreadable baseline.
    """
    parents, folders = set[Path](), set[Path]()
    for name, is_file in named_targets(baseline):
        place = (
            builtin() / name.removeprefix("builtin:")
            if name.startswith("builtin:")
            else baseline / name
        )
        parent = Path(os.path.relpath(place.resolve().parent))
        (folders if is_file else parents).add(parent)
    systems = sorted(p.parent for parent in parents for p in parent.glob("*/system.py"))
    files = [file for folder in folders if folder.is_dir() for file in folder.iterdir()]
    return [*systems, *_whole(files, _accepted(baseline))]


def moving_models(targets: Sequence[Path], baseline: Path, model: str) -> list[Path]:
    """Return the targets, with a file for each moving model of an SDFormat file, or the chosen one.

    The file itself stays where one model of it alone was accepted, or is to be accepted first.

    Raises:
        BaselineError, FolderError: for an unreadable baseline or file.
    """
    worlds = [target for target in targets if target.suffix == ".sdf"]
    accepted = read_baseline(baseline) if worlds else {}
    models = {world: _models_of(world, baseline, accepted, model) for world in worlds}
    return [one for target in targets for one in models.get(target, [target])]


def _models_of(
    file: Path, baseline: Path, accepted: Mapping[str, SystemBaseline], model: str
) -> list[Path]:
    whole = match(file, baseline, accepted)
    if whole is not None and whole.robot is not None and whole.robot.model:
        return [file]
    files = source_files(str(source_of(file)), model)
    return [file] if model and not any(match(one, baseline, accepted) for one in files) else files


def robots_in(folder: Path, baseline: Path) -> list[Path]:
    """Return the robot files below a folder, including the accepted ones.

    If none was accepted and there is a system folder below, return none.

    Raises:
        BaselineError: for an unreadable baseline.
    """
    here, accepted = folder.resolve(), _accepted(baseline)
    inside = [folder / file.relative_to(here) for file in accepted if here in file.parents]
    return _whole({*robots_below(folder), *filter(Path.is_file, inside)}, accepted)


def _whole(files: Iterable[Path], accepted: Set[Path]) -> list[Path]:
    """Return the robot files among some files, except included parts that were not accepted."""
    named = sorted(file for file in files if is_robot(file) or file.resolve() in accepted)
    robots = [source_file(str(file)) or file for file in named]
    parts = {part.resolve() for file in robots for part in included(file)} - accepted
    return [file for file in dict.fromkeys(robots) if file.resolve() not in parts]


def _accepted(baseline: Path) -> set[Path]:
    """Return the accepted robot files, resolved; some may no longer exist."""
    return {(baseline / name).resolve() for name, is_file in named_targets(baseline) if is_file}


def _run(state: Survey, options: Options, progress: Progress) -> Run:
    from physics_crosscheck.harness.run import run

    robots = {scan.folder: scan.robot for scan in state.running if scan.robot is not None}
    selection = Selection(models=state.chosen, snapshot=state.snapshot)
    return run(
        [scan.folder for scan in state.running if scan.folder not in robots],
        replace(options, selection=selection, robots=robots),
        progress,
        robots=list(robots),
    )


def _of_run(
    ran: Run, names: Mapping[str, FolderFiles], state: Survey, options: Options
) -> Iterator[Change]:
    again = {scan.folder: hashed_again(scan, state.place) for scan in state.running}
    # After a failed declaration only the folder is known; the baseline gives the system's name.
    systems = {str(scan.folder): name for name, scan in names.items()}
    for case in ran.results.cases:
        system = systems[case.folder]
        scan = names[system]
        yield classify(
            system,
            case,
            ran.measured.get((case.folder, case.id)),
            scan,
            state.systems.get(system),
            state.versions,
            options.resolution,
            stale=again[scan.folder] != scan,
        )


def _of_the_rest(
    ran: Sequence[Change], names: Mapping[str, FolderFiles], state: Survey, options: Options
) -> Iterator[Change]:
    """Yield the changes of accepted cases that were not run: unchanged, or gone."""
    seen = {change.id for change in ran}
    # A declaration or a sidecar that cannot be read makes its cases fail; they are not gone.
    failed = {(c.id.system, c.id.model) for c in ran if c.status is Status.NOT_RUN}
    for system, system_baseline in sorted(state.systems.items()):
        scan = names.get(system)
        if scan is None and not is_expected(system_baseline, options, state):
            continue
        for case, entry in system_baseline.cases.items():
            if case in seen or not state.includes(case.engine):
                continue
            if scan is not None and was_left_alone(scan, system_baseline, case, state):
                yield _as_accepted(entry)
            elif not failed & {(system, "system.py"), (system, case.model)}:
                yield Change(diff=gone(entry), entry=entry)


def _as_accepted(entry: AcceptedCase) -> Change:
    status = Status.SAME if entry.outcome is Outcome.AGREES else Status.EXPECTED
    diff = bare_diff(entry.id, status, before=entry.numbers, after=entry.numbers)
    return Change(diff=msgspec.structs.replace(diff, run=False), entry=entry)


MAX_FINDINGS = 5
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
        diff = msgspec.structs.replace(
            change.diff, status=Status.NOT_RUN, messages=(failed, *change.messages)
        )
        return replace(change, diff=diff)
    new = unaccepted_findings(
        model, None if system_baseline is None else system_baseline.audits.get(of_model)
    )
    if not new or (change.status.passes and of_model in moved):
        return change
    diff = msgspec.structs.replace(
        change.diff,
        messages=(*change.messages, *_finding_messages(new)),
        changed=(*change.diff.changed, "audit"),
    )
    if of_model not in moved:  # no motion shows it, in this case or another
        kinds = (*(kind for kind in change.kinds if kind != "text"), "audit")
        diff = msgspec.structs.replace(diff, status=Status.CHANGED, kinds=kinds)
    return replace(change, diff=diff, findings=new)


def _finding_messages(findings: tuple[AuditFinding, ...]) -> list[str]:
    messages = [
        (f"the audit finds {finding.location}: " if finding.location else "the audit: ")
        + finding.message
        for finding in findings[:MAX_FINDINGS]
    ]
    more = len(findings) - MAX_FINDINGS
    return messages + ([f"and {counted(more, 'finding')} more"] if more > 0 else [])
