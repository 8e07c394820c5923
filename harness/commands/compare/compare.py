"""`crosscheck compare`: from two files to one outcome and their differences.

    prepare ─> states (source) ─> run both ─> judge ─> differences of the files ─> explained
                                                    ├> each engine and its own file
                                                    ├> terms of both, if nothing else explains it
                                                    └> edits ─> trials (literals)

Each engine runs in a worker process, so that a crash only ends the comparison.

The statement of each engine about its own file: against the file's equations, as `run` does.
"""

from __future__ import annotations

import contextlib
import datetime
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.documents.expanded import relocated, with_sources
from physics_crosscheck.harness.documents.reading import FLOAT_DIGITS, USD_SUFFIXES
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.harness.records.base import SourceLine, number, numbers
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedActing,
    ComparedModel,
    ComparedProperty,
    ComparedRuns,
    ComparedTerm,
    ComparisonResult,
)
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.scene import Scene
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.tree import WORLD
from physics_crosscheck.reference.solving.segments import Segments
from .acting import compare_acting
from .attribution import Attribution, attributed
from .candidate import Candidate, CompareError, Facts, FailureError, ask, ask_each, fallbacks
from .judge import Judgement, Recorded, explained, judge, judged_by_equations, recorded_runs
from .laws import compare_laws
from .match import Match, pairs_of
from .prepared import PreparedComparison, omission_notes, prepare
from .properties import FileComparison, compare_files
from .segments import Ends, own_forces, run_source, run_target
from .side import ModelSide, make_property, side_scene
from .states import StartRange, range_notes, sampled_states, start_range
from .terms import measured_terms

OwnFile = tuple[Case | None, Diagnosis | None]
"""The verdict on an engine against the equations of its file, and the causes of a difference."""

UNCHECKED: OwnFile = (None, None)
"""An engine that has no equations, or a file with a sidecar."""


def check_own_files(
    executor: Executor,
    models: tuple[Facts, Facts],
    resolution: float,
) -> tuple[OwnFile, OwnFile]:
    """Judge and diagnose both engines, each against its own file.

    A file with a sidecar has none: its settings and springs are not in the file's equations.
    """
    prepared: dict[object, PreparedTree] = {}
    checked: dict[object, OwnFile] = {}
    keys = []
    for model_facts in models:
        model = model_facts.candidate
        settings = model.settings
        floating = bool(settings.get("floating", False))
        place = model.sidecar.model, floating, str(settings.get("model", ""))
        keys.append((*place, model.engine))
        robot = model_facts.robot
        if not model.bare or robot is None or robot.tree is None or keys[-1] in checked:
            continue
        if place not in prepared:
            read = partial(prepare_tree, floating=floating, model=place[-1])
            (target,) = ask_each(executor, model, read, [model.sidecar.model])
            if isinstance(target, Failure):
                continue  # no joint moves, or one moves no mass; the comparison reports it
            prepared[place] = target
        checked[keys[-1]] = _check(executor, model, prepared[place], resolution)
    a, b = (checked.get(key, UNCHECKED) for key in keys)
    return a, b


def _check(
    executor: Executor, model: Candidate, target: PreparedTree, resolution: float
) -> OwnFile:
    task = model_task(target, model.engine, resolution=resolution)
    (case,) = ask_each(executor, model, run_case, [task])
    if isinstance(case, Failure):
        return failed_case(task.id, str(task.file), case), None
    if case.outcome is not Outcome.DIFFERS:
        return case, None
    diagnose = partial(diagnose_robot, is_reference=True)
    (causes,) = ask_each(executor, model, diagnose, [task])
    diagnosis = Diagnosis(failure=causes.reason) if isinstance(causes, Failure) else causes
    return case, diagnosis


MIN_REVERSED_DISCREPANCY = 1e-4
"""Minimum discrepancy at which joints of opposite direction are sought."""

MIN_EXPLAINED_SHARE = 0.99
"""Share of a discrepancy above which both files' equations explain it; then no term is measured."""

