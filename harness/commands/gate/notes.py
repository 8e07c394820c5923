"""Annotations of a pull request at file and line."""

from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.github import Annotation, case_note
from physics_crosscheck.harness.results.status import counted
from .result import GateResult
from .text import sentences

_QUIET = (Status.SAME, Status.WITHIN, Status.EXPECTED)
"""Statuses that need no attention."""


def notes(result: GateResult) -> list[Annotation]:
    """Return an annotation for each changed model and declaration, worst first, at the changed
    line.
    """
    alike: dict[tuple[str, str, Status], list[Change]] = {}
    for change in result.changes:
        if change.status not in _QUIET:
            about = change.id.system, change.id.model, change.status
            alike.setdefault(about, []).append(change)
    return [_note(result, changes) for changes in alike.values()]


def _note(result: GateResult, alike: list[Change]) -> Annotation:
    """Build the annotation of the first of several changes of one model."""
    change = alike[0]
    place = _place(result, change)
    others = f" (and {counted(len(alike) - 1, 'case')} more)" if len(alike) > 1 else ""
    message = [place.message] if place.message else []
    return Annotation(
        level="notice" if change.status is Status.IMPROVED else "error",
        file=place.file,
        line=place.line,
        title=f"{change.status}: {change.id}{others}",
        message="; ".join([*sentences(change), *message]),
    )


class _Place(NamedTuple):
    """A line to annotate, and a sentence on it."""

    file: Path
    line: int
    message: str = ""


def _place(result: GateResult, change: Change) -> _Place:
    """Return where to show a change: the diagnosed cause, a changed line, or the model file."""
    model = change.id.model
    if change.case is not None and change.case.outcome is Outcome.DIFFERS:
        note = case_note(change.case, result.model_of(change.case))
        if note.line is not None:
            return _Place(note.file, note.line, note.message)
    first = ["system.py", model] if "equations" in change.kinds else [model, f"{model}.toml"]
    mine = [diff for diff in result.file_diffs if diff.concerns(change.id)]
    mine.sort(key=lambda diff: first.index(diff.file) if diff.file in first else 2)
    changed = [
        _Place(Path(diff.path), one.line, one.message) for diff in mine for one in diff.changes
    ]
    return _of_finding(change, changed) or next(iter(changed), _Place(_file(result, change), 1))


def _of_finding(change: Change, changed: list[_Place]) -> _Place | None:
    """Return the line of an audit finding: a changed line, or any if nothing else is wrong."""
    wrong = [
        (Path(finding.location.file), finding.location.line)
        for finding in change.findings
        if finding.location is not None and finding.location.line is not None
    ]
    names = {(file.name, line) for file, line in wrong}
    for place in changed:
        if (place.file.name, place.line) in names:
            return place
    if not wrong or change.kinds != ("audit",):
        return None
    return _Place(*wrong[0])


def _file(result: GateResult, change: Change) -> Path:
    scan = result.folders.get(change.id.system)
    if scan is None:
        return Path(".")
    file = scan.base / change.id.model
    return file if file.is_file() else scan.folder
