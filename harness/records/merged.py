"""Results of models that were run again, among those of the others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from msgspec.structs import replace

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import BaselineChange, BaselineChanges, Results

T = TypeVar("T", Case, Model)


def merged(last: Results, now: Results, again: Callable[[str, str], bool]) -> Results:
    """What a run found, with what an earlier one did of the models that were not run again.

    Args:
        last: the earlier run's; it had the same versions and resolution.
        now: what was found now.
        again: whether a model was run again, by folder and file.
    """
    folders = list(dict.fromkeys(one.folder for one in (*last.cases, *now.cases)))
    there = {system.folder for system in now.systems}
    # A declaration that can't be read any more has no system, and all its models were run again.
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
    """Those that stay and those that came, in the order of the earlier run."""
    found: dict[str, list[T]] = {}
    for one in last:
        stays = found.setdefault(one.folder, [])
        if not again(one.folder, one.model):
            stays.append(one)
    for one in now:
        found.setdefault(one.folder, []).append(one)
    # Sorting keeps scenarios in their order: they have no name of their own here.
    return tuple(
        one
        for rows in found.values()
        for one in sorted(rows, key=lambda one: (one.model, one.engine))
    )


def _baseline(
    last: Results, now: Results, again: Callable[[str, str], bool]
) -> BaselineChanges | None:
    """Changes since what was accepted, of both."""
    if last.baseline is None or now.baseline is None:
        return now.baseline
    folder = {case.id: case.folder for case in last.cases}

    def stays(change: BaselineChange) -> bool:
        return not again(folder.get(change.id, ""), change.model)

    kept = tuple(change for change in last.baseline.changes if stays(change))
    return replace(now.baseline, changes=(*now.baseline.changes, *kept))