LIMIT_MARGIN = 0.1
"""Share of a joint's range near its limits where no run starts if the limits act."""


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """Models to compare, and how: see `harness.commands.compare.match` and `states`.

    Attributes:
        include_constraints: whether contacts, joint limits, dry friction and couplings act.
        strict: whether real or possible differences that no run shows count as differences.
        pictured: whether the result has the scenes of both models.
    """

    a: Candidate
    b: Candidate
    joints: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    starts: tuple[Mapping[str, float], ...] = ()
    resolution: float = 1e-9
    include_constraints: bool = False
    strict: bool = False
    pictured: bool = False


def compare(
    options: CompareOptions, executor: Executor, created: datetime.datetime | None = None
) -> ComparisonResult:
    """Compare two models.

    Raises:
        CompareError: for joints without a match, with the remedy.
        FailureError: if an engine fails, with its output.
    """
    began = time.perf_counter()
    prepared = _prepared(executor, options)
    motions = _motions(executor, options, prepared)
    own_files = (UNCHECKED, UNCHECKED)
    if not options.include_constraints:
        own_files = check_own_files(executor, prepared.facts, options.resolution)
    share, measured = _causes(executor, prepared, motions, own_files, options.resolution)
    attribution = attributed(
        executor, prepared, motions.recorded, motions.followed, motions.files.moving
    )
    judged = motions.judgement
    laws = _laws(executor, prepared)
    compared = structs.replace(
        _compared(prepared, motions, share, measured, attribution, laws),
        acting=_acting(executor, prepared),
        scenes=_scenes(executor, motions.files.sides) if options.pictured else (),
        seconds=time.perf_counter() - began,
    )
    unknown = unknown_edits(prepared, motions.files, compared, attribution)
    compared, outcome, reason = _decided(options, prepared, motions, compared, unknown)
    result = ComparisonResult(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(map(_model, prepared.models, prepared.facts, own_files)),
        outcome=outcome,
        strict=options.strict,
        reason=reason,
        kind=judged.verdict.kind if outcome is judged.outcome else "",
        compared=compared,
    )
    return with_sources(relocated(result, SourceLine))


def _prepared(executor: Executor, options: CompareOptions) -> PreparedComparison:
    """Load both models; in the next engine that both share, if the first one can't load them."""
    try:
        return prepare(executor, options.a, options.b, options.joints, options.include_constraints)
    except FailureError:
        for a, b in fallbacks(options.a, options.b):
            with contextlib.suppress(FailureError, CompareError):
                return prepare(executor, a, b, options.joints, options.include_constraints)
        raise


def _decided(
    options: CompareOptions,
    prepared: PreparedComparison,
    motions: _Motions,
    compared: Compared,
    unknown: Sequence[ComparedProperty],
) -> tuple[Compared, Outcome, str]:
    outcome, reason = motions.judgement.outcome, motions.judgement.verdict.reason
    if outcome is Outcome.UNRESOLVED and is_same_model(*prepared.models):
        return compared, Outcome.AGREES, ""
    rows = deciding(compared, options.resolution, unknown)
    every = list(dict.fromkeys([*(row for row in compared.properties if row.moves), *rows]))
    if any(one.sidecar.model.suffix in USD_SUFFIXES for one in prepared.models):
        rounded = [
            row for row in every if row.relative is not None and row.relative <= FLOAT_DIGITS
        ]
    else:
        digits = _written_digits(prepared)
        rounded = [row for row in every if is_rounding(row, *digits)]
    rows = [row for row in rows if row not in rounded]
    largest = max((row.relative or 0.0 for row in rounded), default=0.0)
    moving = [row for row in every if row.moves]
    explains = not moving or (compared.explained or 0.0) >= MIN_EXPLAINED_SHARE
    if outcome is Outcome.DIFFERS and moving and explains and not compared.turned:
        outcome = Outcome.AGREES if all(row in rounded for row in moving) else outcome
    if outcome is Outcome.AGREES and rows:
        return structs.replace(compared, decisive=rows[0]), Outcome.DIFFERS, rows[0].message
    if outcome is Outcome.AGREES:
        return structs.replace(compared, rounding=number(largest) or None), outcome, ""
    return compared, outcome, reason


def is_same_model(a: Candidate, b: Candidate) -> bool:
    """Return whether two models are the same files in one engine with equal settings."""
    files = [list(part_digests(one.sidecar.model).values()) for one in (a, b)]
    return a.engine == b.engine and a.settings == b.settings and files[0] == files[1]


