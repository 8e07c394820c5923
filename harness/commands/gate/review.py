"""Interactive review of a gate's result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import change_lines, diff_lines
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.results.status import counted

_UNDECIDED = (Status.CHANGED, Status.GONE, Status.NEW, Status.IMPROVED)
"""Statuses that a person decides one by one."""

KEYS = "[a]ccept  [A]ccept all of this file  [r]eject  [s]kip  [q]uit"

Ask = Callable[[str], str]
"""Shows a question, and returns the typed line; raises EOFError if there is no input."""

ShowLine = Callable[[str], None]
"""Prints a line."""


@dataclass
class Decisions:
    """The decisions of a review.

    Attributes:
        reasons: reasons of the accepted cases.
        kept: accepted cases that keep their old reason.
        rejected: cases to restore.
        undecided: skipped cases, and all after an early exit.
    """

    reasons: dict[CaseId, str] = field(default_factory=dict)
    kept: set[CaseId] = field(default_factory=set)
    rejected: list[Change] = field(default_factory=list)
    undecided: list[Change] = field(default_factory=list)


class Review:
    """An interactive pass through a gate's result.

    Args:
        result: result of the gate.
        ask: function that asks the user.
        show: function that prints a line.
    """

    def __init__(self, result: GateResult, ask: Ask, show: ShowLine) -> None:
        self._result, self._ask, self._print = result, ask, show
        self._decided = Decisions()
        self._reason = ""
        self._shown: set[tuple[str, str]] = set()

    def walk(self) -> Decisions:
        """Ask about every change; changes after an early exit remain undecided."""
        waiting = list(by_file(self._result.with_status(*_UNDECIDED)))
        count = len(waiting)
        try:
            while waiting:
                change, *rest = waiting
                self._show(change, f"{count - len(rest)} of {count}")
                together = self._decide(change, [one for one in rest if _of_one_file(one, change)])
                waiting = [one for one in rest if one not in together]
            self._unmoved()
        except EOFError:
            self._decided.undecided += waiting
        return self._decided

    def _show(self, change: Change, where: str) -> None:
        self._print("")
        head, *rest = change_lines(change)
        self._print(f"{where}  {head}")
        for line in rest:
            self._print(line)
        for diff in self._result.file_diffs:
            if diff.concerns(change.id) and (diff.system, diff.file) not in self._shown:
                self._shown.add((diff.system, diff.file))
                for line in diff_lines(diff):
                    self._print(line)

    def _decide(self, change: Change, others: Sequence[Change]) -> Sequence[Change]:
        """Ask about one change; return the other changes that the answer covers."""
        while True:
            key = self._ask(f"{KEYS} ? ").strip()
            if key in ("a", "A"):
                together = others if key == "A" else ()
                reason = self._why()
                self._decided.reasons |= {one.id: reason for one in (change, *together)}
                return together
            if key == "r":
                self._decided.rejected.append(change)
                return ()
            if key == "s":
                self._decided.undecided.append(change)
                return ()
            if key == "q":
                raise EOFError

    def _why(self) -> str:
        """Ask for a reason; an empty line repeats the last one."""
        again = f" [{self._reason}]" if self._reason else ""
        while True:
            reason = " ".join(self._ask(f"Why is this right?{again} ").split()) or self._reason
            if reason:
                self._reason = reason
                return reason

    def _unmoved(self) -> None:
        """Ask once about all cases whose files changed but whose motions did not."""
        unmoved = self._result.with_status(Status.WITHIN)
        if not unmoved:
            return
        self._print("")
        self._print(
            f"{counted(len(unmoved), 'case')} moved as accepted after a change of files or versions"
        )
        key = ""
        while key not in ("a", "s"):
            key = self._ask("[a]ccept and keep the reasons  [s]kip ? ").strip()
        if key == "a":
            self._decided.reasons |= {one.id: self._reason or "no change" for one in unmoved}
            self._decided.kept |= {one.id for one in unmoved}


def by_file(changes: Sequence[Change]) -> Iterator[Change]:
    """Yield the changes grouped by file, files in the order of their worst change."""
    files = dict.fromkeys((change.id.system, change.id.model) for change in changes)
    for file in files:
        yield from (one for one in changes if (one.id.system, one.id.model) == file)


def _of_one_file(first: Change, second: Change) -> bool:
    return (first.id.system, first.id.model) == (second.id.system, second.id.model)
