"""Verdict from the end states of both models' runs, and effects of differences by equations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from physics_crosscheck.harness.checks import verdict as verdicts
from physics_crosscheck.harness.checks.verdict import CaseJudgement
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics.ladder import EPSILON, movement
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.harness.records.outcome import Outcome, differs
from physics_crosscheck.reference.solving.segments import Segments, even_indices
from .match import Match
from .segments import SOURCE_SHARE, Ends, own_forces, reversed_segments, unwrapped
from .side import Difference, FileEquations, ModelSide
from .states import SampledStates

EQUAL_TOLERANCE = 1e-6
"""Relative tolerance for equal differences, such as those of identical legs."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Runs of the source that are resolved, with their end states.

    Attributes:
        states: all sampled states, and the scales of the motions.
        runs: K runs, in the source's coordinates, with forces on those of the comparison.
        compared: the same in the coordinates of the comparison, with their ends and scale.
        ends: of all runs of the source.
        bound: uncertainty of the ends, (K, 2m).
        lost: number of runs left out because the source's motion is not smooth there.
    """

    states: SampledStates
    runs: Segments
    compared: Segments
    ends: Ends
    bound: Array
    lost: int

    @property
    def is_smooth(self) -> bool:
        """True if most runs of the source are resolved."""
        return self.lost <= len(self.bound)


def recorded_runs(states: SampledStates, ends: Ends, match: Match, resolution: float) -> Recorded:
    """Return the resolved runs of the source."""
    start = match.convert(states.runs.start)
    end = unwrapped(ends.value, start, match.periodic)
    finite = np.isfinite(ends.uncertainty).all(axis=1)
    moved = movement(end[finite], start[finite])
    kept = _resolved(np.max(ends.uncertainty / moved, axis=1), resolution)
    runs = replace(states.runs, lengths=np.full(len(start), ends.length)).pick(kept)
    scale = movement(end[kept], start[kept])
    return Recorded(
        states=states,
        runs=runs,
        compared=replace(
            runs, start=start[kept], end=end[kept], scale=scale, fastest=states.fastest
        ),
        ends=ends,
        bound=np.maximum(ends.uncertainty[kept], 16 * EPSILON * scale),
        lost=len(start) - len(kept),
    )


def _resolved(uncertainty: Array, resolution: float) -> NDArray[np.intp]:
    """Return which runs of K are resolved, given relative uncertainties (K,).

    The target adds about the same uncertainty. Where most runs leave room for it, return only
    those.
    """
    (clear,) = np.nonzero(uncertainty <= SOURCE_SHARE * resolution)
    if 2 * len(clear) >= len(uncertainty):
        return clear
    return np.flatnonzero(uncertainty <= resolution)


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Verdict of a comparison.

    Attributes:
        verdict: of the target against the source.
        by_component: the largest difference of each component, relative, (2m,).
        certain: which of these exceed their uncertainty in some run, (2m,).
        by_equations: whether the equations of both files decide, without an engine.
    """

    verdict: CaseJudgement
    by_component: Array
    certain: NDArray[np.bool_]
    by_equations: bool = False

    @property
    def outcome(self) -> Outcome:
        """The outcome."""
        return self.verdict.outcome

    @property
    def largest(self) -> float:
        """The largest difference of any component."""
        return float(np.max(self.by_component))


def judge(recorded: Recorded, followed: Ends, match: Match, resolution: float) -> Judgement:
    """Judge the target by the rule of verdicts, with the runs of the source as reference."""
    compared = recorded.compared
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    limit = replace(
        followed.limit,
        value=unwrapped(followed.value, compared.end, match.periodic),
        converges=followed.limit.converges and followed.mostly_limited and recorded.is_smooth,
        order_confirmed=followed.limit.order_confirmed and recorded.ends.limit.order_confirmed,
    )
    verdict = verdicts.judge(
        limit, replace(compared, bound=recorded.bound), components, followed.claimed, resolution
    )
    defect = np.abs(limit.value - compared.end) / compared.unit
    uncertainty = (limit.uncertainty + recorded.bound) / compared.unit
    defect = np.where(np.isfinite(uncertainty), defect, 0.0)
    if verdict.outcome is Outcome.DIFFERS:
        differing = differs(defect, uncertainty, verdict.resolution)
        verdict = _largest(verdict, defect, uncertainty, differing, components)
    label = "B" if match.source == "A" else "A"
    if not (recorded.is_smooth and recorded.ends.limit.order_confirmed):
        label = match.source
    reason = "" if verdict.outcome is Outcome.AGREES else f"in {label}, {verdict.reason}"
    kind = "" if verdict.outcome is Outcome.DIFFERS else verdict.kind
    return Judgement(
        verdict=replace(verdict, reason=reason, kind=kind),
        by_component=np.max(defect, axis=0),
        certain=np.asarray((defect > uncertainty).any(axis=0)),
    )


