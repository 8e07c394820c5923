"""Changes in files since they were accepted: literals and lines, with their places."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.baseline.fingerprint import OTHER_FILES, FolderFiles, changed_names
from physics_crosscheck.harness.baseline.store import accepted_text
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import Location
from physics_crosscheck.harness.modelfiles.locations import find_in
from physics_crosscheck.harness.modelfiles.numbers import numerals
from physics_crosscheck.harness.modelfiles.path_states import ABSENT
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.harness.records.baseline import ChangedLine, FileDiff

MOST_LINES = 12
"""Maximum number of changed lines reported for a file; beyond it, a diff is more useful."""

MOST_SHOWN = 100


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
        diffs.append(_file_diff(scan, system, name, accepted, sorted(models), baseline))
    return tuple(diffs)


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
    """Return how a file changed as a whole; empty if its lines changed."""
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
    is_robot = scan.robot is not None
    changed = _numbers(file, old, new) if is_robot else _literals(file, name, old, new, models)
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
                moved = f"{before.text} -> {after.text}"
                message = f"{within} {moved}, bound to {expression}"
                edit = f"{_spoken(within)} {moved}"
                changed.append(
                    ChangedLine(line=after.line, message=message, edit=edit, old=before.text)
                )
    return changed


def _numbers(file: Path, old: str, new: str) -> list[ChangedLine]:
    """Return the changed numbers of a robot file that have a name."""
    try:
        before, after = (numerals(Document(file, text.encode())) for text in (old, new))
    except LocationError:
        return []
    accepted = {number.address: number for number in before if number.has_name}
    changes = []
    for number in after:
        address, old_number = number.address, accepted.get(number.address)
        if old_number is not None and old_number.value != number.value:
            moved = f"{old_number.text} -> {number.text}"
            edit = f"{_spoken(address)} {moved}"
            message = f"{address} {moved}"
            changes.append(
                ChangedLine(line=number.line, message=message, edit=edit, old=old_number.text)
            )
    return changes


def _spoken(address: str) -> str:
    """Return a readable address of a literal: `joint[x]@damping` becomes `damping of joint x`."""
    *_, name = re.split(r"[@/]", address.removesuffix("@value"))
    owners = re.findall(r"(\w+)\[([^\]@/]*[^\]@/\d][^\]@/]*)\]", address)
    if not owners or name.startswith(f"{owners[-1][0]}["):
        return name
    kind, owner = owners[-1]
    return f"{name} of {kind} {owner}"


def _place(file: Path, text: str, address: str) -> Location | None:
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
