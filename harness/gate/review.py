"""Interactive review of a gate's result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.gate.result import GateResult
from physics_crosscheck.harness.gate.text import change_lines, diff_lines
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.results.status import counted

ASKED = (Status.CHANGED, Status.GONE, Status.NEW, Status.IMPROVED)
"""Statuses that a person decides one by one."""

KEYS = "[a]ccept  [A]ccept all of this file  [r]eject  [s]kip  [q]uit"

Ask = Callable[[str], str]
"""Show a question, and return the typed line; raises EOFError if there is no input."""

Tell = Callable[[str], None]


@dataclass
class Decisions:
    """The decisions of a review.

    Attributes:
        reasons: reasons of the accepted cases.
        kept: accepted cases that keep their old reason.
        rejected: cases to restore.
        left: undecided cases.
    """

    reasons: dict[CaseId, str] = field(default_factory=dict)
    kept: set[CaseId] = field(default_factory=set)
    rejected: list[Change] = field(default_factory=list)
    left: list[Change] = field(default_factory=list)


class Review:
    """An interactive pass through a gate's result.

    Args:
        result: result of the gate.
        ask: function that asks the user.
        show: function that prints a line.
    """

    def __init__(self, result: GateResult, ask: Ask, show: Tell) -> None:
        self._found, self._ask, self._tell = result, ask, show
        self._decided = Decisions()
        self._reason = ""
        self._told: set[tuple[str, str]] = set()

    def walk(self) -> Decisions:
        """Ask about every change; changes after an early exit remain undecided."""
        waiting = list(by_file(self._found.of(*ASKED)))
        count = len(waiting)
        try:
            while waiting:
                change, *rest = waiting
                self._show(change, f"{count - len(rest)} of {count}")
                together = self._decide(change, [one for one in rest if _of_one_file(one, change)])
                waiting = [one for one in rest if one not in together]
            self._unmoved()
        except EOFError:
            self._decided.left += waiting
        return self._decided

    def _show(self, change: Change, where: str) -> None:
        self._tell("")
        head, *rest = change_lines(change)
        self._tell(f"{where}  {head}")
        for line in rest:
            self._tell(line)
        for diff in self._found.file_diffs:
            if diff.concerns(change.id) and (diff.system, diff.file) not in self._told:
                self._told.add((diff.system, diff.file))
                for line in diff_lines(diff):
                    self._tell(line)

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
                self._decided.left.append(change)
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
        unmoved = self._found.of(Status.WITHIN)
        if not unmoved:
            return
        self._tell("")
        self._tell(
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
