"""Text of a gate's result: for a terminal or a log, for a step summary, and for annotations."""

import os
import re
import shlex
from collections import Counter
from collections.abc import Collection, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple, TypeVar

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.records.baseline import ChangedLine, FileDiff
from physics_crosscheck.harness.records.case import CaseId, model_path
from physics_crosscheck.harness.records.codes import part_code
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.console import wrapped, wrapped_command
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.harness.results.github import Annotation, case_note
from physics_crosscheck.harness.results.issues import explained_alike, named_models
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible_lines
from .result import GateResult

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


QUIET = (Status.SAME,)
"""Statuses that a log only counts."""

MAX_ROWS = 200
"""Maximum number of cases in a summary; gate.json has all."""

MAX_GROUPS, MAX_CASES, MAX_EDITS, MAX_KNOWN, MAX_PATTERNS = 20, 12, 12, 5, 3
"""Maximum numbers of models, cases of a model, edits, known differences and patterns in a
terminal.
"""

_MARKUP = re.compile(r"[<>|`*~\[\]!\\$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters that Markdown, or GitHub's formulas, interpret as markup."""

_REFERENCE = re.compile(r"@|&#35;(?=\d)|www(?=\.)|https?(?=:)|ftp(?=:)")
"""Start of a mention, an issue reference or a link in escaped text; a comment after it
breaks it.
"""


def gate_lines(result: GateResult, width: int = 80, given: Sequence[str] | None = ()) -> list[str]:
    """Return the lines for a terminal: the verdict, the edit, the remedy, each case, and a total.

    Args:
        result: result of the gate.
        width: columns of the terminal.
        given: options that `crosscheck accept` needs to see the same cases; None: no remedy.
    """
    if not result.changes:
        return [*_headline(result, width), *_failures(result, width)]
    if result.passes:
        return [*_headline(result, width), *_remarks(result, width, given is not None)]
    lines = [*_headline(result, width), *_edit_list(result, width)]
    lines += [] if given is None else remedy(result, width, given)
    lines += _failures(result, width)
    for text in _causes(result):
        lines += wrapped(text, width)
    groups, place = _groups(result.failing), _sole_edit(result)
    for group in groups[:MAX_GROUPS]:
        named = place is not None and Path(place.path).name == group[0].id.model
        lines += _group_lines(group, width, with_audit=not named)
    if len(groups) > MAX_GROUPS:
        more = counted(len(groups) - MAX_GROUPS, "model")
        lines.append(f"  and {more} more, listed in gate.json")
    return [*lines, *wrapped(total(result), width)]


def verdict(result: GateResult) -> str:
    """Return the first word of the output: `ok`, `FAIL` or `ERROR`."""
    if result.passes:
        return "ok"
    return "ERROR" if result.is_incomplete else "FAIL"


def _headline(result: GateResult, width: int) -> list[str]:
    return wrapped(f"{verdict(result)}  {headline(result)}", width)


def headline(result: GateResult) -> str:
    """Return the cause of the verdict: one edit, one engine upgrade, or the counts."""
    if not result.changes:
        return "no cases found. Name a system folder or a robot file: crosscheck gate robot.urdf"
    if result.passes:
        return total(result)
    bad = result.failing
    what = f"{len(bad)} of {counted(len(result.changes), 'case')}"
    status = _sole_item({change.status for change in bad})
    if place := _sole_edit(result):
        edit = ", ".join(line.edit for line in place.changes)
        effect = "broke" if status is Status.NOT_RUN else "changed"
        if all("untested" in change.kinds for change in bad):
            effect = "is not tested in"
        where = _where(place, place.changes[0])
        if all(line.old for line in place.changes):
            return f"{where} {edit} {effect} {what}"
        return f"{where} {effect} {what}; {edit}"
    if status is Status.CHANGED and (upgrade := _sole_item({_upgrade(change) for change in bad})):
        return f"{upgrade} changed {what}"
    if not bad:
        return f"{counted(len(result.failures), 'check')} failed"
    if status is Status.NEW:
        return f"{what} {_be(bad)} new: the baseline has no entry for them"
    if status is not None:
        return f"{what} {f'{_be(bad)} {status}' if status is Status.GONE else status}"
    counts = Counter(change.status for change in bad)
    parts = [_counted(one, counts[one]) for one in Status if counts[one]]
    return f"{what}: {', '.join(parts)}"


def _be(changes: Sequence[Change]) -> str:
    return "is" if len(changes) == 1 else "are"


Item = TypeVar("Item")


def _sole_item(items: Collection[Item]) -> Item | None:
    """Return the only item of a collection; None if it has several or none."""
    return next(iter(items)) if len(items) == 1 else None


def _upgrade(change: Change) -> str:
    """Return how the engine's version changed; "" if it did not."""
    was, now = change.entry, change.now
    if was is None or now is None or was.engine_version == now.engine_version:
        return ""
    return f"{was.engine_version} -> {now.engine_version}"


def _concerned(result: GateResult) -> list[FileDiff]:
    """Return the changed files that cases that fail depend on."""
    failing = [change.id for change in result.failing]
    return [diff for diff in result.file_diffs if any(map(diff.concerns, failing))]


def _sole_edit(result: GateResult) -> FileDiff | None:
    """Return a file with edits of one line, if all cases that fail depend on it and on no other.

    Files outside of the folder, such as an engine's own modules, do not count.
    """
    diff = _sole_item([diff for diff in _concerned(result) if not diff.is_outside])
    if diff is None or diff.more or not all(diff.concerns(one.id) for one in result.failing):
        return None
    is_one_line = len({line.line for line in diff.changes}) == 1
    return diff if is_one_line and all(line.edit for line in diff.changes) else None


def _edit_list(result: GateResult, width: int) -> list[str]:
    """Return the edits, except one in the headline; other files share one line."""
    diffs = _concerned(result)
    edits = [(diff, line) for diff in diffs for line in diff.changes if line.edit]
    shown = [] if _sole_edit(result) else edits[:MAX_EDITS]
    lines: list[str] = []
    for diff, line in shown:
        lines += wrapped(f"  {_where(diff, line)} {line.edit}", width)
    more = sum(diff.more for diff in diffs) + len(edits[len(shown) :] if shown else ())
    if more:
        lines.append(f"  and {counted(more, 'more edit')}, listed in summary.md")
    inside = [diff for diff in diffs if not diff.is_outside]
    others = [(diff, line) for diff in inside for line in diff.changes if not line.edit]
    for diff, line in others[:MAX_EDITS]:
        lines += wrapped(f"  {_relative(Path(diff.path))}: {line.message}", width)
    outside = {diff.file for diff in diffs if diff.is_outside}
    if outside:
        files = counted(len(outside), "file")
        lines += wrapped(f"  also changed: {files} outside of the folder, see gate.json", width)
    return lines


def remedy(result: GateResult, width: int, given: Sequence[str]) -> list[str]:
    """Return the remedy: undo the edit, or accept the changes, with the command."""
    bad = result.failing
    if not bad or result.with_status(Status.NOT_RUN):
        return wrapped("Fix: correct the error below and run crosscheck gate again.", width)
    place = _sole_edit(result)
    sole = None if place is None else _sole_item(place.changes)
    if sole is not None and sole.old:
        undo = f"set it back to {sole.old}, or accept the change:"
    else:
        undo = {
            Status.NEW: "accept them:",
            Status.GONE: "restore the files, or accept the removal:",
        }.get(bad[0].status, "undo the edit, or accept the change:")
    words = ["crosscheck accept", '--reason "WHY"', *given, *_patterns(bad)]
    return [*wrapped(f"Fix: {undo}", width), *wrapped_command(words, width)]


def _patterns(changes: Sequence[Change]) -> list[str]:
    """Return patterns for `crosscheck accept` that match the models of some cases; empty: all."""
    models = list(dict.fromkeys(f"{one.id.path}/*" for one in changes))
    if len(models) > MAX_PATTERNS:
        models = list(dict.fromkeys(f"{one.id.system}/*" for one in changes))
    return [] if len(models) > MAX_PATTERNS else [shlex.quote(one) for one in models]


def _failures(result: GateResult, width: int) -> list[str]:
    lines = [f"ERROR  {with_code(part_code(), failure)}" for failure in result.failures]
    return [each for line in lines for each in wrapped(line, width)]


def _remarks(result: GateResult, width: int, with_remedy: bool) -> list[str]:
    """Return a line for the cases that pass but are not simply as accepted."""
    lines: list[str] = []
    if better := _groups(result.with_status(Status.IMPROVED)):
        names = ", ".join(group[0].id.path for group in better)
        remedy = f"  improved: {names}; crosscheck accept keeps the improvement"
        texts = [_group_lines(group, width, with_audit=False) for group in better]
        lines += wrapped(remedy, width) if with_remedy else chain.from_iterable(texts)
    known_differences = Counter(
        f"{change.id.path}: {change.entry.outcome} ({change.entry.reason})"
        for change in result.with_status(Status.EXPECTED)
        if change.entry is not None
    )
    for text, number in known_differences.most_common(MAX_KNOWN):
        lines += wrapped(f"  {counted(number, 'known difference')} in {text}", width)
    if len(known_differences) > MAX_KNOWN:
        lines.append(f"  and {len(known_differences) - MAX_KNOWN} more, listed in gate.json")
    return lines


def _groups(changes: Sequence[Change]) -> list[list[Change]]:
    """Group cases by model, status and code, in the order of the worst."""
    groups: dict[tuple[str, str, Status, str], list[Change]] = {}
    for change in changes:
        key = change.id.system, change.id.model, change.status, change.diff.code
        groups.setdefault(key, []).append(change)
    return list(groups.values())


def code_hint(result: GateResult) -> str:
    """Return how to explain the first code that a failing gate prints; "" otherwise."""
    codes = [change.diff.code for change in result.failing]
    return explain_hint([*codes, *(part_code() for _ in result.failures)])


def _group_lines(group: Sequence[Change], width: int, *, with_audit: bool) -> list[str]:
    """Return a line for each case of a model; common facts appear once."""
    first = group[0]
    name = with_code(first.diff.code, first.id.path)
    lines = wrapped(f"{first.status}  {name}", width)
    messages = [
        [text for text in sentences(one) if with_audit or not text.startswith("the audit")]
        for one in group
    ]
    shared = [text for text in messages[0] if all(text in others for others in messages)]
    details: dict[str, list[str]] = {}
    for change, texts in zip(group, messages, strict=True):
        text = "; ".join(text for text in texts if text not in shared)
        details.setdefault(text, []).append(f"{change.id.scenario} [{change.id.engine}]")
    for text, names in list(details.items())[:MAX_CASES]:
        lines += wrapped(f"  {', '.join(sorted(names))}{': ' if text else ''}{text}", width)
    if len(details) > MAX_CASES:
        lines.append(f"  and {counted(len(details) - MAX_CASES, 'case')} more, listed in gate.json")
    for text in shared:
        lines += wrapped(f"  {text}", width)
    return lines


def accepted_lines(
    result: GateResult,
    cases: Sequence[CaseId],
    files: Sequence[Path],
    width: int,
    *,
    with_cases: bool = False,
) -> list[str]:
    """Return the accepted cases, a line for each system with what is amiss, and written files."""
    lines: list[str] = []
    for system, number in Counter(case.system for case in cases).items():
        amiss: dict[str, dict[str, None]] = {}
        for change in result.changes:
            if change.id not in cases or change.id.system != system or change.now is None:
                continue
            if change.now.outcome is not Outcome.AGREES:
                amiss.setdefault(f"{change.now.outcome} in ", {})[change.id.engine] = None
            model = None if change.case is None else result.model_of(change.case)
            codes = [] if model is None else [one.code for one in model.findings]
            amiss.setdefault("faults in the file: ", {}).update(dict.fromkeys(codes))
        words = "; ".join(f"{what}{', '.join(names)}" for what, names in amiss.items() if names)
        text = f"Accepted {counted(number, 'case')} of {system}{words and f': {words}'}"
        lines += wrapped(text, width)
    if not cases:
        lines.append("Nothing to accept: every case is as accepted")
    if with_cases:
        lines += [line for case in cases for line in wrapped(f"  {case}", width)]
    if files:
        where = os.path.commonpath([file.parent for file in files])
        lines += wrapped(f"Wrote {counted(len(files), 'file')} in {where}. Commit them.", width)
    return lines


def total(result: GateResult) -> str:
    """Return one line: the number of cases of each kind, of cases that ran, and the time."""
    if not result.changes:
        return "no cases found"
    counts = Counter(change.status for change in result.changes)
    ran = sum(change.case is not None for change in result.changes)
    cost = f"({ran} run, {result.seconds:.1f} s)"
    cases = counted(len(result.changes), "case")
    parts = [_counted(status, counts[status]) for status in Status if counts[status]]
    if len(parts) == 1:
        return f"{cases} {parts[0].partition(' ')[2]} {cost}"
    return f"{cases}: {', '.join(parts)} {cost}"


def _counted(status: Status, number: int) -> str:
    """Return how many cases have a status, as in `3 changed` or `2 known differences`."""
    if status is Status.EXPECTED:
        return counted(number, status.value)
    return f"{number} with {status}" if status is Status.WITHIN else f"{number} {status}"


def summary(result: GateResult) -> str:
    """Return the result as Markdown."""
    lines = [f"## crosscheck gate: {verdict(result)}", "", total(result), ""]
    listed = [change for change in result.changes if change.status not in QUIET]
    if listed:
        lines += ["| case | | what changed | |", "|---|---|---|---|"]
        for change in listed[:MAX_ROWS]:
            message = "<br>".join(_cell(sentence) for sentence in sentences(change))
            kinds = ", ".join(change.kinds)
            lines.append(f"| {_cell(str(change.id))} | {change.status} | {kinds} | {message} |")
        if len(listed) > MAX_ROWS:
            lines += ["", f"and {len(listed) - MAX_ROWS} more"]
    for diff in result.file_diffs:
        lines += ["", f"**{_cell(model_path(diff.system, diff.file))}**", ""]
        lines += [f"- {_code(_where(diff, one))} {_cell(one.message)}" for one in diff.changes]
        if diff.more:
            lines.append(f"- and {counted(diff.more, 'more line')}")
    causes = [*_causes(result), *(f"FAILED {failure}" for failure in result.failures)]
    if causes:
        lines += ["", *(f"- {_cell(cause.strip())}" for cause in causes)]
    return "\n".join(lines) + "\n"


def sentences(change: Change) -> Sequence[str]:
    """Return the changes of a case; for a known difference, the reason of its acceptance first."""
    if change.status is Status.EXPECTED and change.entry is not None:
        return [f"{change.entry.outcome}, accepted: {change.entry.reason}", *change.messages]
    return change.messages


def _causes(result: GateResult) -> list[str]:
    """Return the causes that the diagnosis found for models that differ."""
    lines: list[str] = []
    for alike in explained_alike(result.results.models if result.results else ()):
        diagnosis = alike[0].diagnosis
        if diagnosis and diagnosis.explained and diagnosis.explanations:
            best = diagnosis.explanations[0]
            *texts, tail = cause_sentences(best)
            coded = zip((cause.code for cause in best.causes), texts, strict=True)
            lines.append(f"cause in {named_models(alike)}")
            lines += [f"  {text}" for text in (*(with_code(*one) for one in coded), tail)]
    return lines


def _where(diff: FileDiff, changed: ChangedLine) -> str:
    """Return the place of a changed line, as `models/arm/robot.urdf:12`."""
    return f"{_relative(Path(diff.path))}:{changed.line}"


def _relative(path: Path) -> str:
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()


def _cell(text: str) -> str:
    """Escape one line of text for Markdown: no markup, link, mention or issue reference."""
    text = " ".join(visible_lines(text)).replace("&", "&amp;")
    text = _MARKUP.sub(lambda match: f"&#{ord(match[0])};", text)
    return _REFERENCE.sub(r"\g<0><!-- -->", text)


def _code(text: str) -> str:
    """Format one line of text as a code span, with a fence longer than its runs of backticks."""
    text = " ".join(visible_lines(text))
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    pad = " " if "`" in text else ""
    return f"{fence}{pad}{text}{pad}{fence}"
