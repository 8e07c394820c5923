"""`crosscheck compare`: from two files to one outcome and their differences.

    prepare ─> record (source) ─> follow (target) ─> judge ─> properties of the files ─> explained
                                                         ├> mechanics of both ─> terms
                                                         └> edits ─> trials (literals)

Besides, each engine is checked against its own file: `own_file`.
Each engine runs in a worker process, so that a crash only ends the comparison.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from physics_crosscheck.harness.compare.attribution import Attribution, attributed
from physics_crosscheck.harness.compare.candidate import Candidate, Facts
from physics_crosscheck.harness.compare.excitation import Recorded, SourceTask, record
from physics_crosscheck.harness.compare.execute import Execute, FailureError, ask
from physics_crosscheck.harness.compare.explained import Explained, explained
from physics_crosscheck.harness.compare.file_comparison import FileComparison, compare_files
from physics_crosscheck.harness.compare.judge import (
    Judgement,
    TargetEnds,
    TargetTask,
    follow,
    judge,
)
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.own_file import OwnFile, check_own_files
from physics_crosscheck.harness.compare.prepared import PreparedComparison, prepare
from physics_crosscheck.harness.compare.ranges import range_notes, start_range, taut_starts
from physics_crosscheck.harness.compare.runs import Runs
from physics_crosscheck.harness.compare.terms import (
    MechanicsTask,
    TermFrame,
    differing_terms,
    mechanics,
)
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.records.base import number, numbers
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedModel,
    ComparedProperty,
    ComparedRuns,
    ComparedTerm,
    Comparison,
    FileDifference,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.tree import WORLD
from physics_crosscheck.reference.solving.segments import even_indices

MIN_REVERSED_DISCREPANCY = 1e-4
"""Minimum discrepancy at which joints of opposite direction are sought."""

KNOWN_FILE_STATES = 1
"""States at which terms are measured where the files' bodies are known.