def _largest(
    verdict: CaseJudgement,
    defect: Array,
    uncertainty: Array,
    differing: NDArray[np.bool_],
    components: Sequence[str],
) -> CaseJudgement:
    """Return a verdict that names the component with the largest certain difference.

    The ratio to the uncertainty would depend on last digits. Of like differences, take the first.
    """
    sizes = np.max(np.where(differing, defect, 0.0), axis=0)
    component = int(np.argmax(sizes >= (1 - EQUAL_TOLERANCE) * np.max(sizes)))
    run = int(np.argmax(np.where(differing[:, component], defect[:, component], -1.0)))
    size, doubt = float(defect[run, component]), float(uncertainty[run, component])
    return replace(
        verdict,
        component=components[component],
        discrepancy=size,
        uncertainty=doubt,
        reason=f"{components[component]} ends a run {size:.2e} of its displacement apart, where"
        f" {doubt:.1e} is uncertain",
    )


SOLVED_RUNS = 24
"""Runs over which the equations are solved."""


def explained(
    sides: tuple[ModelSide, ModelSide],
    match: Match,
    recorded: Recorded,
    followed: Ends,
    signs: Array,
) -> tuple[float, tuple[float, float]] | None:
    """Solve both files' equations over the runs.

    Args:
        sides: source and target.
        match: of the coordinates.
        recorded: runs of the source.
        followed: the target's end states, with joints reversed by `signs`, (m,).

    Returns:
        The share of the discrepancy that the equations reproduce, and the deviation of both
        engines from the equations of their files, relative to how far components move. None if
        forces depend on the state, actuator states move, or the equations can't be solved.
    """
    source, other = sides
    if not match.constant:
        return None
    if source.facts.states_move or other.facts.states_move:
        return None
    finite, reached = _reached(followed)
    if not len(finite):
        return None
    some = finite[even_indices(len(finite), SOLVED_RUNS)]
    compared, both = recorded.compared.pick(some), np.concatenate([signs, signs])
    with np.errstate(all="ignore"):
        source_ends = source.equations.ends(own_forces(recorded.runs.pick(some), match))
        target_ends = other.equations.ends(reversed_segments(compared, signs)) * both
    source_ends = match.convert(source_ends)
    if not (np.isfinite(source_ends).all() and np.isfinite(target_ends).all()):
        return None
    ends, seen, scale = compared.end, reached[some], compared.unit
    discrepancy = (seen - ends) / scale
    remaining = discrepancy - (target_ends - source_ends) / scale
    share = 1 - _size(remaining) / _size(discrepancy) if _size(discrepancy) else 0.0
    off_source = float(np.max(np.abs(source_ends - ends) / scale))
    return share, (off_source, float(np.max(np.abs(target_ends - seen) / scale)))