def is_rounding(row: ComparedProperty, digits: int, copied: int) -> bool:
    """Return whether a difference may be rounding by a writer.

    Args:
        row: the difference.
        digits: of numbers that the writer computed; 0 for no writer.
        copied: digits of numbers that it copied, at least.
    """
    if row.a is None or row.b is None:
        return bool(digits) and 0.0 < (row.relative or 0.0) <= 5.0 * 10.0**-digits
    is_float = digits == FLOAT_PRECISION and np.float32(row.a) == np.float32(row.b)
    return row.a != row.b and (is_float or any(
        math.isclose(float(f"{x:.{n}g}"), y, rel_tol=STILL)
        for x, y in ((row.a, row.b), (row.b, row.a)) for n in WRITTEN_DIGITS if n >= copied
    ))  # fmt: skip


WRITTEN_DIGITS = range(6, 10)
"""Digits of writers whose rounding is ignored."""

FLOAT_PRECISION = 7
"""Digits of numbers of 32 bits."""


def deciding(
    compared: Compared, resolution: float, unknown: Sequence[ComparedProperty]
) -> list[ComparedProperty]:
    """Return the differences that motions leave out and that decide: laws, files, then texts.

    A number of the laws without an effect does not decide if it acts at a state that was tried.
    """
    laws = [row for row in compared.laws or () if row.effect is None or row.effect > resolution]
    stated = [
        one
        for one in compared.properties
        if not (one.moves and (one.kind not in PLACES or one.effect is None or one.effect > STILL))
        and (one.relative is None or one.relative > resolution)
    ]
    weighed_rows = [row for row in laws if row.effect is not None]
    rest = [row for row in laws if row.effect is None]
    return [*weighed_rows, *stated, *rest, *unknown]


STILL = 1e-12
"""Largest effect on motions that is rounding."""


PLACES = ("anchor", "axis")
"""Kinds of differences of places of joints; if no motion shows one, contacts and poses may."""

_NUMBERS = re.compile(rb"(?<![\w.])[-+]?0*\.?0*([1-9][\d.]*)(?:[eE][-+]?\d+)?(?![\w.])")


def _written_digits(prepared: PreparedComparison) -> tuple[int, int]:
    """Return the digits of the shortest file, from six on, and of its copied numbers."""
    least = []
    files = [model.sidecar.model for model in prepared.models]
    for file in files:
        matches = _NUMBERS.finditer(file.read_bytes())
        digits = {one[0]: len(one[1].replace(b".", b"").rstrip(b"0")) for one in matches}
        longer = [float(text) for text, count in digits.items() if count > FLOAT_PRECISION]
        with np.errstate(over="ignore"):
            floats = np.array(longer, dtype=np.float32)
        is_float = bool(longer) and np.allclose(floats, longer, 1e-8, 0.0)
        least.append(FLOAT_PRECISION if is_float else max(digits.values(), default=0))
    written = min((one for one in least if one in WRITTEN_DIGITS), default=0)
    return written, 0 if files[0].suffix != files[1].suffix else written or 99


UNCOMPARED = {
    ".urdf": r"(?!link$|link/(name|inertial|visual|collision)|joint$|joint/(name|type|origin|axis"
             r"|limit|dynamics|mimic|parent|child|calibration)|material|name|version"
             r"|gazebo/(material|visual)).*",
    ".sdf": r".*(surface|/plugin|velocity_decay|kinematic|enable_wind|stiffness|dissipation|screw"
            r"|self_collide|physics|static|ode).*",
    ".xml": r"(extension|deformable).*|.*plugin.*",
}  # fmt: skip
"""Parts of files that nothing compares but their text, by format: a pattern of the tags."""

NONE = {"nothing": "none"}
"""Words of edits, and those of properties."""


