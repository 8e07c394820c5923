"""Lists of the cases of targets by name, without deriving or running anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from physics_crosscheck.harness.checks.declared import Declared, declared
from physics_crosscheck.harness.jobs.graph import Job, Task, work
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.records.case import CaseId


@dataclass(frozen=True)
class Listed:
    """The cases with their folders, and one sentence for each target that cannot be listed."""

    cases: tuple[tuple[str, CaseId], ...]
    faults: tuple[str, ...]


def listed(
    targets: Sequence[Path], only: Sequence[str], *, floating: bool = False, model: str = ""
) -> Listed:
    """List the cases of system folders and robot files as a run would create them.

    Args:
        targets: folders, each with a `system.py` that runs in a worker, and robot files.
        only: engines; empty: all that the sidecars name, or that read the file.
        floating, model: options for reading files, as in `read_robot`.
    """
    declarations = dict[Path, Declared | Failure]()

    def job(target: Path) -> Job[Declared]:
        def done(value: Declared | Failure) -> tuple[()]:
            declarations[target] = value
            return ()

        glance = partial(declared, floating=floating, model=model)
        return Job(task=Task(glance, target), done=done, failed=done)

    with Workers(1) as workers:
        work(map(job, targets), workers)
    cases, faults = list[tuple[str, CaseId]](), list[str]()
    for target in targets:
        system = declarations[target]
        if isinstance(system, Failure):
            faults.append(system.about(target) if target.is_file() else system.reason)
            continue
        for file in [target] if target.is_file() else model_files(target):
            if isinstance(file, UnreadModel):
                faults.append(file.reason)
                continue
            name = model_path(file).name
            cases += [
                (
                    str(target),
                    CaseId(system=system.name, model=name, scenario=scenario, engine=engine),
                )
                for engine in chosen_engines(file, only)
                for scenario in system.scenarios
            ]
    return Listed(tuple(cases), tuple(faults))
