"""The result of a file as a line of JSON, so that an interrupted campaign can resume."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import msgspec

from physics_crosscheck.harness.records.base import Count, Number, Record
from physics_crosscheck.harness.records.outcome import Outcome

STILL = "it has no joint that moves"
"""Text of the harness for a file in which nothing moves."""

REFUSED = "can't load it"
"""Text of the harness for a file that its format's compiler refuses."""


class EngineResult(Record, frozen=True, kw_only=True):
    """The result of a file in an engine.

    Attributes:
        engine: its name; `-` if the file reached no engine.
        outcome: see `Outcome`.
        discrepancy, uncertainty: the largest of all segments; None without a verdict.
        reason: a sentence for every outcome but AGREES.
        cause: of a difference; otherwise empty.
    """

    engine: str
    outcome: Outcome
    discrepancy: Number = None
    uncertainty: Number = None
    reason: str = ""
    cause: str = ""


class FileEntry(Record, frozen=True, kw_only=True):
    """The result of a file.

    Attributes:
        file: its path.
        digest: of its bytes: a changed file runs again.
        tree: whether it has a tree of bodies.
        dof: degrees of freedom of the tree; 0 without one.
        obstacles: problems that prevent a tree, with file and line.
        left_out: kinds of elements that the equations ignore.
        impossible: kinds of inertias that no body can have.
        cases: the result in each engine.
        seconds: elapsed time.
    """

    file: str
    digest: str
    tree: bool
    dof: Count = msgspec.field(name="freedoms")
    obstacles: tuple[str, ...]
    left_out: tuple[str, ...]
    impossible: tuple[str, ...]
    cases: tuple[EngineResult, ...] = ()
    seconds: float = 0.0

    @property
    def format(self) -> Literal["URDF", "MJCF"]:
        """The format, by the suffix of the file."""
        return "URDF" if self.file.endswith(".urdf") else "MJCF"


def read_entries(path: Path) -> Mapping[str, FileEntry]:
    """Return the last entry of each model file; nothing if `path` does not exist.

    Incomplete lines are ignored: an interrupted run may leave one at the end.
    """
    entries: dict[str, FileEntry] = {}
    with contextlib.suppress(FileNotFoundError), path.open("rb") as lines:
        for line in lines:
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                entry = msgspec.json.decode(line, type=FileEntry)
                entries[entry.file] = entry
    return entries


def append_entry(path: Path, entry: FileEntry) -> None:
    """Append a line; start a new one if the last is incomplete."""
    data = msgspec.json.encode(entry) + b"\n"
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, 2)
            data = data if file.read(1) == b"\n" else b"\n" + data
        file.write(data)
