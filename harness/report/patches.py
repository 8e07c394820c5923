"""What is to be changed in a file, as text that a person can paste: lines, and a unified diff."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

from harness.text.next_steps import Change

_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
_SUBJECT = re.compile(r"([\w-]+)(?:\[\d+\])?$")


def unified(edits: Sequence[Change], texts: Iterable[tuple[str, str]]) -> str:
    """A unified diff that makes edits; empty where one of them is not certain.

    An edit is certain where its lines have its old number as often as it has addresses.

    Args:
        edits: of one cause.
        texts: (name, text) of the files that may be meant.
    """
    parts, made = [], 0
    for name, text in texts:
        lines = text.splitlines(keepends=True)
        changed = list(lines)
        path = ""
        for edit in edits:
            rows = {w.line: w.file for w in edit.where if w.line and _same_file(w.file, name)}
            found = sum(_put(changed, row, edit) for row in rows)
            if found and found == len(edit.subject):
                made += 1
                path = next(iter(rows.values()))
        if changed != lines:
            parts.append(_diff(path or name, lines, changed))
    return "".join(parts) if made == len(edits) else ""


def lines_of(patch: str) -> tuple[str, ...]:
    """The lines of a diff that go and come, each with its sign, and not far to the right."""
    rows = (row for row in patch.splitlines() if not row.startswith(("---", "+++")))
    told = [(row[0], row[1:]) for row in rows if row.startswith(("-", "+"))]
    margin = min((len(text) - len(text.lstrip()) for _, text in told), default=0)
    return tuple(f"{sign} {text[margin:]}" for sign, text in told)


def _same_file(path: str, name: str) -> bool:
    return f"/{path}".replace("\\", "/").endswith(f"/{name}")


def _put(lines: list[str], row: int, edit: Change) -> int:
    """Put the new number into a line, and say how often."""
    if row > len(lines):
        return 0
    line = lines[row - 1]
    spans = [m.span() for m in _NUMBER.finditer(line) if float(m[0]) == edit.old]
    wanted = len(edit.subject)
    if len(spans) > wanted or (len(spans) > 1 and len(edit.where) > 1):
        spans = [span for span in spans if _attribute(line, span[0]) in _names(edit.subject)]
    for start, end in reversed(spans):
        line = line[:start] + edit.new + line[end:]
    lines[row - 1] = line
    return len(spans)


def _names(subject: Iterable[str]) -> set[str]:
    """What numbers are called where they stand: `mass` of `link[rod]/inertial@mass`, say."""
    return {found[1] for one in subject if (found := _SUBJECT.search(one))}


def _attribute(line: str, place: int) -> str:
    """The attribute, or the key, that a place of a line belongs to."""
    names: list[str] = re.findall(r"([\w-]+)\s*=", line[:place])
    return names[-1] if names else ""


def _diff(path: str, before: Sequence[str], after: Sequence[str]) -> str:
    """With three lines about it, as `git apply` and `patch -p1` take it from where one stands."""
    # An absolute path is none that either takes.
    name = path if not path.startswith("/") and ":" not in path else path.rsplit("/", 1)[-1]
    rows = []
    for row in difflib.unified_diff(before, after, f"a/{name}", f"b/{name}"):
        rows.append(row if row.endswith("\n") else f"{row}\n\\ No newline at end of file\n")
    return "".join(rows)
