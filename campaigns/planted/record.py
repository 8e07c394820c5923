"""What has been tried, in a file: a campaign that was interrupted goes on where it was."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from campaigns.planted.fates import Fate, Planted

Key = tuple[str, str, int, str, float]
"""A run, and the file, line, address and share of a fault in it."""


class Record:
    """Faults that have been tried, a line of JSON each.

    Args:
        path: of the file; None keeps nothing.
        run: what is run, and how: others' faults in the same file are left alone.
    """

    def __init__(self, path: Path | None, run: str) -> None:
        self._path, self._run = path, run
        self._known: dict[Key, Planted] = {}
        if path is not None and path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                told = json.loads(line)
                if told.pop("run") == run:
                    one = Planted(**{**told, "fate": Fate(told["fate"])})
                    self._known[self._key(one)] = one

    def known(self, file: str, line: int, address: str, share: float) -> Planted | None:
        """What came of a fault, where it has been tried."""
        return self._known.get((self._run, file, line, address, share))

    def add(self, one: Planted) -> None:
        """Write down what came of a fault."""
        self._known[self._key(one)] = one
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"run": self._run, **asdict(one)}) + "\n")

    def _key(self, one: Planted) -> Key:
        return self._run, one.file, one.line, one.address, one.share
