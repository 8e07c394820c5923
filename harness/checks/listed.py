"""The cases that a folder has, by their names: nothing is derived, and no engine is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.checks.declared import Declared, declared
from physics_crosscheck.harness.jobs.graph import Job, Task, work
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.records.case import CaseId


@dataclass(frozen=True)
class Listed:
    """Cases with their folders, and what can't be listed, a sentence each."""

    cases: tuple[tuple[str, CaseId], ...]
    faults: tuple[str, ...]


def listed(folders: Sequence[Path], only: Sequence[str]) -> Listed:
    """The cases of system folders, as they would be run.

    Args:
        folders: each with its `system.py`, which is run in a worker.
        only: engines; none: all that the sidecars name.
    """
    found = dict[Path, Declared | Failure]()

    def job(folder: Path) -> Job[Declared]:
        def done(value: Declared | Failure) -> tuple[()]:
            found[folder] = value
            return ()

        return Job(task=Task(declared, folder), done=done, failed=done)

    with Workers(1) as workers:
        work(map(job, folders), workers)
    cases, faults = list[tuple[str, CaseId]](), list[str]()
    for folder in folders:
        system = found[folder]
        if isinstance(system, Failure):
            faults.append(system.reason)
            continue
        for one in model_files(folder):
            if isinstance(one, UnreadModel):
                faults.append(one.reason)
                continue
            cases += [
                (str(folder), case)
                for engine in chosen_engines(one, only)
                for scenario in system.scenarios
                for case in [
                    CaseId(
                        system=system.name, model=one.model.name, scenario=scenario, engine=engine
                    )
                ]
            ]
    return Listed(tuple(cases), tuple(faults))