def unknown_edits(
    prepared: PreparedComparison,
    files: FileComparison,
    compared: Compared,
    attribution: Attribution,
) -> list[ComparedProperty]:
    """Return differences of the texts that no motion shows and that nothing else compares."""
    suffix = prepared.models[0].sidecar.model.suffix
    pattern = UNCOMPARED.get(suffix, ".*") if files.sides is not None else ".*"
    shared = prepared.models[0].engine == prepared.models[1].engine
    pattern = f"{pattern}|sidecar:.*" if shared else f"(?!sidecar:)({pattern})"
    lines = {str(where) for row in compared.laws or () for where in (row.where_a, row.where_b)}
    return [
        structs.replace(
            make_property(
                "text", edit.what,
                f"{edit.what}: {NONE.get(edit.a, edit.a)} in A, {NONE.get(edit.b, edit.b)} in B;"
                " effect unknown",
                lines=(edit.where_a, edit.where_b), moves=False,
            )[0],
            effect=None,
        )
        for edit in attribution.silent
        if re.fullmatch(pattern, re.sub(r"\[[^\]]*\]", "", edit.what).replace("@", "/"))
        and not {str(edit.where_a), str(edit.where_b)} & lines
    ]  # fmt: skip


def _laws(executor: Executor, prepared: PreparedComparison) -> tuple[ComparedProperty, ...] | None:
    source = prepared.source_first(prepared.facts)[0]
    read = partial(compare_laws, pairs=pairs_of(prepared.match, source.coordinates))
    (rows,) = ask_each(executor, prepared.models[0], read, [prepared.facts])
    return None if isinstance(rows, Failure) else rows


def _acting(executor: Executor, prepared: PreparedComparison) -> tuple[ComparedActing, ...]:
    (rows,) = ask_each(executor, prepared.models[0], compare_acting, [prepared.facts])
    return () if isinstance(rows, Failure) else rows


def _scenes(executor: Executor, sides: tuple[ModelSide, ModelSide] | None) -> tuple[Scene, ...]:
    scenes = ask_each(executor, sides[0].facts.candidate, side_scene, sides) if sides else []
    return tuple(one for one in scenes if not isinstance(one, Failure))


def failed_comparison(
    options: CompareOptions, failure: Failure, created: datetime.datetime | None = None
) -> ComparisonResult:
    """Return the record of a comparison that could not run."""
    return ComparisonResult(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(_model(one, None, UNCHECKED) for one in (options.a, options.b)),
        outcome=Outcome.FAILED,
        strict=options.strict,
        reason=failure.reason,
        kind=failure.kind,
        stdout=failure.stdout,
    )


def _spelled(created: datetime.datetime | None) -> str:
    return (created or datetime.datetime.now(datetime.UTC)).isoformat(timespec="seconds")


@dataclass(frozen=True, kw_only=True)
class _Turned:
    """Joints of opposite direction in B, and the target's motion without that effect."""

    names: tuple[str, ...] = ()
    signs: Array
    judgement: Judgement
    followed: Ends

    @property
    def remaining(self) -> float:
        """The largest discrepancy."""
        return self.judgement.largest


@dataclass(frozen=True, kw_only=True)
class _Motions:
    """Motions of both models from the same states, and what their files state."""

    start: StartRange
    recorded: Recorded
    followed: Ends
    judgement: Judgement
    files: FileComparison
    turned: _Turned


def _motions(executor: Executor, options: CompareOptions, prepared: PreparedComparison) -> _Motions:
    match = prepared.match
    start = start_range(*prepared.source_first(prepared.facts), match)
    recorded = _recorded(executor, options, prepared, start)
    judged = partial(_judged, executor, prepared, recorded, options.resolution)
    plain = judged(np.ones(len(match.names)))
    files = compare_files(executor, prepared, start.home, _runs_of_a(recorded, match))
    files = replace(files, properties=(*prepared.locked, *files.properties))
    judgement = plain.judgement
    agrees_coarsely = (
        judgement.outcome is Outcome.AGREES and judgement.verdict.resolution > options.resolution
    )
    if (judgement.outcome is Outcome.UNRESOLVED or agrees_coarsely) and files.sides is not None:
        sides = prepared.source_first(files.sides)
        judgement = judged_by_equations(sides, match, recorded, judgement, options.resolution)
    turned = plain = replace(plain, judgement=judgement)
    if judgement.outcome is Outcome.DIFFERS and plain.remaining >= MIN_REVERSED_DISCREPANCY:
        names = tuple(name for name in match.names if name in files.turned)
        if files.sides is None:
            turned = _sought(judged, match.names, options.resolution, plain)
        elif names:
            signs = np.where([name in names for name in match.names], -1.0, 1.0)
            turned = replace(judged(signs), names=names)
    return _Motions(
        start=start,
        recorded=recorded,
        followed=plain.followed,
        judgement=judgement,
        files=files,
        turned=turned,
    )


