"""Tables of all files: robots that move, verdicts, differences and refusals."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from enum import StrEnum
from pathlib import Path

from campaigns.real_models.entry import REFUSED, STILL, EngineResult, FileEntry
from physics_crosscheck.harness.records.outcome import Outcome

FORMATS = ("MJCF", "URDF")

EXAMPLES = 4
"""Largest number of file names after a reason."""

MAX_REASON_LENGTH = 160
"""Largest number of characters of a reason in a table."""


class FileKind(StrEnum):
    """The kind of a file by its result."""

    PART = "part of another file, not a model by itself"
    STILL = "no moving joint"
    VERDICT = "verdict: AGREES or DIFFERS in at least one engine"
    UNRESOLVED = "UNRESOLVED in every engine that runs it"
    FAULT = "no verdict: a reported fault of the file"
    BROKEN = "no verdict: out of time or memory, or a crash"
    REFUSED = "no verdict: not supported"

    @property
    def moves(self) -> bool:
        """True if the file counts among the robots that move."""
        return self not in (FileKind.PART, FileKind.STILL)


FAULTS = (
    "sets to zero", "inertia must satisfy", "inertia must have positive", "larger than mjMINVAL",
    "has inertia", "kinematics alone", "no <link>", "xacro", "finite number", "Error opening file",
    "not found", "repeated", "Error: ", "no XML",
)  # fmt: skip
"""Words of refusals because of a fault in the file, not because of a missing feature."""

BREAKS = ("processor seconds", "has not ended", "GiB", "the process", "signal")
"""Words of failures by a limit or a crash."""


def kind_of(entry: FileEntry, parts: Collection[str]) -> FileKind:
    """Return the kind of a file.

    Args:
        entry: of the file.
        parts: resolved paths of files that other files include.
    """
    if any(STILL in one for one in entry.obstacles) or (entry.tree and not entry.dof):
        return FileKind.STILL
    unread = any(REFUSED in one for one in entry.obstacles)
    if unread and str(Path(entry.file).resolve()) in parts:
        return FileKind.PART
    outcomes = {result.outcome for result in entry.cases}
    if outcomes & {Outcome.AGREES, Outcome.DIFFERS}:
        return FileKind.VERDICT
    if Outcome.UNRESOLVED in outcomes:
        return FileKind.UNRESOLVED
    reasons = " ".join([*entry.obstacles, *(result.reason for result in entry.cases)])
    if any(word in reasons for word in BREAKS):
        return FileKind.BROKEN
    return FileKind.FAULT if any(word in reasons for word in FAULTS) else FileKind.REFUSED


def generic_reason(entry: FileEntry, sentence: str) -> str:
    """Return a reason without file, line, names and numbers, so that equal ones count together."""
    reason = re.sub(rf"{re.escape(entry.file)}(:\d+)*:? ?", "", sentence)
    reason = reason.removesuffix(
        "; `crosscheck compare` compares it with another file, without equations"
    )
    reason = re.sub(r"(?<!\w)'[^']*'|(?<!\w)\"[^\"]*\"|-?\b\d+(\.\d+)?(e[-+]?\d+)?\b", "*", reason)
    reason = re.sub(r"\*(, \*)+", "*", reason)  # a list of names, however long
    return reason[:MAX_REASON_LENGTH]


def table(title: str, rows: dict[str, list[str]]) -> str:
    """Return a table with a line per kind, most frequent first, with names of files."""
    lines = [title]
    for what, names in sorted(rows.items(), key=lambda row: -len(row[1])):
        more = ", ..." if len(names) > EXAMPLES else ""
        lines.append(f"  {len(names):5}  {what}  [{', '.join(names[:EXAMPLES])}{more}]")
    return "\n".join(lines if rows else [title, "  none"])


def shares(entries: Sequence[FileEntry], kinds: Sequence[FileKind]) -> str:
    """Return the counts of files by format and kind, with shares of the robots that move."""
    lines = []
    for name in FORMATS:
        of_format = [
            kind for entry, kind in zip(entries, kinds, strict=True) if entry.format == name
        ]
        moving = sum(kind.moves for kind in of_format)
        lines.append(f"{name}: {len(of_format)} files, {moving} robots that move")
        for kind in FileKind:
            count = of_format.count(kind)
            share = f"  {count / moving:6.1%}" if kind.moves and moving else ""
            lines.append(f"  {count:5}  {kind.value}{share}")
    return "\n".join(lines)


def outcomes(entries: Iterable[FileEntry]) -> str:
    """Return the counts of outcomes by format and engine."""
    rows: dict[str, list[str]] = defaultdict(list)
    for entry in entries:
        for result in entry.cases:
            rows[f"{entry.format} {result.engine:<9} {result.outcome}"].append(
                Path(entry.file).name
            )
    return table("outcomes, by format and engine", rows)


def reasons(entries: Sequence[FileEntry], kinds: Sequence[FileKind]) -> str:
    """Return the reasons of files without a verdict, and of engines without one of other files."""
    none: dict[str, list[str]] = defaultdict(list)
    other: dict[str, list[str]] = defaultdict(list)
    for entry, kind in zip(entries, kinds, strict=True):
        if not kind.moves:
            continue
        name = Path(entry.file).name
        rows = other if kind is FileKind.VERDICT else none
        for sentence in entry.obstacles:
            rows[f"{entry.format}: {generic_reason(entry, sentence)}"].append(name)
        for result in entry.cases:
            if result.outcome in (Outcome.FAILED, Outcome.UNRESOLVED):
                reason = generic_reason(entry, result.reason)
                rows[f"{entry.format} {result.engine} {result.outcome}: {reason}"].append(name)
    return "\n\n".join([
        table("no verdict, by reason", none),
        table("no verdict in an engine, but in another, by reason", other),
    ])  # fmt: skip


def differing(entries: Iterable[FileEntry]) -> str:
    """Return every case that differs, with its cause."""
    lines = ["DIFFERS"]
    for entry in entries:
        for result in entry.cases:
            if result.outcome is Outcome.DIFFERS:
                lines += [
                    f"  {entry.file} in {result.engine}: {result.reason}",
                    f"    {result.cause}",
                ]
    return "\n".join(lines if len(lines) > 1 else ["DIFFERS", "  none"])


def left_out(entries: Sequence[FileEntry], kinds: Sequence[FileKind]) -> str:
    """Return the counts of elements that verdicts ignore."""
    rows: dict[str, list[str]] = defaultdict(list)
    for entry, kind in zip(entries, kinds, strict=True):
        for what in entry.left_out if kind is FileKind.VERDICT else ():
            rows[f"{entry.format}: {what}"].append(Path(entry.file).name)
    return table("elements that verdicts ignore, files", rows)


def worst(entries: Iterable[FileEntry]) -> str:
    """Return the largest discrepancy and uncertainty of cases that agree."""
    agree = [
        result for entry in entries for result in entry.cases if result.outcome is Outcome.AGREES
    ]
    discrepancy = max((result.discrepancy or 0.0 for result in agree), default=0.0)
    uncertainty = max((result.uncertainty or 0.0 for result in agree), default=0.0)
    return f"{len(agree)} cases agree; largest E {discrepancy:.1e}, largest U {uncertainty:.1e}"


def case_lines(entry: FileEntry) -> list[str]:
    """Return a line per engine: AGREES mujoco kuka_iiwa/model.urdf E 8.3e-13 U 2.6e-10."""
    if not entry.cases:
        return [f"{'-':<10} {'-':<9} {entry.file}: {'; '.join(entry.obstacles) or STILL}"]
    return [_case(entry.file, result) for result in entry.cases]


def _case(file: str, result: EngineResult) -> str:
    where = f"{result.outcome:<10} {result.engine:<9} {file}"
    if result.discrepancy is None or result.uncertainty is None:
        return f"{where}: {result.reason}"
    reason = f": {result.reason}" if result.reason else ""
    return f"{where} E {result.discrepancy:.1e} U {result.uncertainty:.1e}{reason}"


def summary(entries: Sequence[FileEntry], parts: Collection[str]) -> str:
    """Return all tables."""
    kinds = [kind_of(entry, parts) for entry in entries]
    return "\n\n".join([
        shares(entries, kinds), outcomes(entries), worst(entries), differing(entries),
        reasons(entries, kinds), left_out(entries, kinds),
    ])  # fmt: skip
