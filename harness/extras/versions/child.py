"""Run a task in the environment of one engine version, in this process."""

from __future__ import annotations

import sys
from pathlib import Path

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.paths import IMPORT_ROOT
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.versions import Measured, VersionRun, VersionTask
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.run import Options, Run, Selection, run


def main(task: Path, result_file: Path) -> None:
    """Run the task of a file, and write the result."""
    task_record = decoded(task.read_bytes(), VersionTask)
    ran = _run(task_record)
    out = Path(task_record.out)
    write_whole(out / "results.json", encoded(ran.results))
    write_report(out / "index.html", ran.results)
    write_whole(result_file, encoded(_version_run(task_record.version, ran)))


def unusable(engine: str, wanted: str, package: str) -> str:
    """Return why this is not the requested version or code; empty if it is.

    Args:
        engine: its name.
        wanted: the version.
        package: folder of this package.
    """
    here = str(IMPORT_ROOT)
    if here != package:
        return (
            f"it has a physics-crosscheck of its own in {here}, which would be run instead of this"
            f" one; `{sys.executable} -m pip uninstall physics-crosscheck` takes it out"
        )
    engine_class = engines().get(engine)
    version = engine_class.version() if engine_class else None
    if version is None:
        return f"it has no {engine}; {sys.executable} -m pip can install it"
    if version != wanted:
        return f"it has {engine} {version}"
    return ""


def _run(task: VersionTask) -> Run:
    snapshots = {(one.folder, one.case): one.snapshot for one in task.repeated}
    options = Options(
        engines=(task.engine,),
        resolution=task.resolution,
        jobs=task.jobs,
        limits=Limits(seconds=task.seconds, memory=task.memory),
        floating=task.floating,
        selection=Selection(
            models=None,
            snapshot=lambda folder, case: snapshots.get((folder, case)),
            diagnose=task.diagnose,
            described=True,
        ),
    )
    with Progress() as progress:
        folders, robots = map(Path, task.folders), map(Path, task.robots)
        return run(list(folders), options, progress, robots=list(robots))


def _version_run(version: str, ran: Run) -> VersionRun:
    """Return the results that the other version is compared with."""
    return VersionRun(
        version=version,
        cases=ran.results.cases,
        models=ran.results.models,
        measured=tuple(
            Measured(folder=folder, case=case, measurement=None, failure=value.reason)
            if isinstance(value, Failure)
            else Measured(folder=folder, case=case, measurement=value)
            for (folder, case), value in ran.measured.items()
        ),
    )
