"""Check of one model with one planted fault."""

import msgspec
import numpy as np

from physics_crosscheck.harness.checks.planar_step import check_planar_step
from physics_crosscheck.harness.checks.poses import check_poses
from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.diagnosis.diagnose import Ranking, diagnose
from physics_crosscheck.harness.diagnosis.task import trial_model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.full_run import follow
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutation
from physics_crosscheck.harness.results.status import percent
from physics_crosscheck.reference.mechanism.numeric import Array
from .survey import SIZES, FaultSurvey, PlantedFault

RESOLUTION = 1e-9
"""Uncertainty of motions up to which a model can agree."""

UNCERTAINTY_FACTOR = 10.0
"""Factor of the sound model's uncertainty up to which a model can agree too."""


SystemFault = PlantedFault[PreparedSystem]
"""A fault in a model of a folder with energies."""


def judge_motions(task: SystemFault, wrong: SystemTask) -> Mutation:
    """Build the row of a fault, from the motions of the wrong model."""
    sound, mistake = task.survey, task.mistake
    assert sound is not None
    with trial_model(wrong, _near(task, sound)) as (whole, uncertainty):
        defect = np.abs(whole.defect({}))
        size = float(np.max(defect))
        moved = np.abs(whole.ends - sound.ends) - sound.uncertainty > uncertainty
        resolved = _resolved(uncertainty, sound)
        if mistake.sound and resolved and not moved.any():
            return task.row(FaultVerdict.AGREES, _global_errors(task.model, wrong), size)
        seen = defect > uncertainty
        if seen.any():
            share = float(np.min(uncertainty[seen] / defect[seen]))
            row = task.row(FaultVerdict.CAUGHT, "", size, share)
            return with_ranking(row, diagnose(whole, uncertainty), mistake.causes, task.values)
        if not resolved:
            coarse = f"unresolved, to {np.max(uncertainty):.0e}"
            return task.row(FaultVerdict.CAUGHT, coarse, size)
        row = _in_frames(task, wrong, task.row(FaultVerdict.UNTESTED, "", size))
        row = _in_steps(task, wrong, row) if row.verdict is FaultVerdict.UNTESTED else row
        return _unnoticed(row, bool(moved.any())) if row.verdict is FaultVerdict.UNTESTED else row


def _in_frames(task: SystemFault, wrong: SystemTask, row: Mutation) -> Mutation:
    """Build the row of a fault that no motion shows: caught if a body is displaced."""
    model, coordinates = wrong.load()
    n = len(wrong.target.system.q)
    reached = np.concatenate([motion.start[:, :n] for motion in wrong.target.motions.values()])
    findings = check_poses(
        wrong.target.system, wrong.declared, model, coordinates, reached
    ).findings
    if not findings:
        return row
    message = "; ".join(one.message for one in findings)
    right = bool(task.mistake.audit_words) and task.mistake.audit_words in message
    return msgspec.structs.replace(
        row,
        verdict=FaultVerdict.NAMED if right else FaultVerdict.CAUGHT,
        message=message,
        first_caught=number(min(one.share for one in findings)),
    )


def _in_steps(task: SystemFault, wrong: SystemTask, row: Mutation) -> Mutation:
    """Build the row of a fault that no motion shows: caught if steps with contacts differ."""
    sound, engine = task.model.spec, engines()[wrong.engine]
    check = check_planar_step(sound, wrong.spec, wrong.engine, RESOLUTION)
    if check is None or not check.record.differs:
        return row
    present, stated = (engine.load_planar(spec) for spec in (wrong.spec, sound))
    assert present is not None
    assert stated is not None
    changed = {name for name, value in present.numbers.items() if value != stated.numbers[name]}
    named = {CauseId(kind="default", subject=(name,)) for name in changed}
    values = ", ".join(
        f"{name} is {present.numbers[name]:g}; the file states {stated.numbers[name]:g}"
        for name in sorted(changed)
    )
    right = named and named <= task.mistake.causes
    return msgspec.structs.replace(
        row,
        verdict=FaultVerdict.NAMED if right else FaultVerdict.CAUGHT,
        message=values or f"whole steps differ in {check.record.component}",
        first_caught=None,
    )


def _near(task: SystemFault, survey: FaultSurvey) -> dict[CauseId, Array] | None:
    """Return the sound model's slopes if the fault is so small that they still hold."""
    if task.mistake.name not in SIZES:
        return None
    slopes = zip(survey.addresses, survey.slopes, strict=True)
    return {CauseId(kind="literal", subject=(address,)): slope for address, slope in slopes}


def _resolved(uncertainty: Array, sound: FaultSurvey) -> bool:
    """Return whether the uncertainty of motions is small enough for agreement."""
    allowed = max(RESOLUTION, UNCERTAINTY_FACTOR * float(np.max(sound.uncertainty)))
    return float(np.max(uncertainty)) <= allowed


def _unnoticed(row: Mutation, moved: bool) -> Mutation:
    """Judge an undetected fault: missed if the motions depend on it, otherwise untested."""
    depends = row.first_caught is not None if row.kind is FaultKind.LITERAL else moved
    verdict = FaultVerdict.MISSED if depends else FaultVerdict.UNTESTED
    return msgspec.structs.replace(row, verdict=verdict)


def with_ranking(
    row: Mutation,
    ranking: Ranking,
    right_causes: frozenset[CauseId],
    values: tuple[float, float] | None,
) -> Mutation:
    """Add the causes of a ranking, whether they are right, and the error of the fitted value.

    Two causes together name a fault if both are among the right ones.

    Args:
        row: of the fault.
        ranking: of the diagnosis.
        right_causes: causes of which a diagnosis may name any.
        values: right and wrong value of the literal at the row's location; None for other faults.
    """
    if not ranking.fits:
        return row
    first = ranking.fits[0]
    is_single = len(first.causes) == 1
    is_tied = is_single and not right_causes.isdisjoint(first.tied_with)
    is_right = ranking.explained and (right_causes.issuperset(first.causes) or is_tied)
    return msgspec.structs.replace(
        row,
        verdict=FaultVerdict.NAMED if is_right else FaultVerdict.CAUGHT,
        message=" and ".join(map(str, first.causes)),
        estimate_error=None if values is None else _estimate_error(row, ranking, *values),
    )


def _estimate_error(row: Mutation, ranking: Ranking, right: float, wrong: float) -> float | None:
    """Return the error of a number's fitted value, relative to the fault; None without a fit.

    A motion implies the right value of a literal; steps imply the value that is taken for it.
    """
    for kind, expected in (("literal", right), ("taken", wrong)):
        for fit in ranking.fits:
            if [(one.kind, one.subject) for one in fit.causes] == [(kind, (row.location,))]:
                return number(abs(fit.estimates[0] - expected) / abs(wrong - right))
    return None


def _global_errors(before: SystemTask, after: SystemTask) -> str:
    """Format the errors of full runs at the file's own time step, before and after the fault.

    The scenario with the least motion is used. With large motions, two time steps may end anywhere.
    """
    motion = min(before.target.compared.values(), key=lambda m: float(np.max(m.amplitude)))
    n = len(before.target.system.q)
    errors = []
    for task in (before, after):
        model, coordinates = task.load()
        t, states = follow(model, coordinates, motion, model.step)
        off = np.abs(states - motion.states_at(t))[:, :n]
        error = float(np.max(off / np.maximum(motion.amplitude[:n], 1e-300)))
        errors.append(percent(error))
    return f"error at dt {errors[0]} -> {errors[1]}"
