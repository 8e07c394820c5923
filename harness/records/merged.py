"""Merge results of models that ran again into earlier results."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from msgspec.structs import replace

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.diff import Diff
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import BaselineChanges, Results

T = TypeVar("T", Case, Model)


def merged(last: Results, now: Results, again: Callable[[str, str], bool]) -> Results:
    """Merge the results of a run with earlier results of models that did not run again.

    Args:
        last: results of the earlier run, with the same versions and resolution.
        now: new results.
        again: whether a model ran again, by folder and file.
    """
    folders = list(dict.fromkeys(one.folder for one in (*last.cases, *now.cases)))
    there = {system.folder for system in now.systems}
    # A declaration that became unreadable has no system, and all its models ran again.
    kept = [s for s in last.systems if s.folder not in there and not again(s.folder, "")]
    systems = sorted([*kept, *now.systems], key=lambda s: folders.index(s.folder))
    cases = _in_order(last.cases, now.cases, again)
    return replace(
        now,
        systems=tuple(systems),
        models=_in_order(last.models, now.models, again),
        cases=cases,
        baseline=_baseline(last, now, again),
    )


def _in_order(
    last: Iterable[T], now: Iterable[T], again: Callable[[str, str], bool]
) -> tuple[T, ...]:
    """Merge old and new items in the order of the earlier run."""
    groups: dict[str, list[T]] = {}
    for item in last:
        stays = groups.setdefault(item.folder, [])
        if not again(item.folder, item.model):
            stays.append(item)
    for item in now:
        groups.setdefault(item.folder, []).append(item)
    # Stable sorting keeps the order of scenarios, which have no key here.
    return tuple(
        item
        for rows in groups.values()
        for item in sorted(rows, key=lambda item: (item.model, item.engine))
    )


def _baseline(
    last: Results, now: Results, again: Callable[[str, str], bool]
) -> BaselineChanges | None:
    """Merge the changes since the baseline."""
    if last.baseline is None or now.baseline is None:
        return now.baseline
    folder = {case.id: case.folder for case in last.cases}

    def stays(change: Diff) -> bool:
        return not again(folder.get(change.id, ""), change.model)

    kept = tuple(change for change in last.baseline.changes if stays(change))
    return replace(now.baseline, changes=(*now.baseline.changes, *kept))
