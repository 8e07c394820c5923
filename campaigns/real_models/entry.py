"""What became of one file, as a line of JSON: a campaign that is interrupted loses none."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import msgspec

from physics_crosscheck.harness.records.base import Count, Number, Record
from physics_crosscheck.harness.records.outcome import Outcome

STILL = "it has no joint that moves"
"""What the harness says of a file in which nothing moves."""

REFUSED = "can't load it"
"""What it says of one that the engine refuses which compiles its format."""


class Came(Record, frozen=True, kw_only=True):
    """A file in one engine.

    Attributes:
        engine: its name; `-` where none was reached.
        outcome: see `Outcome`.
        discrepancy, uncertainty: the largest of all segments; None without a verdict.
        reason: one sentence for whatever is not AGREES.
        cause: of what differs; empty where there is none to tell.
    """

    engine: str
    outcome: Outcome
    discrepancy: Number = None
    uncertainty: Number = None
    reason: str = ""
    cause: str = ""


class Entry(Record, frozen=True, kw_only=True):
    """A file.

    Attributes:
        file: its path.
        digest: of its bytes: another content is done again.
        tree: whether it has one.
        freedoms: of the tree; 0 where there is none.
        obstacles: what is in the way of a tree, with file and line.
        left_out: kinds of what the equations leave out.
        impossible: kinds of inertias that no body can have.
        cases: what came of it in each engine.
        seconds: by the clock.
    """

    file: str
    digest: str
    tree: bool
    freedoms: Count
    obstacles: tuple[str, ...]
    left_out: tuple[str, ...]
    impossible: tuple[str, ...]
    cases: tuple[Came, ...] = ()
    seconds: float = 0.0

    @property
    def format(self) -> Literal["URDF", "MJCF"]:
        """By its ending."""
        return "URDF" if self.file.endswith(".urdf") else "MJCF"


def kept(path: Path) -> Mapping[str, Entry]:
    """The lines of a file by the files they are of, the last of each; none where it is not there.

    A line that was not written to its end, as the last one may be, is left out.
    """
    found: dict[str, Entry] = {}
    with contextlib.suppress(FileNotFoundError), path.open("rb") as lines:
        for line in lines:
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                entry = msgspec.json.decode(line, type=Entry)
                found[entry.file] = entry
    return found


def keep(path: Path, entry: Entry) -> None:
    """Add a line, on its own even where the last one was cut off."""
    data = msgspec.json.encode(entry) + b"\n"
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, 2)
            data = data if file.read(1) == b"\n" else b"\n" + data
        file.write(data)
