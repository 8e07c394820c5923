"""`crosscheck compare`: from two files to one outcome, and what differs.

    match ─> record (source) ─> follow (target) ─> judge ─> mechanics of both ─> terms
                                                         └> edits ─> trials (literals)

Each engine runs in a worker process, so that a crash costs the comparison and nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

import numpy as np

from harness.compare.candidate import Candidate, CompareError, Facts, facts
from harness.compare.diff import Edit, edits
from harness.compare.excitation import Recorded, SourceTask, record
from harness.compare.judge import Followed, Judgement, TargetTask, follow, judge
from harness.compare.match import Match, match
from harness.compare.mechanics import MechanicsTask, mechanics
from harness.compare.runs import Runs
from harness.compare.terms import Frame, Term, terms
from harness.compare.trials import Trial, TrialTask, attribute_difference, tried
from harness.engines.protocol import Array
from harness.files.locations import LocationError
from harness.records.outcome import Outcome
from harness.schedule.workers import Failure

MOST_TRIED = 60
"""Differences of the files that are tried one by one; beyond, they are only counted."""

SOME = 32
"""Runs on which they are tried."""

TURNED = 1e-4
"""From so large a discrepancy on, joints that turn the other way are looked for."""

T = TypeVar("T")
V = TypeVar("V")


class Execute(Protocol):
    """Runs a function on each argument, elsewhere."""

    def __call__(
        self, who: str, function: Callable[[T], V], arguments: Sequence[T]
    ) -> list[V | Failure]:
        """Values in the order of the arguments; one that fails gives a `Failure`.

        Args:
            who: what messages call the model that is run.
        """


class FailureError(RuntimeError):
    """A comparison that could not be run."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """What is to be compared, and how: see `harness.compare.match` and `excitation`."""

    a: Candidate
    b: Candidate
    joints: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    starts: tuple[Mapping[str, float], ...] = ()
    resolution: float = 1e-9


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What came out.

    Attributes:
        facts: of A and B, as loaded.
        turned: joints that turn the other way in B; the terms are then those beside that.
        left: the discrepancy that is left when these are turned.
        terms: worst first; empty where nothing differs.
        trials: of each difference of the files, and of all together; most telling first.
        untried: how many differences of the files were not tried.
        notes: what was assumed or left out.
    """

    options: CompareOptions
    facts: tuple[Facts, Facts]
    match: Match
    recorded: Recorded
    judgement: Judgement
    turned: tuple[str, ...]
    left: float
    terms: tuple[Term, ...]
    trials: tuple[Trial, ...]
    untried: int
    notes: tuple[str, ...]
    seconds: float


def compare(options: CompareOptions, execute: Execute) -> Findings:
    """Compare two models.

    Raises:
        CompareError: for joints without a match, with the remedy.
        FailureError: where an engine fails, with what it printed.
    """
    began = time.perf_counter()
    a, b = options.a, options.b
    loaded = (_one(execute, a, facts, a), _one(execute, b, facts, b))
    matched = match(
        loaded[0].coordinates,
        loaded[1].coordinates,
        options.joints,
        (a.sidecar.readback, b.sidecar.readback),
    )
    source, target = (a, b) if matched.source == "A" else (b, a)
    recorded = _one(
        execute, source, record, SourceTask(source, matched, options.starts, options.resolution)
    )
    if not len(recorded.runs.z):
        reason = (
            f"its motion is resolved in none of {recorded.lost} runs (contact, limit, friction)"
        )
        raise FailureError(Failure(f"{source.name}: {reason}", ""))
    z, w = matched.over(recorded.runs.z, recorded.runs.w)
    runs = replace(recorded.runs, z=z, w=w)
    trial = _Following(
        execute=execute,
        target=target,
        recorded=recorded,
        runs=runs,
        match=matched,
        resolution=options.resolution,
    )
    ones = np.ones(len(matched.names))
    followed, judgement = trial.judged(ones)
    turned, signs, left = _turned(trial, judgement, matched.names)
    found: tuple[Term, ...] = ()
    if judgement.outcome is not Outcome.AGREES and not (turned and left <= options.resolution):
        found = _terms(execute, source, target, recorded, runs, matched, signs)
    trials, untried = _trials(execute, options, recorded, runs, followed, matched)
    return Findings(
        options=options,
        facts=loaded,
        match=matched,
        recorded=recorded,
        judgement=judgement,
        turned=turned,
        left=left,
        terms=found,
        trials=trials,
        untried=untried,
        notes=(*a.notes, *b.notes, *_lost(recorded, matched)),
        seconds=time.perf_counter() - began,
    )


def _lost(recorded: Recorded, matched: Match) -> tuple[str, ...]:
    """What is said of states whose runs are left out."""
    if not recorded.lost:
        return ()
    return (
        f"{recorded.lost} of {recorded.lost + len(recorded.runs.z)} runs are left out: there"
        f" the motion of {matched.source} is not resolved (a contact, a limit, friction, or"
        " too quick)",
    )


def _one(execute: Execute, candidate: Candidate, function: Callable[[T], V], argument: T) -> V:
    (value,) = execute(candidate.name, function, [argument])
    if isinstance(value, Failure):
        raise CompareError(value.reason) if value.usage else FailureError(value)
    return value


