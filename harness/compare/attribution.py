"""Effect of each difference of the files on the motions, and of all differences together."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.compare.candidate import Candidate
from physics_crosscheck.harness.compare.diff import SourceEdit, edits
from physics_crosscheck.harness.compare.excitation import Recorded
from physics_crosscheck.harness.compare.execute import Execute, FailureError, ask
from physics_crosscheck.harness.compare.judge import TargetEnds
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.runs import Runs
from physics_crosscheck.harness.compare.trials import Trial, TrialTask, attribute_difference, tried
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.locations.outline import MARKUP, outline
from physics_crosscheck.harness.numerics.batch import even_indices

MAX_SINGLE_TRIALS = 24
"""Maximum number of differences tried one by one, largest first; the rest is only counted."""

TRIAL_RUNS = 32
"""Runs on which differences are tried."""

SMOOTH_UNCERTAINTY = 1e-9
"""Relative uncertainty of end states below which runs are preferred."""

Attribution = tuple[tuple[Trial, ...], int]
"""Trials, and the number of differences not tried alone."""


def attributed(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    recorded: Recorded,
    runs: Runs,
    followed: TargetEnds,
    matched: Match,
    is_known: bool,
) -> Attribution:
    """Apply the differences of the files to copies of A, one by one and together.

    Args:
        execute: runs the engines.
        models: A and B.
        recorded: runs of the source.
        runs: the same in the target's coordinates.
        followed: the target's end states.
        matched: the coordinates.
        is_known: whether bodies or joints are known to differ; then many differences are not tried
            one by one.

    Raises:
        FailureError: if a file cannot be read, or an engine fails with the unchanged files.
    """
    try:
        differences = edits(*models)
    except LocationError as error:
        raise FailureError(Failure(str(error), "")) from None
    can = [edit for edit in differences if edit.changes or edit.settings]
    rest = [
        Trial((edit,), 0.0, 0.0, "it can't be tried alone")
        for edit in differences
        if not edit.changes and not edit.settings
    ]
    if not can:
        return tuple(rest), 0
    bench = _Bench.prepare(execute, models, recorded, runs, followed, matched, len(can))
    engine = engines()[models[0].engine]
    looks = [re.compile(pattern) for pattern in engine.non_physical]
    root = _root(models[0].sidecar.model)
    ineffective = [edit for edit in can if _is_ineffective(edit, root, looks)]
    others = sorted((edit for edit in can if edit not in ineffective), key=_size, reverse=True)
    idle_limit = (
        0 if is_known and len(others) + len(ineffective) > MAX_SINGLE_TRIALS else MAX_SINGLE_TRIALS
    )
    trials = bench.try_ineffective(ineffective, idle_limit)
    single_limit = 0 if is_known and len(others) > MAX_SINGLE_TRIALS else MAX_SINGLE_TRIALS
    sets: list[tuple[SourceEdit, ...]] = [(edit,) for edit in others[:single_limit]]
    untried = len(can) - len(trials) - len(sets)
    if len(can) > 1:
        sets.append(tuple(can))
    trials += [*bench.tried(sets), *rest]
    # Round to six digits, so that last digits do not change the order of like trials.
    trials.sort(key=lambda one: (-round(one.explained, 6), -float(f"{one.moved:.5e}"),
                                 len(one.edits)))  # fmt: skip
    return tuple(trials), untried


def untested(trials: Iterable[Trial], a: Candidate) -> tuple[str, ...]:
    """Return the file differences without effect on any run, except visual ones and time steps."""
    engine, root = engines()[a.engine], _root(a.sidecar.model)
    looks = [re.compile(one) for one, what in engine.non_physical.items() if what in NO_PHYSICS]
    silent = (one for one in trials if len(one.edits) == 1 and (one.not_tried or not one.moved))
    edits = (one.edits[0] for one in silent)
    return tuple(
        f"{edit.label}: {edit.old} in A, {edit.new} in B"
        for edit in edits
        if not _is_ineffective(edit, root, looks) and not edit.label.startswith(SETTINGS)
    )


NO_PHYSICS = ("looks", "step and solver")
"""Categories of numbers without physical effect."""

SETTINGS = ("sidecar:settings.step", "sidecar:settings.integrator", "option@integrator")


def _root(file: Path) -> str:
    """Return the tag of an XML file's root element, or "" for other files."""
    return outline(file, file.read_bytes()).tag if file.suffix in MARKUP else ""


