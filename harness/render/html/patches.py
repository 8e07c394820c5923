"""What is to be changed in a file, as text that a person can paste: lines, and a unified diff."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from physics_crosscheck.harness.results.next_steps import Change
from physics_crosscheck.harness.results.places import is_spelled


def unified(edits: Sequence[Change], texts: Iterable[tuple[str, str]]) -> str:
    """Return a unified diff that makes edits; empty where one of them is not certain.

    An edit is certain where the file still has the old text in the span of each location.

    Args:
        edits: of one cause.
        texts: (name, text) of the files that may be meant.
    """
    parts, made = [], 0
    for name, text in texts:
        data = text.encode(errors="surrogatepass")
        here = [
            (where.span, edit.new, where.file)
            for edit in edits
            for where in edit.locations
            if where.span is not None and is_spelled(where, name, data)
        ]
        made += len(here)
        changed = data
        for (start, end), new, _ in sorted(here, reverse=True):
            changed = changed[:start] + new.encode() + changed[end:]
        if changed != data:
            parts.append(
                _diff(here[0][2], _lines(text), _lines(changed.decode(errors="surrogatepass")))
            )
    certain = made == sum(len(edit.locations) for edit in edits)
    return "".join(parts) if certain else ""


def lines_of(patch: str) -> tuple[str, ...]:
    """The lines of a diff that go and come, each with its sign, and not far to the right."""
    rows = (row for row in _lines(patch) if not row.startswith(("--- ", "+++ ")))
    told = [(row[0], row[1:].rstrip("\r\n")) for row in rows if row.startswith(("-", "+"))]
    margin = min((len(text) - len(text.lstrip()) for _, text in told), default=0)
    return tuple(f"{sign} {text[margin:]}" for sign, text in told)


def _lines(text: str) -> list[str]:
    """Lines as `git` and `patch` count them: `str.splitlines` ends lines at more characters."""
    *whole, last = text.split("\n")
    return [*(f"{line}\n" for line in whole), *([last] if last else [])]


def _diff(path: str, before: Sequence[str], after: Sequence[str]) -> str:
    """With three lines about it, as `git apply` and `patch -p1` take it from where one stands."""
    # An absolute path is none that either takes.
    name = path if not path.startswith("/") and ":" not in path else path.rsplit("/", 1)[-1]
    end = "\t" if " " in name else ""  # a name with blanks ends at a tab
    rows = []
    for row in difflib.unified_diff(before, after, f"a/{name}{end}", f"b/{name}{end}"):
        rows.append(row if row.endswith("\n") else f"{row}\n\\ No newline at end of file\n")
    return "".join(rows)
