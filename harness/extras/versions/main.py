"""`crosscheck versions`: run the same models under several versions of an engine."""

from __future__ import annotations

import argparse
import sys

from msgspec.structs import replace

from physics_crosscheck.harness.extras.versions.asked import (
    AskedModels,
    asked_models,
    asked_versions,
)
from physics_crosscheck.harness.extras.versions.environments import EnvironmentError_
from physics_crosscheck.harness.extras.versions.run import run_versions
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.interfaces.cli.report import check_page
from physics_crosscheck.harness.modelfiles.folders import FolderError, system_folders
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files
from physics_crosscheck.harness.records.versions import Versions, VersionTask
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html.versions import write_versions
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.versions import print_versions


def main(options: argparse.Namespace) -> int:
    """Run the models under each version, print the changes, write the report."""
    if len(options.engine) > 1:
        raise FolderError("--engine is given twice: one engine at a time")
    engine, versions = asked_versions(options.engine[0])
    check_page(options.out / "index.html")
    models = _models(options.folders, engine)
    for line in models.left_out:
        print(f"crosscheck: {line}", file=sys.stderr, flush=True)
    limits = arguments.limits_of(options)
    task = VersionTask(
        engine=engine,
        folders=tuple(map(str, models.folders)),
        robots=tuple(map(str, models.robots)),
        resolution=options.resolution,
        jobs=options.jobs,
        seconds=limits.seconds,
        memory=limits.memory,
        floating=options.floating,
        diagnose=options.diagnose,
        out=str(options.out),
    )
    try:
        result = run_versions(task, versions, options.environments, _print_line)
    except EnvironmentError_ as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    result = replace(result, left_out=models.left_out)
    write_versions(options.out / "index.html", result)
    if options.json:
        write_whole(options.json, encoded(result, indent=1))
    print_versions(terminal(), result)
    print("  ".join(map(str, filter(None, (options.out / "index.html", options.json)))))
    return code(result)


def code(versions: Versions) -> int:
    """Return the exit code; as for the gate, a model that can't be compared does not pass."""
    if versions.incomplete:
        return FAIL
    return DIFFER if versions.changed else AGREE


def _models(names: list[str], engine: str) -> AskedModels:
    """Return the named models.

    Raises:
        FolderError: if a name is unknown, or none of its models runs in the engine.
    """
    robots = robot_files(names)
    if robots.faults:
        raise FolderError("; ".join(robots.faults.values()))
    folders = system_folders(robots.others) if robots.others or not names else []
    return asked_models(engine, folders, robots.files)


def _print_line(line: str) -> None:
    print(line, flush=True)
