"""What a person decides of a gate's findings, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.gate.result import GateResult
from physics_crosscheck.harness.gate.text import change_lines, diff_lines
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.results.status import counted

ASKED = (Status.CHANGED, Status.GONE, Status.NEW, Status.IMPROVED)
"""Of what a person is asked each by each."""

KEYS = "[a]ccept  [A]ccept all of this file  [r]eject  [s]kip  [q]uit"

Ask = Callable[[str], str]
"""Shows a question, and returns the line that was typed; EOFError: there is nobody any more."""

Tell = Callable[[str], None]


@dataclass
class Decisions:
    """What was decided.

    Attributes:
        reasons: of what is accepted.
        kept: of these, those that keep the reason that they have.
        rejected: what is to be as it was.
        left: what nothing was decided of.
    """

    reasons: dict[CaseId, str] = field(default_factory=dict)
    kept: set[CaseId] = field(default_factory=set)
    rejected: list[Change] = field(default_factory=list)
    left: list[Change] = field(default_factory=list)


class Review:
    """A walk through a gate's findings.

    Args:
        found: by the gate.
        ask: asks the person.
        tell: prints a line.
    """

    def __init__(self, found: GateResult, ask: Ask, tell: Tell) -> None:
        self._found, self._ask, self._tell = found, ask, tell
        self._decided = Decisions()
        self._reason = ""
        self._told: set[tuple[str, str]] = set()

    def walk(self) -> Decisions:
        """Ask of every change; what is left where the person quits is decided of not at all."""
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
            if diff.concerns(change) and (diff.system, diff.name) not in self._told:
                self._told.add((diff.system, diff.name))
                for line in diff_lines(diff):
                    self._tell(line)

    def _decide(self, change: Change, others: Sequence[Change]) -> Sequence[Change]:
        """Ask of one; returns those of the others that were decided with it."""
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
        """A reason; an empty line is the last one again."""
        again = f" [{self._reason}]" if self._reason else ""
        while True:
            said = " ".join(self._ask(f"Why is this right?{again} ").split()) or self._reason
            if said:
                self._reason = said
                return said

    def _unmoved(self) -> None:
        """Ask of those whose files changed and whose motions did not, all at once."""
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
    """Those of one file one after the other, files in the order of their worst."""
    files = dict.fromkeys((change.id.system, change.id.model) for change in changes)
    for file in files:
        yield from (one for one in changes if (one.id.system, one.id.model) == file)


def _of_one_file(one: Change, other: Change) -> bool:
    return (one.id.system, one.id.model) == (other.id.system, other.id.model)