@dataclass(frozen=True, kw_only=True)
class _Following:
    """The target run from the source's states, with joints turned or not."""

    execute: Execute
    target: Candidate
    recorded: Recorded
    runs: Runs
    match: Match
    resolution: float

    def judged(self, signs: Array) -> tuple[Followed, Judgement]:
        task = TargetTask(self.target, self.runs, self.resolution, signs)
        followed = _one(self.execute, self.target, follow, task)
        return followed, judge(self.recorded, followed, self.match, self.resolution)


def _turned(
    trial: _Following, judgement: Judgement, names: tuple[str, ...]
) -> tuple[tuple[str, ...], Array, float]:
    """Joints that turn the other way: turned one after the other while that mends most of it."""
    signs = np.ones(len(names))
    left = float(np.max(judgement.by_component))
    if judgement.outcome is not Outcome.DIFFERS or left < TURNED:
        return (), signs, left
    turned: list[str] = []
    while len(turned) < len(names):
        sizes = {}
        for i in range(len(names)):
            if signs[i] > 0:
                guess = signs.copy()
                guess[i] = -1.0
                try:
                    one = trial.judged(guess)[1]
                except FailureError:
                    continue
                sizes[i] = float(np.max(one.by_component))
        best = min(sizes, key=lambda i: sizes[i], default=None)
        if best is None or sizes[best] > 0.1 * left:
            break
        # A mechanism that is its own mirror image doesn't tell which of its joints is turned.
        like = [i for i, size in sizes.items() if size <= max(1.5 * sizes[best], trial.resolution)]
        left = sizes[best]
        signs[best] = -1.0
        turned.append(" or ".join(names[i] for i in like))
    return tuple(turned), signs, left


def _terms(
    execute: Execute,
    source: Candidate,
    target: Candidate,
    recorded: Recorded,
    runs: Runs,
    matched: Match,
    signs: Array,
) -> tuple[Term, ...]:
    """The terms of both models, measured at some of the states."""
    going = np.flatnonzero(np.max(np.abs(runs.w), axis=1) > 0)
    count = len(recorded.independent) + 6
    if not len(going):
        return ()
    picked = going[np.unique(np.linspace(0, len(going) - 1, count).astype(int))]
    task = partial(
        MechanicsTask,
        independent=recorded.independent,
        unit=recorded.unit,
        fastest=recorded.fastest,
        typical=recorded.typical,
    )
    own = recorded.runs
    ones = np.ones(len(signs))
    one = _one(
        execute,
        source,
        mechanics,
        task(candidate=source, match=matched, signs=ones, z=own.z[picked], w=own.w[picked]),
    )
    other = _one(
        execute,
        target,
        mechanics,
        task(
            candidate=target,
            match=None,
            signs=signs,
            z=runs.z[picked] * signs,
            w=runs.w[picked] * signs,
        ),
    )
    if matched.source == "B":
        one, other = other, one
    chosen = list(recorded.independent)
    frame = Frame(
        [matched.names[i] for i in chosen],
        runs.z[picked][:, chosen],
        recorded.unit[chosen],
        recorded.typical,
    )
    return terms(one, other, frame)


def _trials(
    execute: Execute,
    options: CompareOptions,
    recorded: Recorded,
    runs: Runs,
    followed: Followed,
    matched: Match,
) -> tuple[tuple[Trial, ...], int]:
    """What each difference of the files does to the motions, and all of them together."""
    try:
        found = edits(options.a, options.b)
    except LocationError as error:
        raise FailureError(Failure(str(error), "")) from None
    can = [edit for edit in found if edit.changes or edit.settings]
    if not can:
        return tuple(Trial((edit,), 0.0, 0.0, "it can't be tried alone") for edit in found), 0
    doubt = (recorded.uncertainty + followed.limit.uncertainty) / recorded.scale
    # Where both are smooth: elsewhere nothing is certain.
    smooth = np.flatnonzero(np.max(doubt, axis=1) <= options.resolution)
    smooth = smooth if len(smooth) else np.arange(len(doubt))
    some = smooth[np.unique(np.linspace(0, len(smooth) - 1, SOME).astype(int))]
    near = recorded.end[some]
    is_source = matched.source == "A"

    def task(candidate: Candidate, made: tuple[Edit, ...], source: bool) -> TrialTask:
        own = recorded.runs if source else runs
        part = Runs(length=own.length, z=own.z[some], w=own.w[some], push=own.push[some])
        return TrialTask(
            candidate=candidate,
            edits=made,
            runs=part,
            match=matched if source else None,
            joints=own.z.shape[1],
            near=near,
            periodic=matched.periodic,
        )

    a = _one(execute, options.a, tried, task(options.a, (), is_source))
    b = _one(execute, options.b, tried, task(options.b, (), not is_source))
    doubt = doubt[some]
    floor = 2 * float(np.max(doubt[np.isfinite(doubt)], initial=1e-13))
    sets: list[tuple[Edit, ...]] = [(edit,) for edit in can[:MOST_TRIED]]
    if len(can) > 1:
        sets.append(tuple(can))
    values = execute(options.a.name, tried, [task(options.a, made, is_source) for made in sets])
    trials = [
        Trial(made, 0.0, 0.0, value.reason)
        if isinstance(value, Failure)
        else attribute_difference(made, value, a, b, recorded.scale, floor)
        for made, value in zip(sets, values, strict=True)
    ]
    trials += [
        Trial((edit,), 0.0, 0.0, "it can't be tried alone")
        for edit in found
        if not edit.changes and not edit.settings
    ]
    trials.sort(key=lambda one: (-one.explained, -one.moved, len(one.edits)))
    return tuple(trials), max(0, len(can) - MOST_TRIED)
