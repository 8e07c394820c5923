"""Outcomes of cases in past runs: one line of JSON per case and run, appended.

The file is `OUT/history/cases.jsonl`. Incomplete or invalid lines are ignored.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import msgspec

from physics_crosscheck.harness.records.base import Number, Record
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results

FOLDER = "history"
NAME = "cases.jsonl"


class Past(Record, frozen=True, kw_only=True):
    """One case of an earlier run, one line of the file.

    Attributes:
        time: Time of the run, UTC, ISO 8601.
        commit: Commit of the repository; empty outside a repository.
        version: Version of the engine; empty if it was not installed.
        system: Name of the system.
        model: Name of the model file.
        scenario: Name of the scenario.
        engine: Name of the engine.
        outcome: Outcome of the case.
        digits: Agreeing digits in every component; None if unknown.
        global_error: Error at the model's own time step, relative to the amplitude.
    """

    time: str
    commit: str = ""
    version: str = ""
    system: str
    model: str
    scenario: str
    engine: str
    outcome: Outcome
    digits: Number = None
    global_error: Number = None

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )


def past_of(results: Results, commit: str) -> tuple[Past, ...]:
    """Return the history lines of a run's cases."""
    return tuple(
        Past(
            time=results.created,
            commit=commit,
            version=results.versions.get(case.engine) or "",
            system=case.system,
            model=case.model,
            scenario=case.scenario,
            engine=case.engine,
            outcome=case.outcome,
            digits=case.digits,
            global_error=None if case.full_run is None else case.full_run.global_error,
        )
        for case in results.cases
    )


def append_history(out: Path, lines: Iterable[Past]) -> None:
    """Append lines in one write, so that two simultaneous runs do not mix theirs.

    If an earlier run left an incomplete line, a line end is written first.

    Raises:
        OSError: if the file can't be written.
    """
    data = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    path = out / FOLDER / NAME
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a+b", buffering=0) as file:
        size = file.seek(0, os.SEEK_END)
        if size:
            file.seek(size - 1)
            data = data if file.read(1) == b"\n" else b"\n" + data
        view = memoryview(data)
        while view:
            view = view[file.write(view) or 0 :]


def read_history(out: Path) -> tuple[Past, ...]:
    """Return past runs in the order of writing; an empty tuple without a history."""
    try:
        data = (out / FOLDER / NAME).read_bytes()
    except OSError:
        return ()
    past = []
    for line in data.splitlines():
        try:
            past.append(msgspec.json.decode(line, type=Past))
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            continue
    return tuple(past)