def _is_ineffective(edit: SourceEdit, root: str, looks: Iterable[re.Pattern[str]]) -> bool:
    """Return whether a difference probably affects no motion, such as a shape; it is tried anyway.

    A whole element counts like its numbers.
    """
    tags = re.sub(r"\[[^\]]*\]", "", edit.label)
    paths = (f"{root}/{tags}", f"{root}/{tags.replace('@', '/')}/")
    return bool(edit.changes) and any(one.fullmatch(path) for one in looks for path in paths)


def _actuation(candidate: Candidate) -> dict[str, list[float]]:
    """Return the settings that hold a model's actuators in the comparison."""
    spec = candidate.sidecar.spec(candidate.engine)
    given = candidate.given & {"controls", "activations"}
    return {key: list(spec.settings[key]) for key in given}  # type: ignore[call-overload]


def _size(edit: SourceEdit) -> float:
    """Return the relative change of a number, or 1 for anything else."""
    try:
        old, new = float(edit.old), float(edit.new)
    except ValueError:
        return 1.0
    large = max(abs(old), abs(new))
    return abs(old - new) / large if large and np.isfinite(large) else 1.0


@dataclass(frozen=True, kw_only=True)
class _Bench:
    """Setup for trials: end states of A and B, unmodified.

    Attributes:
        task: the part common to all trials.
        a, b: end states, (K, 2m).
        scale: how far each component moves, (2m,).
        floor: relative size below which nothing is certain.
        count: number of differences that can be applied.
    """

    execute: Execute
    task: TrialTask
    a: Array
    b: Array
    scale: Array
    floor: float
    count: int

    @staticmethod
    def prepare(
        execute: Execute,
        models: tuple[Candidate, Candidate],
        recorded: Recorded,
        runs: Runs,
        followed: TargetEnds,
        matched: Match,
        count: int,
    ) -> _Bench:
        """Run both models, unmodified, on some of the runs."""
        doubt = (recorded.uncertainty + followed.limit.uncertainty) / recorded.scale
        # Elsewhere than in smooth runs nothing is certain.
        smooth = np.flatnonzero(np.max(doubt, axis=1) <= SMOOTH_UNCERTAINTY)
        smooth = smooth if len(smooth) else np.arange(len(doubt))
        some = smooth[even_indices(len(smooth), TRIAL_RUNS)]

        def task(candidate: Candidate, source: bool) -> TrialTask:
            source_runs = recorded.runs if source else runs
            part = Runs(
                length=source_runs.length,
                z=source_runs.z[some],
                w=source_runs.w[some],
                push=source_runs.push[some],
            )
            return TrialTask(
                candidate=candidate,
                edits=(),
                runs=part,
                match=matched if source else None,
                joints=source_runs.z.shape[1],
                near=recorded.end[some],
                periodic=matched.periodic,
                other=_actuation(models[1]),
            )

        is_source = matched.source == "A"
        of_a, of_b = task(models[0], is_source), task(models[1], not is_source)
        relevant = doubt[some]
        return _Bench(
            execute=execute,
            task=of_a,
            a=ask(execute, models[0], tried, of_a),
            b=ask(execute, models[1], tried, of_b),
            scale=recorded.scale,
            count=count,
            floor=2 * float(np.max(relevant[np.isfinite(relevant)], initial=1e-13)),
        )

    def tried(self, sets: Sequence[tuple[SourceEdit, ...]]) -> list[Trial]:
        """Apply each set of differences at once."""
        tasks = [replace(self.task, edits=made, whole=len(made) == self.count) for made in sets]
        values = self.execute(self.task.candidate.name, tried, tasks)
        return [
            Trial(made, 0.0, 0.0, value.reason)
            if isinstance(value, Failure)
            else attribute_difference(made, value, self.a, self.b, self.scale, self.floor)
            for made, value in zip(sets, values, strict=True)
        ]

    def try_ineffective(self, group: Sequence[SourceEdit], limit: int) -> list[Trial]:
        """Try probably ineffective differences at once; try some singly if there is an effect.

        Args:
            group: the differences.
            limit: maximum number tried singly.
        """
        if len(group) > 1:
            (together,) = self.tried([tuple(group)])
            if not together.not_tried and together.moved == 0.0:
                return [Trial((edit,), 0.0, 0.0) for edit in group]
        return self.tried([(edit,) for edit in group[:limit]])