Elsewhere a linear fit of the forces on all joints needs more.
"""

MIN_EXPLAINED_SHARE = 0.99
"""Share of a discrepancy above which both files' equations explain it; then no term is measured."""


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """Models to compare, and how: see `harness.compare.match` and `excitation`.

    Attributes:
        include_constraints: whether contacts, joint limits, dry friction and couplings act.
        strict: whether real or possible differences that no run shows count as differences.
    """

    a: Candidate
    b: Candidate
    joints: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    starts: tuple[Mapping[str, float], ...] = ()
    resolution: float = 1e-9
    include_constraints: bool = False
    strict: bool = False


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Result of a comparison.

    Attributes:
        facts: of A and B, as loaded.
        own_files: each engine against the equations of its own file, which have no constraints.
        turned: joints of opposite direction in B; the terms exclude that effect.
        remaining: the discrepancy that remains after turning these.
        properties: differences between the files' contents.
        explained: the share of the discrepancy that follows from these; None if unknown.
        differing_terms: worst first; empty if nothing differs or the properties explain it.
        trials: of each difference of the files, and of all together; the largest effect first.
        untried: number of file differences that were not tried.
        untested: real or possible differences without effect on any run.
        impossible: messages about physically impossible inertias, without duplicates.
        notes: assumptions and omissions.
    """

    options: CompareOptions
    facts: tuple[Facts, Facts]
    own_files: tuple[OwnFile, OwnFile]
    match: Match
    recorded: Recorded
    judgement: Judgement
    turned: tuple[str, ...]
    remaining: float
    properties: tuple[ComparedProperty, ...]
    explained: Explained | None
    differing_terms: tuple[ComparedTerm, ...]
    trials: tuple[FileDifference, ...]
    untried: int
    untested: tuple[str, ...]
    impossible: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float


def compare(options: CompareOptions, execute: Execute) -> Findings:
    """Compare two models.

    Raises:
        CompareError: for joints without a match, with the remedy.
        FailureError: if an engine fails, with its output.
    """
    began = time.perf_counter()
    prepared = prepare(execute, options.a, options.b, options.joints, options.include_constraints)
    options = replace(options, a=prepared.a, b=prepared.b)
    a, b, matched = prepared.a, prepared.b, prepared.match
    is_a = matched.source == "A"
    source, target = (a, b) if is_a else (b, a)
    both = prepared.facts if is_a else prepared.facts[::-1]
    home, sampling_range, strangers, limits = start_range(*both, matched)
    task = SourceTask(
        candidate=source,
        match=matched,
        given=options.starts,
        resolution=options.resolution,
        home=home,
        sampling_range=sampling_range,
        taut=taut_starts(*both, matched, home, sampling_range, limits),
    )
    recorded = ask(execute, source, record, task)
    if not len(recorded.runs.z):
        lost = counted(recorded.lost, "run")
        reason = f"its motion is resolved in none of {lost} (contact, limit, friction)"
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
    read = compare_files(
        execute, prepared, home, _own_runs(recorded.runs, matched) if is_a else runs
    )
    turned, signs, remaining, final = _turned(trial, judgement, followed, read)
    mends = bool(turned) and remaining <= options.resolution
    share: Explained | None = None
    measured: tuple[ComparedTerm, ...] = ()
    is_explained = False
    if judgement.outcome is not Outcome.AGREES and not mends:
        if read.sides is not None:
            sides = read.sides if is_a else read.sides[::-1]
            share = explained(sides, matched, recorded, runs, final, signs)
        is_explained = read.moving and share is not None and share.share >= MIN_EXPLAINED_SHARE
        if not is_explained:
            count = len(recorded.independent) + 6 if share is None else KNOWN_FILE_STATES
            measured = _measure_terms(
                execute, (source, target), recorded, runs, matched, signs, count
            )
    attribution = attributed(execute, (a, b), recorded, runs, followed, matched, read.moving)
    return Findings(
        options=options,
        facts=prepared.facts,
        own_files=check_own_files(execute, (a, b), prepared.facts, options.resolution)
        if not options.include_constraints
        else (OwnFile(), OwnFile()),
        match=matched,
        recorded=recorded,
        judgement=judgement,
        turned=turned,
        remaining=remaining,
        properties=read.properties,
        explained=share,
        differing_terms=measured,
        trials=attribution.trials,
        untried=attribution.untried,
        untested=_untested(prepared, judgement, read, attribution),
        impossible=_impossible(prepared),
        notes=_notes(prepared, recorded, strangers),
        seconds=time.perf_counter() - began,
    )


def _impossible(prepared: PreparedComparison) -> tuple[str, ...]:
    """Return messages about impossible inertias of moving links."""
    robots = [own.robot for own in prepared.facts if own.robot is not None]
    messages = [
        str(one)
        for robot in robots
        for one in impossible_inertias(robot)
        if one.link not in {part.name for part in robot.parts if part.body == WORLD}
    ]
    return tuple(dict.fromkeys(messages))


def _untested(
    prepared: PreparedComparison,
    judgement: Judgement,
    read: FileComparison,
    attribution: Attribution,
) -> tuple[str, ...]:
    """Return real or possible differences that do not change the outcome."""
    agrees = judgement.outcome is Outcome.AGREES
    messages = [one.message for one in read.properties if agrees or not one.moves]
    messages += attribution.silent
    if attribution.untried:
        messages.append(f"{attribution.untried} differences of the files that were not tried alone")
    return (*dict.fromkeys(messages), *prepared.uncompared)


def _notes(
    prepared: PreparedComparison, recorded: Recorded, strangers: tuple[str, ...]
) -> tuple[str, ...]:
    """Return assumptions and actions, without duplicates."""
    notes = (
        *prepared.a.notes,
        *prepared.b.notes,
        *prepared.notes,
        *range_notes(strangers, prepared.match.source),
        *_lost(recorded, prepared.match),
    )
    return tuple(dict.fromkeys(notes))


def _lost(recorded: Recorded, matched: Match) -> tuple[str, ...]:
    """Return a note about states whose runs are left out."""
    if not recorded.lost:
        return ()
    return (
        f"{recorded.lost} of {counted(recorded.lost + len(recorded.runs.z), 'run')} left out: there"
        f" the motion of {matched.source} is not resolved (a contact, a limit, friction, or"
        " too quick)",
    )


def _own_runs(runs: Runs, matched: Match) -> Runs | None:
    """Return the source's runs with forces on its own coordinates; None if these vary."""
    if not matched.constant:
        return None
    return replace(runs, push=runs.push @ matched.slopes(runs.z[:1])[0])


