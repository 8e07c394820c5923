"""Effect of each difference of the files on the motions, and of all differences together."""

import os
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.elements import read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import Array, EngineError, LoadedModel, Spring
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.locations import MARKUP, read_source
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import FileDifference, FileEdit
from physics_crosscheck.reference.solving.segments import Segments, even_indices
from .candidate import Candidate, CompareError, FailureError, ask, ask_each
from .diff import SourceEdit, applied, edits
from .judge import Recorded
from .match import Match
from .prepared import PreparedComparison
from .segments import Ends, quick, unwrapped

MAX_SINGLE_TRIALS = 24
"""Maximum number of differences tried one by one, largest first; the rest is only counted."""

TRIAL_RUNS = 32
"""Runs on which differences are tried."""

MAX_UNCERTAINTY = 1e-9
"""Largest uncertainty of an effect that is taken for none."""

SMOOTH_UNCERTAINTY = 1e-9
"""Relative uncertainty of end states below which runs are preferred."""


@dataclass(frozen=True, kw_only=True)
class Attribution:
    """Effects of the differences of the files.

    Attributes:
        trials: of each difference, and of all together; the largest effect first.
        untried: number of differences not tried alone.
        silent: differences without a known effect, except visual ones.
    """

    trials: tuple[FileDifference, ...]
    untried: int = 0
    silent: tuple[FileEdit, ...] = ()


def attributed(
    executor: Executor,
    prepared: PreparedComparison,
    recorded: Recorded,
    followed: Ends,
    is_known: bool,
) -> Attribution:
    """Apply the differences of the files to copies of A, one by one and together.

    Args:
        executor: runs the engines.
        prepared: both models.
        recorded: runs of the source.
        followed: the target's end states.
        is_known: whether bodies or joints are known to differ; then many differences are not tried
            one by one.

    Raises:
        FailureError: if a file cannot be read, or an engine fails with the unchanged files.
    """
    try:
        differences = edits(*prepared.models)
    except LocationError as error:
        raise FailureError(Failure(str(error), "")) from None
    can = [edit for edit in differences if edit.changes or edit.settings]
    rest = [
        _difference((edit,), not_tried="it can't be tried alone")
        for edit in differences
        if not edit.changes and not edit.settings
    ]
    engine, file = engines()[prepared.models[0].engine], prepared.models[0].sidecar.model
    root = read_elements(read_source(file))[0].tag if file.suffix in MARKUP else ""
    visual = [re.compile(one) for one, what in engine.non_physical.items() if what in NO_PHYSICS]
    quiet = [edit.record for edit in differences if _is_ineffective(edit, root, visual)]
    if not can:
        return Attribution(trials=tuple(rest), silent=_silent(rest, quiet))
    measured = _bench(executor, prepared, recorded, followed, len(can))
    looks = [re.compile(pattern) for pattern in engine.non_physical]
    ineffective = [edit for edit in can if _is_ineffective(edit, root, looks)]
    others = sorted((edit for edit in can if edit not in ineffective), key=_size, reverse=True)
    idle_limit, single_limit = (
        0 if is_known and count > MAX_SINGLE_TRIALS else MAX_SINGLE_TRIALS
        for count in (len(others) + len(ineffective), len(others))
    )
    together = measured([tuple(ineffective)]) if len(ineffective) > 1 else []
    if together and not together[0].not_tried and together[0].moved == 0.0:
        trials = [_difference((edit,)) for edit in ineffective]
    else:
        trials = measured([(edit,) for edit in ineffective[:idle_limit]])
    sets: list[tuple[SourceEdit, ...]] = [(edit,) for edit in others[:single_limit]]
    untried = len(can) - len(trials) - len(sets)
    if len(can) > 1:
        sets.append(tuple(can))
    trials += [*measured(sets), *rest]
    # Round to six digits, so that last digits do not change the order of like trials.
    trials.sort(key=_largest_first)
    return Attribution(trials=tuple(trials), untried=untried, silent=_silent(trials, quiet))


