"""Run models under several versions of an engine, each in its environment, and compare.

versions --environments--> interpreters --a process each--> runs --upgrade--> what changes
"""

from __future__ import annotations

import datetime
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from msgspec.structs import replace

from physics_crosscheck.harness.engines.registry import distribution, engines
from physics_crosscheck.harness.extras.versions.asked import AskedVersion
from physics_crosscheck.harness.extras.versions.compare import upgrade
from physics_crosscheck.harness.extras.versions.environments import (
    EnvironmentError_,
    Requirement,
    ShowLine,
    environment,
    interpreter,
)
from physics_crosscheck.harness.extras.versions.launch import launch
from physics_crosscheck.harness.modelfiles.code_reads import user_cache
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.versions import (
    EngineVersion,
    Repeated,
    VersionRun,
    Versions,
    VersionTask,
)
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.visible import visible

_CHILD = """
from physics_crosscheck.harness.extras.versions.child import main
main(*map(pathlib.Path, rest))
"""


def run_versions(
    task: VersionTask,
    versions: Sequence[AskedVersion],
    environments: Path | None,
    show_line: ShowLine,
) -> Versions:
    """Run the models under each version, and compare each version with the one before it.

    All environments are created before the first run.

    Args:
        task: the work for each version; `out` gets a folder for each.
        versions: the versions.
        environments: folder of all environments; None: the user's cache.
        show_line: shows progress to the user.

    Raises:
        EnvironmentError_: if a version is not available, or its run ended early.
        OSError: if a file can't be read or written.
    """
    began = time.perf_counter()
    created = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    engine = task.engine
    pythons = [interpreter_of(engine, version, environments, show_line) for version in versions]
    runs: list[VersionRun] = []
    interpreters = [
        EngineVersion(
            version=version.version,
            python=python,
            report=str(Path(task.out) / f"{engine}-{version.version}"),
        )
        for version, python in zip(versions, pythons, strict=True)
    ]
    for version in interpreters:
        show_line(f"{engine} {version.version} runs")
        repeated = _repeated(runs[-1:])
        this = replace(task, version=version.version, repeated=repeated, out=version.report)
        runs.append(_run(version, this))
    return Versions(
        created=created,
        engine=engine,
        resolution=task.resolution,
        seconds=time.perf_counter() - began,
        versions=tuple(interpreters),
        upgrades=tuple(upgrade(a, b, engine, task.resolution) for a, b in pairwise(runs)),
    )


def interpreter_of(
    engine: str, requested: AskedVersion, environments: Path | None, show_line: ShowLine
) -> str:
    """Return the interpreter with a version; create an environment if none exists.

    Args:
        engine: its name.
        requested: the version.
        environments: folder of all environments; None: the user's cache.
        show_line: shows each command before it runs.

    Raises:
        EnvironmentError_: if a version is not available.
        OSError: if a file can't be read or written.
    """
    if requested.place is not None:
        python = interpreter(requested.place).absolute()
        if not python.exists():
            raise EnvironmentError_(
                f"{engine} {requested.version}: {visible(str(requested.place))} is not an"
                f" environment: it has no {python.relative_to(requested.place.absolute())};"
                " `python -m venv` makes one"
            )
        return str(python)
    engine_class = engines()[engine]
    if engine_class.version() == requested.version:
        show_line(f"{engine} {requested.version}: the one that is installed here")
        return sys.executable
    wanted = Requirement(
        engine=engine, distribution=distribution(engine_class), version=requested.version
    )
    return str(interpreter(environment(wanted, environments or default_cache(), show_line)))


def _repeated(runs: Iterable[VersionRun]) -> tuple[Repeated, ...]:
    """Return the segments of the last version that the next one must repeat."""
    return tuple(
        Repeated(folder=one.folder, case=one.case, snapshot=one.measurement.snapshot)
        for run in runs
        for one in run.measured
        if one.measurement is not None
    )


def _run(version: EngineVersion, task: VersionTask) -> VersionRun:
    """Run a task in an environment, in its own process.

    Raises:
        EnvironmentError_: if it can't run, with the reason.
    """
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as scratch:
        task_file, result_file = Path(scratch) / "task.json", Path(scratch) / "found.json"
        write_whole(task_file, encoded(task))
        launch(
            task.engine, version.version, version.python, _CHILD, (str(task_file), str(result_file))
        )
        return decoded(result_file.read_bytes(), VersionRun)


def default_cache() -> Path:
    """Return the default folder of environments, in the user's cache."""
    return user_cache() / "physics-crosscheck" / "environments"