def judged_by_equations(
    sides: tuple[ModelSide, ModelSide],
    match: Match,
    recorded: Recorded,
    judgement: Judgement,
    resolution: float,
) -> Judgement:
    """Judge by accelerations of both files' equations where motions are not resolved finely.

    The uncertainty is their change with the last digit of the states. Return the judgement
    unchanged if the equations can't decide: they don't show what two engines do to one file.
    """
    if not match.constant or any(side.facts.states_move for side in sides):
        return judgement
    driven, compared = own_forces(recorded.runs, match), recorded.compared
    slopes = match.slopes(0 * driven.start[:1, : driven.start.shape[1] // 2])[0]
    values = [
        (sides[0].equations.accelerations(replace(driven, start=driven.start * factor)) @ slopes.T,
         sides[1].equations.accelerations(replace(compared, start=compared.start * factor)))
        for factor in (1.0, 1.0 + EPSILON)
    ]  # fmt: skip
    if not np.isfinite(values).all():
        return judgement
    (here, there), last = values[0], np.array(values[1])
    sizes = np.maximum(np.max(np.abs(here), axis=0), np.max(np.abs(there), axis=0))
    scale = np.where(sizes > 0, sizes, 1.0)
    defect = np.abs(there - here) / scale
    doubt = np.sum(np.abs(last - values[0]), axis=0) / scale + 64 * EPSILON
    run, place = np.unravel_index(np.argmax(defect), defect.shape)
    largest, uncertainty = float(defect[run, place]), float(np.max(doubt))
    differ = largest > resolution + uncertainty
    a, b = (side.facts.candidate for side in sides)
    is_settled = judgement.outcome is Outcome.AGREES or a.engine != b.engine
    if not differ and (uncertainty > resolution or is_settled):
        return judgement
    text = f"by the equations of both files, accelerations of {match.names[place]} differ by"
    verdict = replace(
        judgement.verdict, outcome=Outcome.DIFFERS if differ else Outcome.AGREES, kind="",
        discrepancy=largest, uncertainty=uncertainty, component=f"{match.names[place]}_ddot",
        reason=f"{text} {largest:.2e} of their size" if differ else "",
    )  # fmt: skip
    by_component, certain = np.max(defect, axis=0), (defect > doubt).any(axis=0)
    return Judgement(
        verdict=verdict,
        by_component=np.concatenate([by_component, by_component]),
        certain=np.concatenate([certain, certain]),
        by_equations=True,
    )


def weighed(
    differences: Sequence[Difference], a: ModelSide, runs: Segments | None, rounding: float = 0.0
) -> tuple[ComparedProperty, ...]:
    """Return differences with their effects on A's motions, the largest first.

    The effect of a difference is the change of the ends of runs if A's tree takes B's value.

    Args:
        differences: of the files.
        a: contents of A.
        runs: of A, with forces on its own coordinates; None if these are unknown.
        rounding: relative difference up to which no effect is computed.
    """
    effects: list[float | None] = [None] * len(differences)
    if runs is not None:
        part = runs.pick(even_indices(len(runs.start), SOLVED_RUNS))
        with np.errstate(all="ignore"):
            ends = a.equations.ends(part)
            scale = movement(ends, part.start)
            first = a.equations.accelerations(part)
            size = np.max(np.abs(first), axis=0)
            for i, (row, tree) in enumerate(differences):
                if tree is None or (row.relative or 1.0) <= rounding:
                    continue
                equations = FileEquations(tree, a.facts.coordinates)
                effect = np.max(np.abs(equations.ends(part) - ends) / scale)
                if not np.isfinite(effect):  # too stiff for the run: by accelerations
                    miss = np.abs(equations.accelerations(part) - first)
                    effect = np.max(miss / np.where(size > 0, size, 1.0))
                effects[i] = float(effect)
    rows = [
        structs.replace(row, effect=number(effect))
        for (row, _), effect in zip(differences, effects, strict=True)
    ]
    return tuple(sorted(rows, key=_least_effect_last))


TURNED = 0.1
"""Angle above which an axis or a kind of joint comes first, rad."""


def _least_effect_last(row: ComparedProperty) -> tuple[bool, bool, bool, float]:
    """Return a key: axes that are turned far come first, since other differences follow from them.

    Actuators and tendons, whose effects are unknown, follow bodies and joints.
    """
    turned = row.kind == "kind" or (row.kind == "axis" and (row.relative or 0.0) > TURNED)
    size = row.relative if row.effect is None else row.effect
    # Round to six digits, so that last digits do not change the order of like legs.
    rounded = float(f"{1.0 if size is None else size:.5e}")
    return not row.moves, not turned, row.kind in ("tendon", "actuator", "actuators"), -rounded


def _reached(followed: Ends) -> tuple[NDArray[np.intp], Array]:
    """Return which runs have known end states, and all end states, (K, 2m).

    Where few runs have a limit, as under holding motors, use the end states of the finest rung.
    """
    if followed.mostly_limited:
        finite = np.isfinite(followed.uncertainty).all(axis=1)
        return np.flatnonzero(finite), followed.value
    return np.flatnonzero(np.isfinite(followed.finest).all(axis=1)), followed.finest


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
