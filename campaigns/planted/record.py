"""Judged faults in a file, from which an interrupted campaign resumes."""

from __future__ import annotations

import json
from pathlib import Path

from campaigns.planted.fates import FaultFate, RobotFault

Key = tuple[str, str, int, str, float]
"""Run, and the file, line, address and share of a fault."""


EXPLANATION_KEY = "said"
"""Key of the explanation in the file."""


class FaultRecord:
    """A file of judged faults, a line of JSON each.

    Args:
        path: of the file; None stores nothing.
        run: title of the run; faults of other runs in the same file are ignored.
    """

    def __init__(self, path: Path | None, run: str) -> None:
        self._path, self._run = path, run
        self._faults: dict[Key, RobotFault] = {}
        if path is not None and path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                row = json.loads(line)
                if row.pop("run") == run:
                    row["explanation"] = row.pop(EXPLANATION_KEY)
                    fault = RobotFault(**{**row, "fate": FaultFate(row["fate"])})
                    self._faults[self._key(fault)] = fault

    def lookup(self, file: str, line: int, address: str, share: float) -> RobotFault | None:
        """Return a fault if it has been judged."""
        return self._faults.get((self._run, file, line, address, share))

    def add(self, fault: RobotFault) -> None:
        """Write a judged fault to the file."""
        self._faults[self._key(fault)] = fault
        if self._path is not None:
            values = {
                EXPLANATION_KEY if k == "explanation" else k: v for k, v in vars(fault).items()
            }
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"run": self._run, **values}) + "\n")

    def _key(self, fault: RobotFault) -> Key:
        return self._run, fault.file, fault.line, fault.address, fault.share
