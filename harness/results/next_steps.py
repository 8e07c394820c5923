"""The changes of files that a run proposes, and the command that checks them."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.places import shown_line

DEFAULT_OUT = Path("reports")


@dataclass(frozen=True, kw_only=True)
class Change:
    """A number of a file, or copies of one, that is to be another.

    Attributes:
        subject: its address, or theirs.
        locations: its place, or theirs, with paths from where one stands.
        old: the number that is there.
        new: the text to write at each location.
    """

    subject: tuple[str, ...]
    locations: tuple[SourceLine, ...]
    old: float
    new: str

    def __str__(self) -> str:
        places = ", ".join(dict.fromkeys(map(str, self.locations)))
        return f"{places} from {self.old:.10g} to {self.new}"


def run_again(results: Results, out: Path) -> str:
    """The command that tells whether a change has helped; empty where all passes."""
    if not results.failed:
        return ""
    there = "" if out == DEFAULT_OUT else f" --out {shlex.quote(str(out))}"
    return f"crosscheck run --last-failed{there}"


def changes_of(model: Model) -> list[Change]:
    """The numbers in files that explain a model's motions; none where nothing does."""
    if model.diagnosis is None or not model.diagnosis.explained:
        return []
    return [
        Change(
            subject=cause.subject,
            locations=tuple(shown_line(model.folder, one) for one in cause.locations),
            old=cause.nominal,
            new=cause.replacement,
        )
        for cause in model.diagnosis.explanations[0].causes
        if cause.replacement and cause.locations and cause.nominal is not None
    ]


def stated_changes(model: Model, findings: Iterable[AuditFinding] | None = None) -> list[Change]:
    """The numbers in files that are others than their bindings say, by reading alone.

    Args:
        model: its record.
        findings: of the model; all where none are given.
    """
    return [
        Change(
            subject=one.subject,
            locations=(shown_line(model.folder, one.location),),
            old=one.found,
            new=one.replacement,
        )
        for one in (model.findings if findings is None else findings)
        if one.replacement and one.location is not None and one.found is not None
    ]