@dataclass(frozen=True, kw_only=True)
class _Following:
    """Runs of the target from the source's states, optionally with reversed joints."""

    execute: Execute
    target: Candidate
    recorded: Recorded
    runs: Runs
    match: Match
    resolution: float

    def judged(self, signs: Array) -> tuple[TargetEnds, Judgement]:
        task = TargetTask(self.target, self.runs, self.resolution, signs)
        followed = ask(self.execute, self.target, follow, task)
        return followed, judge(self.recorded, followed, self.match, self.resolution)


def _turned(
    trial: _Following, judgement: Judgement, followed: TargetEnds, read: FileComparison
) -> tuple[tuple[str, ...], Array, float, TargetEnds]:
    """Return reversed joints, all signs, the remaining discrepancy, and the target's runs then.

    Use the axes where both files have them. Otherwise reverse joints one after the other while that
    removes most of the discrepancy.
    """
    names = trial.match.names
    signs = np.ones(len(names))
    remaining = float(np.max(judgement.by_component))
    if judgement.outcome is not Outcome.DIFFERS or remaining < MIN_REVERSED_DISCREPANCY:
        return (), signs, remaining, followed
    if read.sides is not None:
        turned = [i for i, name in enumerate(names) if name in read.turned]
        if not turned:
            return (), signs, remaining, followed
        signs[turned] = -1.0
        followed, judgement = trial.judged(signs)
        remaining = float(np.max(judgement.by_component))
        return tuple(names[i] for i in turned), signs, remaining, followed
    return _sought(trial, remaining, followed)


def _sought(
    trial: _Following, remaining: float, followed: TargetEnds
) -> tuple[tuple[str, ...], Array, float, TargetEnds]:
    names = trial.match.names
    signs = np.ones(len(names))
    turned: list[str] = []
    while len(turned) < len(names):
        sizes: dict[int, float] = {}
        runs: dict[int, TargetEnds] = {}
        for i in range(len(names)):
            if signs[i] > 0:
                guess = signs.copy()
                guess[i] = -1.0
                try:
                    runs[i], verdict = trial.judged(guess)
                except FailureError:
                    continue
                sizes[i] = float(np.max(verdict.by_component))
        best = min(sizes, key=lambda i: sizes[i], default=None)
        if best is None or sizes[best] > 0.1 * remaining:
            break
        # In a mechanism that is its own mirror image, several joints explain the difference alike.
        like = [i for i, size in sizes.items() if size <= max(1.5 * sizes[best], trial.resolution)]
        remaining, followed = sizes[best], runs[best]
        signs[best] = -1.0
        turned.append(" or ".join(names[i] for i in like))
    return tuple(turned), signs, remaining, followed


