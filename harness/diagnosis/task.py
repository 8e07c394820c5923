"""Diagnosis of one model in one engine: samples, hypotheses, ranking, and its record."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.full_run import follow
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.records.base import Numbers, Rows, number, numbers
from physics_crosscheck.harness.records.cause import Cause, CauseId
from physics_crosscheck.harness.records.finding import (
    CorrectedMotion,
    CorrectedScenario,
    Diagnosis,
    Explanation,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion, Segments, even_indices
from physics_crosscheck.reference.solving.variants import Variants
from .diagnose import MIN_EFFECT, Ranking, diagnose
from .fit import Fit
from .hypotheses import everything
from .samples import engine_ends, finite, freedoms, reference_ends, sample_segments
from .trial import TrialModel, scratch

RECORDED = 8
"""Maximum number of explanations in the record."""


def diagnose_model(task: SystemTask) -> Diagnosis:
    """Find the cause of a model's discrepancy, from its motions alone.

    A degree of freedom that the equations lack has no value to fit. It is named if no cause
    explains the motion, or if the discrepancy does not show in the coordinates of the equations.

    Raises:
        EngineError, SidecarError, LocationError, BlownUpError: for a failing run.
    """
    began = time.perf_counter()
    if task.target.ideal and task.declared.laws and (soft := _soft_laws(task, began)):
        return soft
    with trial_model(task) as (whole, uncertainty):
        ranking = Ranking((), False, 1.0)
        if _shows(whole, uncertainty):
            ranking = diagnose(whole, uncertainty)
        free: tuple[str, ...] = ()
        if not ranking.explained:
            free = freedoms(whole.model, whole.coordinates, whole.samples)
        corrected = None
        if not task.target.system.interactions:  # an event would be between the samples of a run
            corrected = correct_motion(whole, task.target.motions, ranking)
    if free:
        return Diagnosis(
            failure=(
                "the model has a degree of freedom that the equations lack, or a "
                f"constraint that does not hold: {', '.join(free)}"
            ),
            seconds=time.perf_counter() - began,
        )
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(explanation(fit) for fit in ranking.fits[:RECORDED]),
        floor=number(ranking.floor),
        corrected=corrected,
        seconds=time.perf_counter() - began,
    )


def _shows(trial: TrialModel, uncertainty: Array) -> bool:
    """Return whether the end states show a discrepancy.

    A number off its bound value can leave them without a limit, and its bound value restores it.
    """
    defect = np.abs(trial.defect({}))
    off = any(h.start and h.expected is not None for h in trial.hypotheses)
    return bool(np.any(defect > uncertainty) or (off and defect.max() > MIN_EFFECT))


def _soft_laws(task: SystemTask, began: float) -> Diagnosis | None:
    """Return that the soft laws of the sidecar explain a model, if its motions agree with them."""
    target = replace(task.target, ideal=False).under_laws(task.declared)
    with trial_model(replace(task, target=target)) as (whole, uncertainty):
        if np.any(np.abs(whole.defect({})) > uncertainty):
            return None
    causes = tuple(
        Cause(kind="law", subject=(f"the soft law of {name}",), nominal=None, estimate=None,
              standard_error=None)
        for name in task.declared.laws
    )  # fmt: skip
    return Diagnosis(
        explained=True,
        explanations=(Explanation(causes=causes, remaining=0.0),),
        seconds=time.perf_counter() - began,
    )


def explanation(fit: Fit) -> Explanation:
    """Build the record of a fit."""
    return Explanation(causes=causes(fit), remaining=fit.remaining, tied_with=fit.tied_with)


def ranked(task: SystemTask) -> Ranking:
    """Rank all fits, without a corrected motion."""
    with trial_model(task) as (trial, uncertainty):
        return diagnose(trial, uncertainty)


@contextmanager
def trial_model(
    task: SystemTask, known_slopes: Mapping[CauseId, Array] | None = None
) -> Iterator[tuple[TrialModel, Array]]:
    """Yield a model to try in an engine, with the uncertainty of its end states.

    Args:
        task: the model and its motions.
        known_slopes: slopes of literals, if known from a similar model.
    """
    model, coordinates = task.load()
    samples = sample_segments(task.target.compared)
    ends, uncertainty = engine_ends(model, coordinates, samples)
    uncertainty = finite(uncertainty, ends - reference_ends(samples))
    # Add the reference's error bound and rounding error, as in the verdict.
    bounds = [np.tile(some.bound / some.unit, len(some.t)) for some in samples]
    uncertainty = np.maximum(uncertainty + np.concatenate(bounds), EPSILON)
    hypotheses = everything(
        task.target.system, task.declared, model, coordinates, task.target.variants
    )
    with scratch() as folder:
        trial = TrialModel(
            task=task,
            model=model,
            coordinates=coordinates,
            samples=samples,
            ends=ends,
            hypotheses=hypotheses,
            folder=folder,
            known_slopes=known_slopes or {},
        )
        yield trial, uncertainty


SAMPLES = 240
TOLERANCE = 1e-10
"""Relative tolerance of the corrected motion, far below the resolution of a plot."""

MAX_AMPLITUDES = 1e3
"""Number of amplitudes at which a diverging corrected motion ends."""


def correct_motion(
    trial_model: TrialModel, motions: Mapping[str, Motion], ranking: Ranking
) -> CorrectedMotion | None:
    """Return motions and defects corrected with the best fit's estimate, or None without one.

    Raises:
        EngineError, BlownUpError: for a failing run.
    """
    if not ranking.explained:
        return None
    fit, equations = _chosen(trial_model, ranking)
    if equations:
        point = trial_model.point(fit.repair)
        corrected = {name: _solved(trial_model.variants, point, m) for name, m in motions.items()}
    else:
        model = trial_model.repaired(fit.repair)
        if model is None:
            return None
        corrected = {name: _run(model, trial_model.coordinates, m) for name, m in motions.items()}
    before, after = trial_model.defect({}), trial_model.defect(fit.repair)
    return CorrectedMotion(
        causes=causes(fit),
        put_into="equations" if equations else "file",
        scenarios=_scenarios(corrected, trial_model.samples, before, after),
    )


def causes(fit: Fit) -> tuple[Cause, ...]:
    """Return the causes of a fit, with the fitted values."""
    rows = zip(fit.hypotheses, fit.estimates, fit.standard_errors, strict=True)
    return tuple(
        Cause(
            kind=hypothesis.id.kind,
            subject=hypothesis.id.subject,
            nominal=number(hypothesis.value),
            estimate=number(estimate),
            standard_error=number(error),
            is_read=fit.is_read,
            locations=hypothesis.where,
        )
        for hypothesis, estimate, error in rows
    )


def _chosen(trial_model: TrialModel, ranking: Ranking) -> tuple[Fit, bool]:
    """Return the best fit, or an equally good one of the equations only; and whether it is one."""
    best = ranking.fits[0]
    for fit in ranking.fits:
        alike = fit.remaining <= max(3 * best.remaining, 3 * ranking.floor)
        if alike and all(trial_model.hypotheses[i].repair.parameters for i in fit.members):
            return fit, True
    return best, False


def _solved(variants: Variants, point: Array, motion: Motion) -> tuple[Array, Array]:
    """Solve the equations at other parameters from the motion's initial state: (t, states)."""
    state = motion.start[0]
    n = len(state) // 2
    from scipy.integrate import solve_ivp  # slow import

    limit = MAX_AMPLITUDES * np.maximum(motion.amplitude, 1e-12)
    times = np.linspace(0.0, motion.duration, SAMPLES)
    parts = []
    for span in motion.spans:
        stop = span.start + span.length * span.count
        last = span is motion.spans[-1]
        inside = times[(times >= span.start) & ((times <= stop) if last else (times < stop))]
        short = 1e-9 * span.length

        def field(t: float, y: Array, end: float = stop - short) -> Array:
            # Up to its end a span uses its own input, not that of the next span.
            u = motion.inputs(np.array([min(t, end)]))
            a = variants.acceleration(y[None, :n], y[None, n:], u, np.array([[t]]), point[None])
            return np.concatenate([y[n:], a[0]])

        def gone(t: float, y: Array) -> float:
            return float(np.min(limit - np.abs(y)))

        gone.terminal = True  # type: ignore[attr-defined]
        done = solve_ivp(
            field,
            (span.start, stop),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=TOLERANCE * motion.amplitude,
            t_eval=np.union1d(inside, [stop]),
            events=gone,
        )
        states = done.y.T
        parts.append(states[np.isin(done.t, inside)])
        if done.status != 0:
            break
        state = states[-1]
    states = np.concatenate(parts)
    return times[: len(states)], states


def _run(model: LoadedModel, coordinates: CoordinateMap, motion: Motion) -> tuple[Array, Array]:
    t, states = follow(model, coordinates, motion, model.step)
    picked = even_indices(len(t), SAMPLES)
    return t[picked], states[picked]


def _scenarios(
    motions: Mapping[str, tuple[Array, Array]],
    samples: Sequence[Segments],
    before: Array,
    after: Array,
) -> tuple[CorrectedScenario, ...]:
    starts = np.cumsum([0, *(some.end.size for some in samples)])
    scenarios = []
    for i, some in enumerate(samples):
        (t, states), part = motions[some.name], slice(starts[i], starts[i + 1])
        scenarios.append(
            CorrectedScenario(
                scenario=some.name,
                t=_short(t, 6),
                corrected=_rows(states, 6),
                segment_t=_short(some.t, 6),
                before=_rows(before[part].reshape(some.end.shape), 3),
                after=_rows(after[part].reshape(some.end.shape), 3),
            )
        )
    return tuple(scenarios)


def _rows(states: Array, digits: int) -> Rows:
    return tuple(_short(row, digits) for row in states.T)


def _short(values: Array, digits: int) -> Numbers:
    return numbers(float(f"{value:.{digits}g}") for value in values.tolist())
