"""What a run may be told: which cases, in which engines, how finely, and what beside verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from os import PathLike
from pathlib import Path

from physics_crosscheck.harness.cached import Cache
from physics_crosscheck.harness.files.brief import brief
from physics_crosscheck.harness.files.choice import Choice
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.case import CaseId, ModelKey
from physics_crosscheck.harness.schedule.limits import LEAST_MEMORY, LEAST_SECONDS, MOST, Limits

RESOLVED = (1e-13, 1e-2)
"""Resolutions that double precision can serve."""


def check_text(value: object, name: str, *, path: bool = False) -> None:
    """Check an argument that is a text, or a path.

    Raises:
        TypeError: naming the argument, and what belongs there.
    """
    if not isinstance(value, str | PathLike if path else str):
        what = "a path" if path else "a string"
        raise TypeError(f"{name} is {brief(value)}, where {what} belongs")


def check_names(value: object, name: str) -> None:
    """Check an argument that is a sequence of names.

    Raises:
        TypeError: naming the argument, and what belongs there.
    """
    if isinstance(value, str):
        raise TypeError(f"{name} is {value!r}, where a list belongs: {name}=[{value!r}]")
    if not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise TypeError(f"{name} is {brief(value)}, where a list of names belongs")


def check_number(
    value: object, name: str, least: float, most: float, unit: str = "", *, whole: bool = False
) -> float:
    """Return an argument that is a number from `least` to `most`; numpy's own count too.

    Raises:
        TypeError: for what is no number, or no whole one where that is asked.
        ValueError: for one that is out of bounds.
    """
    kind = f"{'a whole number' if whole else 'a number'}{unit and ' of '}{unit}"
    told = f"{name} is {brief(value)}, where {kind}"
    if isinstance(value, bool) or not isinstance(value, Integral if whole else Real):
        raise TypeError(f"{told} belongs")
    number = float(value)
    if not least <= number <= most:
        raise ValueError(f"{told} from {least:g} to {most:g} belongs")
    return number


def check_resolution(value: object) -> float:
    """Return a resolution.

    Raises:
        TypeError, ValueError: for one that double precision can't serve.
    """
    return check_number(value, "resolution", *RESOLVED)


def check_limits(seconds: object, memory: object, options: str) -> Limits:
    """Return the limits of a task.

    Args:
        seconds: of the processor.
        memory: GiB.
        options: what the names of the two are told with.

    Raises:
        TypeError, ValueError: for what is no limit.
    """
    return Limits(
        seconds=check_number(seconds, "limit", LEAST_SECONDS, MOST, "seconds"),
        memory=check_number(memory, "memory", LEAST_MEMORY, MOST, "GiB"),
        options=options,
    )


def resolvable(resolution: float) -> bool:
    """Whether double precision can serve a resolution."""
    least, most = RESOLVED
    return least <= resolution <= most


@dataclass(frozen=True)
class Selection:
    """What is wanted of a run that compares: what each case's model does, and not all beside it.

    Attributes:
        models: those to run; None: all.
        snapshots: accepted ones, by case.
        repeated: others, by folder and case: two folders may hold systems of one name.
        diagnose: whether models that differ are diagnosed.
        described: whether linearizations are wanted, and the derivation for a report.
    """

    models: frozenset[ModelKey] | None
    snapshots: Mapping[CaseId, Snapshot] = field(default_factory=dict)
    repeated: Mapping[tuple[str, CaseId], Snapshot] = field(default_factory=dict)
    diagnose: bool = False
    described: bool = False

    def includes(self, model: ModelKey) -> bool:
        """Whether a model is to be run."""
        return self.models is None or model in self.models

    def snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """The segments that a case is to repeat, if there are such."""
        return self.repeated.get((folder, case)) or self.snapshots.get(case)


@dataclass(frozen=True)
class Options:
    """What `crosscheck run` may be told.

    `baseline` is where known differences are looked up; `floating` lets the root link of a URDF
    that is given alone move; `model` chooses one of several models of an SDFormat file; `choice`
    tells which cases are wanted; `scheduler` is the address of a cluster's, empty for processes of
    this machine; `cache` has what was found before, where nothing it depends on is another.
    """

    engines: tuple[str, ...] = ()
    resolution: float = 1e-9
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    baseline: Path | None = None
    selection: Selection | None = None
    floating: bool = False
    model: str = ""
    choice: Choice = field(default_factory=Choice)
    scheduler: str = ""
    cache: Cache | None = None

    @property
    def described(self) -> bool:
        """Whether linearizations are wanted, and the derivation for a report."""
        return self.selection is None or self.selection.described

    @property
    def diagnosed(self) -> bool:
        """Whether models that differ are."""
        return self.selection is None or self.selection.diagnose
