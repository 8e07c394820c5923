"""Trials of file differences: applied to a copy of A, to see whether it then moves as B."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.compare.candidate import Candidate, CompareError
from physics_crosscheck.harness.compare.diff import SourceEdit, applied
from physics_crosscheck.harness.compare.excitation import unwrapped
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.runs import Runs, quick
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Model, Spring
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts


@dataclass(frozen=True, kw_only=True)
class TrialTask:
    """Input of a worker that tries some differences at once in one model.

    Attributes:
        side: the model to edit.
        edits: applied together; () for the unchanged model.
        runs: in its own coordinates.
        match: conversion to the coordinates of the comparison; None: they are equal.
        joints: number of its coordinates.
        near: end states near which angles are taken, (K, 2m).
        periodic: of the coordinates of the comparison.
        other: settings that hold B's actuators.
        whole: whether all differences are applied, so that actuators are those of B.
    """

    candidate: Candidate
    edits: tuple[SourceEdit, ...]
    runs: Runs
    match: Match | None
    joints: int
    near: Array
    periodic: tuple[bool, ...]
    other: Mapping[str, list[float]]
    whole: bool = False


@dataclass(frozen=True)
class Trial:
    """Effect of an edit.

    Attributes:
        edits: applied edits.
        moved: largest change of A's end states, relative to how far the components move.
        explained: share of the discrepancy that disappears; 1 is all of it.
        not_tried: reason why it could not be tried, or empty.
    """

    edits: tuple[SourceEdit, ...]
    moved: float
    explained: float
    not_tried: str = ""


def tried(task: TrialTask) -> Array:
    """Return end states (K, 2m) of the runs with some edits applied to a copy.

    Raises:
        EngineError: if the edited model cannot run.
    """
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        try:
            model = _loaded(task, _edited(task.candidate, task.edits, Path(folder)))
            if len(model.coordinates) != task.joints:
                raise EngineError("it changes which joints there are")
            ends = quick(model, task.runs, task.match)
        except CompareError:
            raise
        except (RuntimeError, ValueError) as error:
            # Drop the path of the temporary copy: the file's own name is enough.
            raise EngineError(str(error).replace(f"{Path(folder)}{os.sep}", "")) from error
    if task.match is not None:
        n = task.runs.z.shape[1]
        ends = np.hstack(task.match.over(ends[:, :n], ends[:, n:]))
    return unwrapped(ends, task.near, task.periodic)


def _loaded(task: TrialTask, edited: Candidate) -> Model:
    """Return the edited model, with its actuators held as A's, or as B's where they are B's.

    Raises:
        EngineError: if it cannot be loaded, or its number of actuators is neither A's nor B's.
    """
    as_b = edited.with_settings(**task.other) if task.other else edited
    try:
        return (
            edited.with_settings(**_completed(task)) if task.whole and task.other else edited
        ).load()
    except EngineError as error:
        if not UNLIKE_ACTUATORS.search(str(error)):
            raise
    try:
        return as_b.load()
    except EngineError:
        raise EngineError("it changes which actuators there are") from None


def _completed(task: TrialTask) -> dict[str, object]:
    """Return B's settings, or A's of equal length, since its actuators keep their order."""
    settings = task.candidate.sidecar.spec(task.candidate.engine).settings
    return {
        key: mine if isinstance(mine := settings.get(key), list) and len(mine) == len(its) else its
        for key, its in task.other.items()
    }


UNLIKE_ACTUATORS = re.compile(r"\[settings\] (controls|activations) is")
"""Error for a wrong number of actuators."""


def _edited(candidate: Candidate, edits: Sequence[SourceEdit], folder: Path) -> Candidate:
    """Return a copy of the model with edits; link to the other files of its folder."""
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


def attribute_difference(
    edits: tuple[SourceEdit, ...], edited: Array, a: Array, b: Array, scale: Array, floor: float
) -> Trial:
    """Return the effect of edits: end states of A edited, of A and of B, (K, 2m) each.

    Below `floor`, relative to `scale`, nothing is certain.
    """
    moved = float(np.max(np.abs(edited - a) / scale))
    before, after = (np.abs(one - b) / scale for one in (a, edited))
    size = float(np.sqrt(np.mean(before**2)))
    if moved <= floor:
        return Trial(edits, 0.0, 0.0)
    if float(np.max(after)) <= floor:
        return Trial(edits, moved, 1.0)
    remaining = float(np.sqrt(np.mean(after**2)))
    return Trial(edits, moved, 1.0 - remaining / size if size > 0 else 0.0)