def _measure_terms(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    recorded: Recorded,
    runs: Runs,
    matched: Match,
    signs: Array,
    count: int,
) -> tuple[ComparedTerm, ...]:
    """Return the differing terms of source and target, measured at `count` states."""
    source, target = models
    going = np.flatnonzero(np.max(np.abs(runs.w), axis=1) > 0)
    if not len(going):
        return ()
    picked = going[even_indices(len(going), count)]
    task = partial(
        MechanicsTask,
        independent=recorded.independent,
        unit=recorded.unit,
        fastest=recorded.fastest,
        typical=recorded.typical,
    )
    recorded_runs = recorded.runs
    ones = np.ones(len(signs))
    measured_a = ask(
        execute,
        source,
        mechanics,
        task(
            candidate=source,
            match=matched,
            signs=ones,
            z=recorded_runs.z[picked],
            w=recorded_runs.w[picked],
        ),
    )
    measured_b = ask(
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
        measured_a, measured_b = measured_b, measured_a
    chosen = list(recorded.independent)
    frame = TermFrame(
        [matched.names[i] for i in chosen],
        runs.z[picked][:, chosen],
        recorded.unit[chosen],
        recorded.typical,
    )
    return differing_terms(measured_a, measured_b, frame)


def comparison_record(findings: Findings, created: datetime.datetime) -> Comparison:
    """Build the record of a comparison."""
    options, judged, recorded = findings.options, findings.judgement, findings.recorded
    return Comparison(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(
            _model(*model)
            for model in zip(
                (options.a, options.b), findings.facts, findings.own_files, strict=True
            )
        ),
        outcome=judged.outcome,
        strict=options.strict,
        reason=judged.reason,
        kind=judged.kind,
        found=Compared(
            discrepancy=number(judged.discrepancy),
            uncertainty=number(judged.uncertainty),
            component=judged.component,
            joints=tuple(findings.match.names),
            by_component=numbers(_by_component(judged)),
            map=tuple(findings.match.pairing),
            left_out=tuple(findings.match.left_out),
            states_of=findings.match.source,
            runs=ComparedRuns(
                count=len(recorded.runs.z),
                length=recorded.runs.length,
                driven=int(recorded.driven.sum()),
                lost=recorded.lost,
            ),
            turned=findings.turned,
            left_when_turned=number(findings.remaining) if findings.turned else None,
            properties=findings.properties,
            explained=None if findings.explained is None else number(findings.explained.share),
            off=_off(findings),
            terms=findings.differing_terms,
            differences=findings.trials,
            untried=findings.untried,
            untested=findings.untested,
            impossible=findings.impossible,
            notes=findings.notes,
            seconds=findings.seconds,
        ),
    )


def _by_component(judged: Judgement) -> list[float]:
    """Return the largest discrepancy of each component, or only of differing ones if any."""
    differs = judged.outcome is Outcome.DIFFERS
    shown = np.where(judged.certain | (not differs), judged.by_component, 0.0)
    return [float(one) for one in shown]


def failed_record(
    options: CompareOptions, failure: Failure, created: datetime.datetime
) -> Comparison:
    """Build the record of a comparison that could not run."""
    return Comparison(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(_model(candidate, None, OwnFile()) for candidate in (options.a, options.b)),
        outcome=Outcome.FAILED,
        strict=options.strict,
        reason=failure.reason,
        kind=failure.kind,
        stdout=failure.stdout,
    )


def _spelled(created: datetime.datetime) -> str:
    return created.isoformat(timespec="seconds")


def _model(candidate: Candidate, facts: Facts | None, own_file: OwnFile) -> ComparedModel:
    return ComparedModel(
        model=str(candidate.sidecar.model),
        engine=candidate.engine,
        version=engines()[candidate.engine].version(),
        notes=candidate.notes,
        coordinates=None if facts is None else facts.coordinates,
        integrator=None if facts is None else facts.integrator,
        step=None if facts is None else number(facts.step),
        gravity=None if facts is None else numbers(facts.gravity),
        case=own_file.case,
        diagnosis=own_file.diagnosis,
    )


def _off(findings: Findings) -> tuple[float | None, ...] | None:
    """Return the deviations from the equations, of A and of B."""
    if findings.explained is None:
        return None
    off = findings.explained.off
    return tuple(numbers(off if findings.match.source == "A" else off[::-1]))
