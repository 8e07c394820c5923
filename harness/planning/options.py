"""Options of a run: cases, engines, resolution, limits, and results beside the verdicts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from os import PathLike
from pathlib import Path

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.jobs.limits import LEAST_MEMORY, LEAST_SECONDS, MAX_LIMIT, Limits
from physics_crosscheck.harness.modelfiles.choice import CaseSelection
from physics_crosscheck.harness.paths import RESOLUTION
from physics_crosscheck.harness.records.baseline import RobotOptions, Snapshot
from physics_crosscheck.harness.records.case import CaseId, ModelKey
from physics_crosscheck.harness.records.outcome import COARSEST
from .cache import Cache

RESOLVED = (1e-13, COARSEST)
"""Range of resolutions that double precision can serve."""


def check_text(value: object, name: str, *, path: bool = False) -> None:
    """Check an argument that is a string, or a path.

    Raises:
        TypeError: naming the argument and the expected type.
    """
    if not isinstance(value, str | PathLike if path else str):
        what = "a path" if path else "a string"
        raise TypeError(f"{name} must be {what}, not {quote(value)}")


def check_names(value: object, name: str) -> None:
    """Check an argument that is a sequence of names.

    Raises:
        TypeError: naming the argument and the expected type.
    """
    if isinstance(value, str):
        raise TypeError(f"{name} must be a list, not {value!r}; write {name}=[{value!r}]")
    if not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise TypeError(f"{name} must be a list of names, not {quote(value)}")


def check_number(
    value: object,
    name: str,
    smallest: float,
    largest: float,
    unit: str = "",
    *,
    whole: bool = False,
) -> float:
    """Return an argument that is a number from `smallest` to `largest`; numpy numbers are valid.

    Raises:
        TypeError: for anything but a number, or a whole number if `whole`.
        ValueError: for a number out of range.
    """
    kind = f"{'a whole number' if whole else 'a number'}{unit and ' of '}{unit}"
    expected = f"{name} must be {kind}"
    if isinstance(value, bool) or not isinstance(value, Integral if whole else Real):
        raise TypeError(f"{expected}, not {quote(value)}")
    number = float(value)
    if not smallest <= number <= largest:
        raise ValueError(f"{expected} from {smallest:g} to {largest:g}, not {quote(value)}")
    return number


def check_resolution(value: object) -> float:
    """Return a resolution.

    Raises:
        TypeError, ValueError: for a resolution that double precision cannot serve.
    """
    return check_number(value, "resolution", *RESOLVED)


def check_limits(seconds: object, memory: object, options: str) -> Limits:
    """Return the limits of a task.

    Args:
        seconds: processor seconds.
        memory: GiB.
        options: prefix of both names in messages.

    Raises:
        TypeError, ValueError: for an invalid limit.
    """
    return Limits(
        seconds=check_number(seconds, "limit", LEAST_SECONDS, MAX_LIMIT, "seconds"),
        memory=check_number(memory, "memory", LEAST_MEMORY, MAX_LIMIT, "GiB"),
        options=options,
    )


def resolvable(resolution: float) -> bool:
    """Return whether double precision can serve a resolution."""
    smallest, largest = RESOLVED
    return smallest <= resolution <= largest


@dataclass(frozen=True)
class Selection:
    """The part of a run that a comparison needs: the motion of each case's model.

    Attributes:
        models: those to run; None: all.
        snapshot: returns the segments that a case of a folder or robot file repeats, if any.
    """

    models: frozenset[ModelKey] | None
    snapshot: Callable[[str, CaseId], Snapshot | None] = lambda folder, case: None

    def includes(self, model: ModelKey) -> bool:
        """Return whether a model is to be run."""
        return self.models is None or model in self.models


@dataclass(frozen=True)
class Options:
    """Options of a run, and of the gate, audits and planted faults.

    Attributes:
        baseline: the folder with accepted differences.
        floating: whether the root link of a standalone URDF moves.
        model: the model to read from an SDFormat file that has several.
        motion: duration of the motion from rest of a standalone file, seconds; 0 for none.
        smooth: whether steps of a standalone file are compared without limits, friction, contacts
            and drives only.
        ideal: whether models of a folder are judged by rigid contacts, not by their engines' laws.
        robots: other options of both kinds, for single robot files.
        choice: the cases to run.
        scheduler: address of a cluster's scheduler; empty for processes of this machine.
        cache: results of earlier runs, reused where their inputs have not changed.
        thorough: whether every check of a case runs, also those whose answer others imply.
        strict: whether differences within an engine's own precision count.
        every: whether the gate runs unchanged cases too.
        diagnose: whether a run with a selection finds the cause of each difference; slower.
        parents: folders whose systems are all given, so that one missing in the gate is gone; None:
            the gate expects every system of the baseline.
    """

    engines: tuple[str, ...] = ()
    resolution: float = RESOLUTION
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    baseline: Path | None = None
    selection: Selection | None = None
    floating: bool | None = None
    model: str = ""
    motion: float = 0.0
    smooth: bool = False
    ideal: bool = False
    robots: Mapping[Path, RobotOptions] = field(default_factory=dict)
    choice: CaseSelection = field(default_factory=CaseSelection)
    scheduler: str = ""
    cache: Cache | None = None
    thorough: bool = False
    strict: bool = False
    every: bool = False
    diagnose: bool = False
    parents: tuple[Path, ...] | None = None

    def robot(self, file: Path) -> RobotOptions:
        """Return the options with which a robot file is read."""
        return self.robots.get(file) or RobotOptions(floating=self.floating, model=self.model)

    @property
    def described(self) -> bool:
        """Linearizations and the derivation for a report are computed."""
        return self.selection is None

    @property
    def diagnosed(self) -> bool:
        """Models that differ are diagnosed."""
        return self.selection is None or self.diagnose