def _recorded(
    executor: Executor, options: CompareOptions, prepared: PreparedComparison, start: StartRange
) -> Recorded:
    """Run the source from states of its own.

    Raises:
        FailureError: if no run is resolved.
    """
    if options.include_constraints:
        width = np.where(np.isinf(start.limits).any(axis=1), 0.0, np.ptp(start.limits, axis=1))
        start = replace(start, limits=start.limits + LIMIT_MARGIN * np.outer(width, [1.0, -1.0]))
    (facts, _), match = prepared.source_first(prepared.facts), prepared.match
    source = facts.candidate
    sample = partial(sampled_states, match=match, start=start, given=options.starts)
    states = ask(executor, source, sample, facts)
    run = partial(run_source, runs=states.runs, match=match, resolution=options.resolution)
    ran = ask(executor, source, run, source)
    recorded = recorded_runs(states, ran, match, options.resolution)
    if not len(recorded.bound) and all(one.whole_tree for one in prepared.facts):
        return recorded_runs(states, ran, match, np.inf)  # the equations of both files decide
    if not len(recorded.bound):
        lost = counted(recorded.lost, "run")
        reason = f"its motion is resolved in none of {lost} (contact, limit, friction)"
        raise FailureError(Failure(f"{source.name}: {reason}", ""))
    return recorded


def _runs_of_a(recorded: Recorded, match: Match) -> Segments | None:
    """Return A's runs with forces on its own coordinates; None if these vary."""
    if match.source == "B":
        return recorded.compared
    return own_forces(recorded.runs, match) if match.constant else None


def _judged(
    executor: Executor,
    prepared: PreparedComparison,
    recorded: Recorded,
    resolution: float,
    signs: Array,
) -> _Turned:
    target = prepared.source_first(prepared.models)[1]
    run = partial(run_target, runs=recorded.compared, signs=signs, resolution=resolution)
    followed = ask(executor, target, run, target)
    judgement = judge(recorded, followed, prepared.match, resolution)
    return _Turned(signs=signs, judgement=judgement, followed=followed)


def _sought(
    judged: Callable[[Array], _Turned], names: Sequence[str], resolution: float, best: _Turned
) -> _Turned:
    """Reverse one joint after the other while that removes most of the discrepancy."""
    while True:
        tried: dict[int, _Turned] = {}
        for i in np.flatnonzero(best.signs > 0).tolist():
            signs = best.signs.copy()
            signs[i] = -1.0
            with contextlib.suppress(FailureError):
                tried[i] = judged(signs)
        nearest = min(tried.values(), key=lambda one: one.remaining, default=best)
        if not tried or nearest.remaining > 0.1 * best.remaining:
            return best
        # In a mechanism that is its own mirror image, several joints explain the difference alike.
        largest = max(1.5 * nearest.remaining, resolution)
        alike = " or ".join(names[i] for i, one in tried.items() if one.remaining <= largest)
        best = replace(nearest, names=(*best.names, alike))


_Share = tuple[float, tuple[float, float]]
"""Share of a discrepancy, and two deviations, as `explained` returns them."""


def _causes(
    executor: Executor,
    prepared: PreparedComparison,
    motions: _Motions,
    own_files: tuple[OwnFile, OwnFile],
    resolution: float,
) -> tuple[_Share | None, tuple[ComparedTerm, ...]]:
    """Return what the files explain of a difference, and measured terms if nothing explains it."""
    turned, files = motions.turned, motions.files
    is_mapped = bool(turned.names) and turned.remaining <= resolution
    if motions.judgement.outcome is Outcome.AGREES or is_mapped:
        return None, ()
    share: _Share | None = None
    if files.sides is not None:
        sides = prepared.source_first(files.sides)
        share = explained(sides, prepared.match, motions.recorded, turned.followed, turned.signs)
        if files.moving and motions.judgement.by_equations:
            share = 1.0, share[1] if share else (np.nan, np.nan)  # the engines' digits don't count
    by_files = files.moving and share is not None and share[0] >= MIN_EXPLAINED_SHARE
    if by_files or any(cause is not None and cause.explained for _, cause in own_files):
        return share, ()
    return share, measured_terms(executor, prepared, motions.recorded, turned.signs)


