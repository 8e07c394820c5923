"""What became of all files, in counts: what is a robot that moves, and who has a verdict."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from enum import StrEnum
from pathlib import Path

from campaigns.real_models.entry import REFUSED, STILL, Came, Entry
from physics_crosscheck.harness.records.outcome import Outcome

FORMATS = ("MJCF", "URDF")

EXAMPLES = 4
"""Files named beside a reason."""

LONGEST = 160
"""Characters of a reason in a table."""


class Kind(StrEnum):
    """What a file is to the campaign."""

    PART = "part of another file, and no model alone"
    STILL = "nothing of it moves"
    VERDICT = "verdict: AGREES or DIFFERS in one engine at least"
    UNRESOLVED = "UNRESOLVED in every engine that runs it"
    FAULT = "no verdict: the file's own fault, which is told"
    BROKEN = "no verdict: out of time or memory, or a process that ended"
    REFUSED = "no verdict: not covered"

    @property
    def moves(self) -> bool:
        """Whether it counts among the robots that move."""
        return self not in (Kind.PART, Kind.STILL)


FAULTS = (
    "sets to zero", "inertia must satisfy", "inertia must have positive", "larger than mjMINVAL",
    "has inertia", "kinematics alone", "no <link>", "xacro", "finite number", "Error opening file",
    "not found", "repeated", "Error: ", "no XML",
)  # fmt: skip
"""Words of refusals that say what is wrong with a file, rather than what is not covered."""

BREAKS = ("processor seconds", "has not ended", "GiB", "the process", "signal")
"""Words of what ends a task from without."""


def kind_of(entry: Entry, parts: Collection[str]) -> Kind:
    """What a file is.

    Args:
        entry: of the file.
        parts: resolved paths of what other files include.
    """
    if any(STILL in one for one in entry.obstacles) or (entry.tree and not entry.freedoms):
        return Kind.STILL
    unread = any(REFUSED in one for one in entry.obstacles)
    if unread and str(Path(entry.file).resolve()) in parts:
        return Kind.PART
    outcomes = {came.outcome for came in entry.cases}
    if outcomes & {Outcome.AGREES, Outcome.DIFFERS}:
        return Kind.VERDICT
    if Outcome.UNRESOLVED in outcomes:
        return Kind.UNRESOLVED
    reasons = " ".join([*entry.obstacles, *(came.reason for came in entry.cases)])
    if any(word in reasons for word in BREAKS):
        return Kind.BROKEN
    return Kind.FAULT if any(word in reasons for word in FAULTS) else Kind.REFUSED


def plain(entry: Entry, sentence: str) -> str:
    """A reason without its file, line, names and numbers: alike for all that fail alike."""
    told = re.sub(rf"{re.escape(entry.file)}(:\d+)*:? ?", "", sentence)
    told = told.removesuffix(
        "; `crosscheck compare` compares it with another file, without equations"
    )
    told = re.sub(r"(?<!\w)'[^']*'|(?<!\w)\"[^\"]*\"|-?\b\d+(\.\d+)?(e[-+]?\d+)?\b", "*", told)
    told = re.sub(r"\*(, \*)+", "*", told)  # a list of names, however long
    return told[:LONGEST]


def table(title: str, rows: dict[str, list[str]]) -> str:
    """One line a kind, the most frequent first, with the files' names."""
    lines = [title]
    for what, names in sorted(rows.items(), key=lambda row: -len(row[1])):
        more = ", ..." if len(names) > EXAMPLES else ""
        lines.append(f"  {len(names):5}  {what}  [{', '.join(names[:EXAMPLES])}{more}]")
    return "\n".join(lines if rows else [title, "  none"])


def shares(entries: Sequence[Entry], kinds: Sequence[Kind]) -> str:
    """How many files of each format are what, and the share of the robots that move."""
    lines = []
    for name in FORMATS:
        own = [kind for entry, kind in zip(entries, kinds, strict=True) if entry.format == name]
        moving = sum(kind.moves for kind in own)
        lines.append(f"{name}: {len(own)} files, {moving} robots that move")
        for kind in Kind:
            count = own.count(kind)
            share = f"  {count / moving:6.1%}" if kind.moves and moving else ""
            lines.append(f"  {count:5}  {kind.value}{share}")
    return "\n".join(lines)


