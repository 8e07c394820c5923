"""Models under several versions of an engine, each in its environment, and what changes.

versions --environments--> interpreters --a process each--> runs --upgrade--> what changes
"""

from __future__ import annotations

import datetime
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import physics_crosscheck
from harness.engines.registry import distribution, engines
from harness.records.read import decoded
from harness.records.versions import (
    EngineVersion,
    Repeated,
    VersionRun,
    Versions,
    VersionTask,
)
from harness.records.write import encoded, write_whole
from harness.schedule.limits import Limits
from harness.text.visible import visible
from harness.versions.asked import AskedModels, AskedVersion
from harness.versions.compare import upgrade
from harness.versions.environments import (
    EnvironmentError_,
    Requirement,
    Tell,
    environment,
    interpreter,
    site_folders,
)
from harness.versions.place import cache

_LAUNCH = """
import pathlib, site, sys
here, places, separator, task, found = sys.argv[1:]
def end(why):
    pathlib.Path(found).with_suffix(".why").write_text(why, encoding="utf-8")
    sys.exit(1)
own = f"{sys.version_info.major}.{sys.version_info.minor}"
if own != here:
    end(f"it is Python {own}, and this program's packages are for {here}")
for place in filter(None, places.split(separator)):
    if place not in sys.path:
        site.addsitedir(place)
try:
    import physics_crosscheck
    from harness.versions.child import main
except ImportError as error:
    end(f"{type(error).__name__}: {error}")
if why := main(pathlib.Path(task), pathlib.Path(found)):
    end(why)
"""
"""What an environment's interpreter runs: the packages of this one come after its own."""


@dataclass(frozen=True, kw_only=True)
class VersionOptions:
    """What `crosscheck versions` may be told beside models and versions.

    Attributes:
        out: folder for the report; each version's goes into a folder of it.
        environments: folder of all environments; None: the user's cache.
        resolution, jobs, limits, floating: as in `harness.run.Options`.
        diagnose: whether models that differ are diagnosed, under each version.
    """

    out: Path
    environments: Path | None = None
    resolution: float = 1e-9
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    floating: bool = False
    diagnose: bool = False


def run_versions(
    engine: str,
    versions: Sequence[AskedVersion],
    models: AskedModels,
    options: VersionOptions,
    tell: Tell,
) -> Versions:
    """Run the models under each version, and hold each against the one before it.

    All environments are there before anything is run.

    Raises:
        EnvironmentError_: for a version that can't be had, or whose run ended.
        OSError: as the file system has it.
    """
    began = time.perf_counter()
    created = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    pythons = [_interpreter(engine, one, options, tell) for one in versions]
    runs: list[VersionRun] = []
    found = [
        EngineVersion(
            version=one.version,
            python=python,
            report=str(options.out / f"{engine}-{one.version}"),
        )
        for one, python in zip(versions, pythons, strict=True)
    ]
    for one in found:
        tell(f"{engine} {one.version} runs")
        task = _task(engine, one, models, options, _repeated(runs[-1:]))
        runs.append(_run(one, task))
    return Versions(
        created=created,
        engine=engine,
        resolution=options.resolution,
        seconds=time.perf_counter() - began,
        versions=tuple(found),
        upgrades=tuple(upgrade(a, b, engine, options.resolution) for a, b in pairwise(runs)),
        left_out=models.left_out,
    )


def _interpreter(engine: str, asked: AskedVersion, options: VersionOptions, tell: Tell) -> str:
    """The interpreter that has a version; an environment is made where there is none."""
    if asked.place is not None:
        python = interpreter(asked.place).absolute()
        if not python.exists():
            raise EnvironmentError_(
                f"{engine} {asked.version}: {visible(str(asked.place))} is no environment: it has"
                f" no {python.relative_to(asked.place.absolute())}; `python -m venv` makes one"
            )
        return str(python)
    known = engines()[engine]
    if known.version() == asked.version:
        tell(f"{engine} {asked.version}: the one that is installed here")
        return sys.executable
    wanted = Requirement(engine=engine, distribution=distribution(known), version=asked.version)
    return str(interpreter(environment(wanted, options.environments or cache(), tell)))


def _repeated(runs: Iterable[VersionRun]) -> tuple[Repeated, ...]:
    """What the next version is to repeat of the last one."""
    return tuple(
        Repeated(folder=one.folder, case=one.case, snapshot=one.measurement.snapshot)
        for run in runs
        for one in run.measured
        if one.measurement is not None
    )


def _task(
    engine: str,
    one: EngineVersion,
    models: AskedModels,
    options: VersionOptions,
    repeated: tuple[Repeated, ...],
) -> VersionTask:
    return VersionTask(
        engine=engine,
        version=one.version,
        package=str(physics_crosscheck.BESIDE),
        folders=tuple(map(str, models.folders)),
        robots=tuple(map(str, models.robots)),
        resolution=options.resolution,
        jobs=options.jobs,
        seconds=options.limits.seconds,
        memory=options.limits.memory,
        floating=options.floating,
        diagnose=options.diagnose,
        repeated=repeated,
        out=one.report,
    )


def _run(one: EngineVersion, task: VersionTask) -> VersionRun:
    """Do a task in an environment, in a process of its own.

    Raises:
        EnvironmentError_: where it can't be done, with the reason.
    """
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as scratch:
        asked, found = Path(scratch) / "task.json", Path(scratch) / "found.json"
        write_whole(asked, encoded(task))
        here = f"{sys.version_info.major}.{sys.version_info.minor}"
        places = os.pathsep.join(site_folders())
        given = here, places, os.pathsep, str(asked), str(found)
        code = subprocess.run(
            [one.python, "-P", "-c", _LAUNCH, *given],
            stdin=subprocess.DEVNULL,
            env=_surroundings(),
            check=False,
        ).returncode
        if code == 0:
            return decoded(found.read_bytes(), VersionRun)
        told = found.with_suffix(".why")
        why = told.read_text(encoding="utf-8") if told.is_file() else f"it ended with code {code}"
    raise EnvironmentError_(f"{task.engine} {one.version} can't be run by {one.python}: {why}")


def _surroundings() -> Mapping[str, str]:
    """The environment variables of that process: a checkout comes first on its path.

    Where this package is installed it is found with its dependencies, after the environment's own
    packages: before them, the engine beside it would be the one that is run.
    """
    here = str(physics_crosscheck.BESIDE)
    if here in {str(Path(place).resolve()) for place in site_folders()}:
        return os.environ
    path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path}
