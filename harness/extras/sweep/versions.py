"""`crosscheck sweep --versions`: the same cases under several versions, compared row by row."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from physics_crosscheck.harness.baseline.diff import diff_cases
from physics_crosscheck.harness.extras.sweep.store import read_plan, read_rows
from physics_crosscheck.harness.extras.sweep.summary import LargestItems
from physics_crosscheck.harness.extras.versions.asked import asked_versions
from physics_crosscheck.harness.extras.versions.environments import EnvironmentError_
from physics_crosscheck.harness.extras.versions.launch import launch
from physics_crosscheck.harness.extras.versions.run import interpreter_of
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.diff import Changed, Diff
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.harness.render.terminal.sweep import row_lines
from physics_crosscheck.harness.render.terminal.versions import counted_changes
from physics_crosscheck.harness.results.status import counted

MAX_LISTED = 5
"""Maximum number of listed cases."""


@dataclass(frozen=True, kw_only=True)
class CasePair:
    """A case under two versions, and its difference."""

    before: SweepRow
    after: SweepRow
    diff: Diff

    @property
    def index(self) -> int:
        """Number of the case in the plan."""
        return self.after.index

    @property
    def size(self) -> float | None:
        """Rank of the difference, larger for a more important one; None without a difference."""
        changed = self.diff.changed
        if not changed:
            return None
        then, now = self.diff.global_errors
        error = abs(now - then) / then if then and now is not None else 0.0
        return 2 * ("verdict" in changed) + ("discrepancy" in changed) + error / (1 + error)


@dataclass
class SweepChanges:
    """Differences between two versions.

    Attributes:
        cases: number of common cases.
        changed: number of cases by what changed.
        largest: listed cases, most important first.
    """

    cases: int = 0
    changed: Counter[Changed] = field(default_factory=Counter)
    largest: list[CasePair] = field(default_factory=list)


def compare_rows(before: Iterable[SweepRow], after: Iterable[SweepRow]) -> SweepChanges:
    """Compare the rows of two versions, by their numbers.

    Rows of one number have the same draw. The rows of the earlier version stay in memory, about 2
    kB each.
    """
    earlier_rows = {row.index: row for row in before}
    changes = SweepChanges()
    largest = LargestItems[CasePair](lambda pair: pair.size, MAX_LISTED)
    for row in after:
        if row.index not in earlier_rows:
            continue
        earlier = earlier_rows.pop(row.index)
        diff = diff_cases(row.id, earlier.numbers, row.numbers)
        changes.cases += 1
        changes.changed.update(diff.changed)
        largest.add(CasePair(before=earlier, after=row, diff=diff))
    changes.largest = largest.items()
    return changes


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
    changes = compare_rows(read_rows(before), read_rows(after))
    for line in _lines(name, changes):
        print(line)
    return bool(changes.changed)


def _lines(name: str, changes: SweepChanges) -> Iterator[str]:
    parts = counted_changes(changes.changed)
    yield f"{name}: {counted(changes.cases, 'case')}: {'; '.join(parts) or 'none changed'}"
    for pair in changes.largest:
        for row in (pair.before, pair.after):
            yield from row_lines(row)


def _print_line(line: str) -> None:
    print(line, flush=True)