def _compared(
    prepared: PreparedComparison,
    motions: _Motions,
    share: _Share | None,
    measured: tuple[ComparedTerm, ...],
    attribution: Attribution,
    laws: tuple[ComparedProperty, ...] | None,
) -> Compared:
    judged, recorded, match = motions.judgement, motions.recorded, prepared.match
    turned, files = motions.turned, without_laws(motions.files, laws)
    shown = judged.certain | (judged.outcome is not Outcome.DIFFERS)
    return Compared(
        discrepancy=number(judged.verdict.discrepancy),
        uncertainty=number(judged.verdict.uncertainty),
        component=judged.verdict.component,
        joints=match.names,
        by_component=tuple(numbers(np.where(shown, judged.by_component, 0.0).tolist())),
        map=match.pairing,
        left_out=match.left_out,
        states_of=match.source,
        runs=ComparedRuns(
            count=len(recorded.bound),
            length=recorded.runs.length,
            driven=int(recorded.runs.start_inputs.any(axis=1).sum()),
            lost=recorded.lost,
        ),
        turned=turned.names,
        left_when_turned=number(turned.remaining) if turned.names else None,
        properties=files.properties,
        explained=None if share is None else number(share[0]),
        off=None if share is None else tuple(numbers(prepared.source_first(share[1]))),
        terms=measured,
        differences=attribution.trials,
        untried=attribution.untried,
        untested=_untested(prepared, judged, files, attribution, laws),
        impossible=_impossible(prepared),
        notes=_notes(prepared, recorded, motions.start, by_law=laws is not None),
        laws=laws,
        seconds=0.0,
    )


LIMITED = ("control range of", "state range of", "force range of")
"""Start of differences of actuators that laws compare."""

SAME_NUMBERS = {
    "range": ("range",),
    "friction": ("frictionloss",),
    "effort": ("effort", "forcerange", "actuatorfrcrange"),
    "option": ("cone", "impratio", "refsafe"),
    "coupling": ("polycoef",),
}
"""Labels of the numbers of laws that a kind of property states too."""


def without_laws(
    files: FileComparison, laws: tuple[ComparedProperty, ...] | None
) -> FileComparison:
    """Return the comparison of files without the differences that laws state."""
    if laws is None:
        return files
    stated = {(row.message.split("[")[0].split(" ")[0], row.about) for row in laws}

    def is_stated(row: ComparedProperty) -> bool:
        about = {row.about, f"joint {row.about}"} | {x for _, x in stated if x.startswith("equal")}
        labels = SAME_NUMBERS.get(row.kind, ())
        alike = any((label, name) in stated for label in labels for name in about)
        options = {label for label, name in stated if name == "options"}
        return (
            alike or row.message.startswith(LIMITED) or row.about.removeprefix("flag ") in options
        )

    rest = tuple(one for one in files.properties if one.moves or not is_stated(one))
    return replace(files, properties=rest)


def _impossible(prepared: PreparedComparison) -> tuple[str, ...]:
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
    files: FileComparison,
    attribution: Attribution,
    laws: tuple[ComparedProperty, ...] | None,
) -> tuple[str, ...]:
    agrees = judgement.outcome is Outcome.AGREES
    messages = [one.message for one in files.properties if agrees or not one.moves]
    messages += [one.message for one in laws or () if agrees or not one.effect]
    messages += [f"{e.what}: {e.a} in A, {e.b} in B" for e in attribution.silent]
    if attribution.untried:
        messages.append(f"{attribution.untried} differences of the files that were not tried alone")
    return (*dict.fromkeys(messages), *prepared.uncompared)


def _notes(
    prepared: PreparedComparison, recorded: Recorded, start: StartRange, *, by_law: bool
) -> tuple[str, ...]:
    source, lost = prepared.match.source, recorded.lost
    notes = [note for one in prepared.models for note in one.notes]
    notes += [*omission_notes(prepared, by_law=by_law), *prepared.notes]
    notes += range_notes(start.strangers, source)
    if lost:
        every = counted(lost + len(recorded.bound), "run")
        notes.append(
            f"{lost} of {every} left out: there the motion of {source} is not resolved (a contact,"
            " a limit, friction, or too quick)"
        )
    return tuple(dict.fromkeys(notes))


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
        case=own_file[0],
        diagnosis=own_file[1],
    )
