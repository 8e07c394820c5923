"""`crosscheck sweep --versions`: run the same cases under several versions of an engine."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from physics_crosscheck.harness.extras.sweep.store import read_plan, read_rows
from physics_crosscheck.harness.extras.sweep.versions import Moved, moved
from physics_crosscheck.harness.extras.versions.asked import asked_versions
from physics_crosscheck.harness.extras.versions.environments import EnvironmentError_
from physics_crosscheck.harness.extras.versions.launch import launch
from physics_crosscheck.harness.extras.versions.run import interpreter_of
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.render.terminal.sweep import row_lines
from physics_crosscheck.harness.render.terminal.versions import counted_changes
from physics_crosscheck.harness.results.status import counted

_CHILD = """
from physics_crosscheck.harness.interfaces.cli.main import program
sys.argv[1:] = rest
sys.exit(program())
"""


def under_versions(options: argparse.Namespace, words: Sequence[str]) -> int:
    """Run a sweep in each version's environment, and print differences; return the exit code.

    Args:
        options: the parsed options.
        words: the normalized command line, from its program's name on.
    """
    only = options.only is not None
    engine, versions = asked_versions(options.versions, "--versions", least=1 if only else 2)
    if options.engine and set(options.engine) != {engine}:
        raise FolderError(f"--versions {engine}: --engine names another engine. Remove --engine")
    if options.scheduler:
        raise FolderError(
            "--versions: environments are on this machine; leave out --scheduler"
            f" and {arguments.SCHEDULER}"
        )
    codes, outs = [], []
    try:
        interpreters = [
            (version, interpreter_of(engine, version, options.environments, _print_line))
            for version in versions
        ]
        for version, python in interpreters:
            out = options.out / f"{engine}-{version.version}"
            _print_line(f"{engine} {version.version}:")
            given = [*words[1:], *([] if options.engine else ["--engine", engine])]
            given += [*_local(options), "--out", str(out), "--under", engine, version.version]
            code = launch(engine, version.version, python, _CHILD, given, range(256))
            if code not in (AGREE, DIFFER, FAIL):
                return code  # invalid or interrupted: already reported
            codes.append(code)
            outs.append(out)
    except EnvironmentError_ as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    worst = max(codes)
    if only:
        return worst
    others = [
        _print_changes(f"{engine} {a.version} -> {b.version}", version, other)
        for (a, version), (b, other) in pairwise(zip(versions, outs, strict=True))
    ]
    return max(worst, DIFFER if any(others) else AGREE)


def _local(options: argparse.Namespace) -> list[str]:
    """Return words that are not part of the plan and that every version also gets."""
    local_words = []
    if options.jobs:
        local_words += ["--jobs", str(options.jobs)]
    if options.only is not None:
        local_words += ["--only", str(options.only)]
    limits = arguments.limits_of(options)
    return [*local_words, "--limit", repr(limits.seconds), "--memory", repr(limits.memory)]


def _print_changes(name: str, before: Path, after: Path) -> bool:
    """Print the differences between two consecutive versions; return whether there are any."""
    plans = read_plan(before), read_plan(after)
    if not all(plans):
        return False
    changes = moved(read_rows(before), read_rows(after))
    for line in _lines(name, changes):
        print(line)
    return bool(changes.changed)


def _lines(name: str, changes: Moved) -> Iterator[str]:
    parts = counted_changes(changes.changed)
    yield f"{name}: {counted(changes.cases, 'case')}: {'; '.join(parts) or 'none changed'}"
    for pair in changes.largest:
        for row in (pair.before, pair.after):
            yield from row_lines(row)


def _print_line(line: str) -> None:
    print(line, flush=True)