def outcomes(entries: Iterable[Entry]) -> str:
    """How each engine came out."""
    rows: dict[str, list[str]] = defaultdict(list)
    for entry in entries:
        for came in entry.cases:
            rows[f"{entry.format} {came.engine:<9} {came.outcome}"].append(Path(entry.file).name)
    return table("outcomes, by format and engine", rows)


def reasons(entries: Sequence[Entry], kinds: Sequence[Kind]) -> str:
    """Why files have no verdict; and why an engine has none of a file that has one in another."""
    none: dict[str, list[str]] = defaultdict(list)
    other: dict[str, list[str]] = defaultdict(list)
    for entry, kind in zip(entries, kinds, strict=True):
        if not kind.moves:
            continue
        name = Path(entry.file).name
        rows = other if kind is Kind.VERDICT else none
        for sentence in entry.obstacles:
            rows[f"{entry.format}: {plain(entry, sentence)}"].append(name)
        for came in entry.cases:
            if came.outcome in (Outcome.FAILED, Outcome.UNRESOLVED):
                told = f"{entry.format} {came.engine} {came.outcome}: {plain(entry, came.reason)}"
                rows[told].append(name)
    return "\n\n".join([
        table("no verdict, by reason", none),
        table("no verdict in one engine, one in another, by reason", other),
    ])  # fmt: skip


def differing(entries: Iterable[Entry]) -> str:
    """Every case that differs, with the cause that was found."""
    lines = ["DIFFERS"]
    for entry in entries:
        for came in entry.cases:
            if came.outcome is Outcome.DIFFERS:
                lines += [f"  {entry.file} in {came.engine}: {came.reason}", f"    {came.cause}"]
    return "\n".join(lines if len(lines) > 1 else ["DIFFERS", "  none"])


def left_out(entries: Sequence[Entry], kinds: Sequence[Kind]) -> str:
    """What robots that have a verdict say beyond it."""
    rows: dict[str, list[str]] = defaultdict(list)
    for entry, kind in zip(entries, kinds, strict=True):
        for what in entry.left_out if kind is Kind.VERDICT else ():
            rows[f"{entry.format}: {what}"].append(Path(entry.file).name)
    return table("left out of a verdict, files", rows)


def worst(entries: Iterable[Entry]) -> str:
    """The largest discrepancy and uncertainty of what agrees."""
    agree = [came for entry in entries for came in entry.cases if came.outcome is Outcome.AGREES]
    most = max((came.discrepancy or 0.0 for came in agree), default=0.0)
    least = max((came.uncertainty or 0.0 for came in agree), default=0.0)
    return f"{len(agree)} cases agree, to {most:.1e} at most, known to {least:.1e} at least"


def line(entry: Entry) -> list[str]:
    """Such as: AGREES mujoco kuka_iiwa/model.urdf E 8.3e-13 U 2.6e-10; one an engine."""
    if not entry.cases:
        return [f"{'-':<10} {'-':<9} {entry.file}: {'; '.join(entry.obstacles) or STILL}"]
    return [_case(entry.file, came) for came in entry.cases]


def _case(file: str, came: Came) -> str:
    where = f"{came.outcome:<10} {came.engine:<9} {file}"
    if came.discrepancy is None or came.uncertainty is None:
        return f"{where}: {came.reason}"
    told = f": {came.reason}" if came.reason else ""
    return f"{where} E {came.discrepancy:.1e} U {came.uncertainty:.1e}{told}"


def summary(entries: Sequence[Entry], parts: Collection[str]) -> str:
    """All tables."""
    kinds = [kind_of(entry, parts) for entry in entries]
    return "\n\n".join([
        shares(entries, kinds), outcomes(entries), worst(entries), differing(entries),
        reasons(entries, kinds), left_out(entries, kinds),
    ])  # fmt: skip