def _largest_first(trial: FileDifference) -> tuple[float, float, int]:
    explained, moved = (
        float("inf") if size is None else size for size in (trial.explained, trial.moved)
    )
    return (
        -round(explained, 6) if np.isfinite(explained) else 0.0,
        -float(f"{moved:.5e}"),
        len(trial.edits),
    )


def _silent(trials: Sequence[FileDifference], quiet: Sequence[FileEdit]) -> tuple[FileEdit, ...]:
    silent = (one for one in trials if len(one.edits) == 1 and (one.not_tried or one.moved == 0))
    return tuple(edit for edit in (one.edits[0] for one in silent) if edit not in quiet)


NO_PHYSICS = ("looks", "step and solver")
"""Categories of numbers without physical effect."""


def _is_ineffective(edit: SourceEdit, root: str, looks: Iterable[re.Pattern[str]]) -> bool:
    """Return whether a difference probably affects no motion, such as a shape; it is tried anyway.

    A whole element counts like its numbers.
    """
    tags = re.sub(r"\[[^\]]*\]", "", edit.record.what)
    paths = (f"{root}/{tags}", f"{root}/{tags.replace('@', '/')}/")
    return bool(edit.changes) and any(one.fullmatch(path) for one in looks for path in paths)


def _actuation(a: Candidate, b: Candidate) -> dict[str, list[float]]:
    """Return the settings that hold B's actuators; A's if as many, since they keep their order."""
    mine, its = (one.settings for one in (a, b))
    held: dict[str, list[float]] = {}
    for key in sorted(b.given & {"controls", "activations"}):
        values, values_of_a = its[key], mine.get(key)
        assert isinstance(values, list)
        is_alike = isinstance(values_of_a, list) and len(values_of_a) == len(values)
        held[key] = list(values_of_a if is_alike else values)  # type: ignore[call-overload]
    return held


def _size(edit: SourceEdit) -> float:
    try:
        old, new = float(edit.record.a), float(edit.record.b)
    except ValueError:
        return 1.0
    large = max(abs(old), abs(new))
    return abs(old - new) / large if large and np.isfinite(large) else 1.0


def _bench(
    executor: Executor, prepared: PreparedComparison, recorded: Recorded, followed: Ends, count: int
) -> Callable[[Sequence[tuple[SourceEdit, ...]]], list[FileDifference]]:
    """Run both models, unmodified, on some of the runs; return a trial of sets of edits in A.

    `count` is that of all edits.
    """
    scale = recorded.compared.unit
    doubt = (recorded.bound + followed.uncertainty) / scale
    # Elsewhere than in smooth runs nothing is certain.
    smooth = np.flatnonzero(np.max(doubt, axis=1) <= SMOOTH_UNCERTAINTY)
    smooth = smooth if len(smooth) else np.arange(len(doubt))
    some = smooth[even_indices(len(smooth), TRIAL_RUNS)]
    (a, b), match = prepared.models, prepared.match

    def run(candidate: Candidate) -> partial[Array]:
        source = candidate.label == match.source
        runs = recorded.runs if source else recorded.compared
        return partial(
            tried,
            candidate=candidate,
            runs=runs.pick(some),
            match=match if source else None,
            near=recorded.compared.end[some],
            periodic=match.periodic,
            actuation=_actuation(a, b),
            count=count,
        )

    relevant = doubt[some]
    ends_a, ends_b = ask(executor, a, run(a), ()), ask(executor, b, run(b), ())
    floor = 2 * float(np.max(relevant[np.isfinite(relevant)], initial=1e-13))

    def measured(sets: Sequence[tuple[SourceEdit, ...]]) -> list[FileDifference]:
        values = ask_each(executor, a, run(a), sets)
        return [
            _difference(made, not_tried=value.reason)
            if isinstance(value, Failure)
            else _attributed(made, value, ends_a, ends_b, scale, floor)
            for made, value in zip(sets, values, strict=True)
        ]

    return measured


