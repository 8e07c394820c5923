"""Proposed changes of a model file: fixes, changed lines, and a patch."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.render.html.text import shown
from physics_crosscheck.harness.results.next_steps import ProposedChange, changes_of, stated_changes
from physics_crosscheck.harness.results.places import is_spelled


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """A proposed fix.

    Attributes:
        changes: numbers to change; empty if unknown.
        patch: a unified diff; empty if a change is uncertain.
    """

    changes: Sequence[ProposedChange] = ()
    patch: str = ""

    @property
    def words(self) -> str:
        """The numbers, a line each, without a patch."""
        return "\n".join(map(str, self.changes))


NO_REMEDY = Remedy()


def remedy_of(model: Model) -> Remedy:
    """Return the changes by the explaining cause of a model, or those that the audit proposes."""
    changes, is_whole = stated_changes(model), True
    if model.diagnosis is not None and model.diagnosis.explained:
        changes = changes_of(model)
        is_whole = len(changes) == len(model.diagnosis.explanations[0].causes)
    texts = ((model.model, model.text), (f"{model.model}.toml", model.sidecar))
    patch = unified(changes, texts) if is_whole and changes else ""
    # A patch that the page can't show unchanged would not apply.
    plain = patch.replace("\r\n", "\n")
    is_kept = shown(plain) == plain and "\ufffd" not in plain
    return Remedy(changes=changes, patch=patch if is_kept else "")


def unified(edits: Sequence[ProposedChange], texts: Iterable[tuple[str, str]]) -> str:
    """Return a unified diff that makes edits; empty if an edit is uncertain.

    An edit is certain if the file still has the old text in the span of each location.

    Args:
        edits: edits of one cause.
        texts: (name, text) of the files that may be edited.
    """
    parts, edit_count = [], 0
    for name, text in texts:
        data = text.encode(errors="surrogatepass")
        here = [
            (where.span, edit.new, where.file)
            for edit in edits
            for where in edit.locations
            if where.span is not None and is_spelled(where, name, data)
        ]
        edit_count += len(here)
        changed = data
        for (start, end), new, _ in sorted(here, reverse=True):
            changed = changed[:start] + new.encode() + changed[end:]
        if changed != data:
            parts.append(
                _diff(here[0][2], _lines(text), _lines(changed.decode(errors="surrogatepass")))
            )
    certain = edit_count == sum(len(edit.locations) for edit in edits)
    return "".join(parts) if certain else ""


def lines_of(patch: str) -> tuple[str, ...]:
    """Return the removed and added lines of a diff with their signs, with less indentation."""
    rows = (row for row in _lines(patch) if not row.startswith(("--- ", "+++ ")))
    changed_rows = [(row[0], row[1:].rstrip("\r\n")) for row in rows if row.startswith(("-", "+"))]
    margin = min((len(text) - len(text.lstrip()) for _, text in changed_rows), default=0)
    return tuple(f"{sign} {text[margin:]}" for sign, text in changed_rows)


def _lines(text: str) -> list[str]:
    """Split text into lines as `git` and `patch` do: `str.splitlines` splits at more characters."""
    *whole, last = text.split("\n")
    return [*(f"{line}\n" for line in whole), *([last] if last else [])]


def _diff(path: str, before: Sequence[str], after: Sequence[str]) -> str:
    """Return a diff with three lines of context for `git apply` and `patch -p1`."""
    # Both reject an absolute path.
    name = path if not path.startswith("/") and ":" not in path else path.rsplit("/", 1)[-1]
    end = "\t" if " " in name else ""  # a tab ends a name with blanks
    rows = []
    for row in difflib.unified_diff(before, after, f"a/{name}{end}", f"b/{name}{end}"):
        rows.append(row if row.endswith("\n") else f"{row}\n\\ No newline at end of file\n")
    return "".join(rows)