def tried(
    edits: tuple[SourceEdit, ...],
    *,
    candidate: Candidate,
    runs: Segments,
    match: Match | None,
    near: Array,
    periodic: tuple[bool, ...],
    actuation: Mapping[str, list[float]],
    count: int,
) -> Array:
    """Return end states (K, 2m) of the runs with some edits applied to a copy.

    Args:
        edits: applied together; () for the unchanged model.
        candidate: the model to edit.
        runs: in its own coordinates.
        match: conversion to the coordinates of the comparison; None: they are equal.
        near: end states near which angles are taken, (K, 2m).
        periodic: of the coordinates of the comparison.
        actuation: settings that hold B's actuators.
        count: number of all edits; with all of them, actuators are those of B.

    Raises:
        EngineError: if the edited model cannot run.
    """
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        try:
            edited = _edited(candidate, edits, Path(folder))
            model = _loaded(edited, actuation, whole=len(edits) == count)
            if 2 * len(model.coordinates) != runs.start.shape[1]:
                raise EngineError("it changes which joints there are")
            ends = quick(model, runs, match)
        except CompareError:
            raise
        except (RuntimeError, ValueError) as error:
            # Drop the path of the temporary copy: the file's own name is enough.
            raise EngineError(str(error).replace(f"{Path(folder)}{os.sep}", "")) from error
    return unwrapped(ends if match is None else match.convert(ends), near, periodic)


def _loaded(edited: Candidate, actuation: Mapping[str, list[float]], *, whole: bool) -> LoadedModel:
    """Return the edited model, with its actuators held as A's, or as B's where they are B's.

    Raises:
        EngineError: if it cannot be loaded, or its number of actuators is neither A's nor B's.
    """
    held = [{}, actuation] if actuation else [{}]
    for settings in reversed(held) if whole else held:
        try:
            return edited.with_settings(**settings).load()
        except EngineError as error:
            if not UNLIKE_ACTUATORS.search(str(error)):
                raise
    raise EngineError("it changes which actuators there are")


UNLIKE_ACTUATORS = re.compile(r"\[settings\] (controls|activations) is")
"""Error for a wrong number of actuators."""


def _edited(candidate: Candidate, edits: Sequence[SourceEdit], folder: Path) -> Candidate:
    model = candidate.sidecar.model
    copy = copy_with_texts(model, {model: applied(model.read_bytes(), tuple(edits))}, folder)
    sidecar = replace(candidate.sidecar, model=copy)
    springs = list(sidecar.springs)
    settings = {**sidecar.settings, **sidecar.engine_settings.get(candidate.engine, {})}
    for key, value in (setting for edit in edits for setting in edit.settings):
        kind, _, name = key.partition(".")
        if kind != "settings":
            index = int(key.removeprefix("spring[").removesuffix("]"))
            springs[index : index + 1] = [value] if isinstance(value, Spring) else []
        elif value is None:
            settings.pop(name, None)
        else:
            settings[name] = value
    sidecar = replace(sidecar, springs=tuple(springs), settings=settings, engine_settings={})
    return replace(candidate, sidecar=sidecar)


def _difference(edits: Sequence[SourceEdit], **result: object) -> FileDifference:
    values = {"moved": 0.0, "explained": 0.0, "not_tried": "", **result}
    return FileDifference(edits=tuple(edit.record for edit in edits), **values)  # type: ignore[arg-type]


def _attributed(
    edits: tuple[SourceEdit, ...], edited: Array, a: Array, b: Array, scale: Array, floor: float
) -> FileDifference:
    """Return the effect of edits: end states of A edited, of A and of B, (K, 2m) each.

    Below `floor`, relative to `scale`, nothing is certain.
    """
    moved = float(np.max(np.abs(edited - a) / scale))
    before, after = (np.abs(one - b) / scale for one in (a, edited))
    size, remaining = (float(np.sqrt(np.mean(one**2))) for one in (before, after))
    if moved <= floor:
        unknown = f"its effect is below the uncertainty, {floor:.1e}"
        return _difference(edits, not_tried=unknown if floor > MAX_UNCERTAINTY else "")
    if float(np.max(after)) <= floor:
        return _difference(edits, moved=moved, explained=1.0)
    explained = number(1.0 - remaining / size if size > 0 else 0.0)
    return _difference(edits, moved=number(moved), explained=explained)
