"""Plots of a model, a system and a diagnosis: linear equations and causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from physics_crosscheck.harness.records.base import Rows
from physics_crosscheck.harness.records.case import Series
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import CorrectedMotion, CorrectedScenario, Diagnosis
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.system import SystemResult
from physics_crosscheck.harness.render.html.diagnoses import named
from physics_crosscheck.harness.render.html.packs import Array, Chart, Column, Curve, Pack
from physics_crosscheck.harness.render.html.runs import CaseRun, ends, largest, single, values
from physics_crosscheck.harness.render.html.text import percent, quantity, sci

PAIRS = 6
"""Maximum number of output-input pairs in one plot."""

LINEAR, CAUSE = "Linear equations", "Does it explain the motion?"


def responses(pack: Pack, model: Model, system: SystemResult) -> tuple[Chart, ...]:
    """Plot the frequency response of an engine's linearization and of the transfer functions."""
    pairs = [
        f"{output.name} / {source.name}" for output in system.outputs for source in system.inputs
    ]
    return tuple(
        _response(pack, one, pairs)
        for one in model.linearizations
        if pairs
        and one.frequencies
        and _grid(one.response).shape == (len(one.frequencies), len(pairs))
    )


def _grid(response: Sequence[Rows]) -> Array:
    """Return a matrix of frequencies by output-input pairs."""
    return np.array([np.ravel(np.array(row, dtype=float)) for row in response])


def _response(pack: Pack, linearization: EngineLinearization, pairs: Sequence[str]) -> Chart:
    w = pack.column(linearization.frequencies, 5)
    taylor, engine = _grid(linearization.taylor_response), _grid(linearization.response)
    curves: list[Curve] = []
    for place, label in enumerate(pairs[:PAIRS]):
        curves += [
            Curve(label, "transfer", w, pack.column(taylor[:, place], 5), place),
            Curve(label, "response", w, pack.column(engine[:, place], 5), place),
        ]
    return Chart(
        part=LINEAR,
        title=f"Frequency response about “{linearization.equilibrium}”",
        x_label="frequency [rad/s]",
        y_label="output per input, SI units",
        curves=tuple(curves),
        key="Wide line: the transfer function of the linearized equations. Dashes: that of the"
        " engine, linearized by itself.",
        summary=(
            f"From {quantity(linearization.frequencies[0], 'rad/s', 3)} to "
            f"{quantity(linearization.frequencies[-1], 'rad/s', 3)}; they differ by at most "
            f"{sci(linearization.transfer_error)} of the largest value."
        ),
        log_x=True,
        log_y=True,
    )


def reaches(pack: Pack, system: SystemResult) -> tuple[Chart, ...]:
    """Plot the error of the linear equations over amplitude."""
    linearity = system.derivation.linearity if system.derivation else ()
    if not linearity:
        return ()
    curves = tuple(
        Curve(
            f"{one.equilibrium}, mode {one.mode + 1}",
            "reach",
            pack.column(one.amplitudes, 5),
            pack.column(one.errors, 4),
            place,
        )
        for place, one in enumerate(linearity)
    )
    first = linearity[0]
    return (
        Chart(
            part=LINEAR,
            title="Linear against nonlinear",
            x_label="amplitude [SI units]",
            y_label="relative error",
            curves=curves,
            key="Largest error of the linear equations over one period of each mode, released at"
            " rest in its shape, relative to the amplitude.",
            summary=(
                f"At an amplitude of {first.amplitudes[0]:g} the error of the linear "
                f"equations is {percent(first.errors[0])} in the first of these modes, "
                f"at {first.amplitudes[-1]:g} it is {percent(first.errors[-1])}."
            ),
            log_x=True,
            log_y=True,
        ),
    )


def hypotheses(pack: Pack, diagnosis: Diagnosis) -> tuple[Chart, ...]:
    """Plot the residual discrepancy of each hypothesis."""
    ranked = diagnosis.explanations
    if not ranked:
        return ()
    count = len(ranked)
    # The best is on top.
    rows: Array = np.arange(count, dtype=np.float64)[::-1] + 0.5
    remaining = np.array([max(one.remaining, 1e-16) for one in ranked])
    floor = max(diagnosis.floor or 0.0, 1e-16)
    y = pack.column(rows, 4)
    line = np.array([0.0, count])
    return (
        Chart(
            part="Which cause?",
            title="Ranked hypotheses",
            x_label="residual share of the discrepancy",
            y_label="",
            curves=(
                Curve("residual", "lollipop", pack.column(remaining, 4), y),
                Curve("uncertainty", "guide", pack.column([floor, floor], 4), pack.column(line, 4)),
            ),
            key=(
                "Each hypothesis is one number, fitted to the motion; further to the "
                "left explains more. Dots: the residual from uncertainty alone."
            ),
            summary=(
                f"The best, {named(ranked[0].causes)}, leaves a residual of "
                f"{sci(ranked[0].remaining)}; the last of these, "
                f"{sci(ranked[-1].remaining)}."
            ),
            log_x=True,
            names=tuple(named(one.causes) for one in reversed(ranked)),
        ),
    )


def corrected(
    pack: Pack, motion: CorrectedMotion, runs: Mapping[str, CaseRun], units: Sequence[str]
) -> Iterator[Chart]:
    """Plot the motion with the fitted values, and the remaining defects.

    Args:
        runs: runs of the model, by scenario.
        units: unit of each component.
    """
    for scenario in motion.scenarios:
        run = runs.get(scenario.scenario)
        if run is None:
            continue
        for i in range(len(run.reference) // 2):
            yield _corrected(pack, motion, scenario, run, i, units[i])
        yield _defects(pack, scenario, run)


def _corrected(
    pack: Pack,
    motion: CorrectedMotion,
    scenario: CorrectedScenario,
    run: CaseRun,
    i: int,
    unit: str,
) -> Chart:
    """Plot the i-th coordinate."""
    name, put_in = run.series.components[i], _values_put_in(motion.causes)
    then, now = _apart(motion, scenario, run.series, i)
    low, high = ends(values(run.series.reference[i]))
    margin = 0.5 * ((high - low) or 1.0)
    fitted = pack.column(single(scenario.corrected[i]), 6)
    with_it = f"{motion.put_into} with {put_in}"
    return Chart(
        part=CAUSE,
        title=f"{scenario.scenario}: {name}, corrected",
        x_label="t [s]",
        y_label=f"{name} [{unit}]",
        curves=(
            Curve("reference", "reference", run.t, run.reference[i]),
            Curve(with_it, "corrected", pack.column(scenario.t, 6), fitted),
            Curve(f"this: {run.label}", "engine", run.t, run.engine[i]),
        ),
        key=f"Wide line: the equations as declared. Thin line: the {motion.put_into} with the value"
        " that was found. Dashes: the engine with the file as it is.",
        summary=(
            f"The engine differs from the reference by at most {then:.2g} {unit}, and from the"
            f" equations with {put_in} by {now:.2g} {unit}. The rest is the error of its time step."
            if motion.put_into == "equations"
            else f"With {put_in} the file runs within {now:.2g} {unit} of the reference."
        ),
        over_time=True,
        y_limits=(low - margin, high + margin),
    )


def _values_put_in(causes: Sequence[Cause]) -> str:
    return " and ".join(f"{one} = {_estimate(one)}" for one in causes)


def _estimate(cause: Cause) -> str:
    return quantity(cause.estimate, "", 6)


def _apart(
    motion: CorrectedMotion, scenario: CorrectedScenario, series: Series, i: int
) -> tuple[float, float]:
    """Return the largest distance of a run from its expected curve, before and after.

    Before: engine to reference. After: engine to the equations with the fitted value, or the
    corrected file to the reference.
    """
    # Importing scipy takes a part of a second, so only this function does.
    import scipy.interpolate

    t, engine, reference = values(series.t), single(series.engine[i]), values(series.reference[i])
    fitted = single(scenario.corrected[i])
    corrected_t = values(scenario.t)[: len(fitted)]
    target = engine if motion.put_into == "equations" else reference
    finite = np.isfinite(target)
    inside = (corrected_t <= t[finite][-1]) & np.isfinite(fitted)
    # The samples differ; a cubic is accurate enough for a smooth plot.
    interpolated = scipy.interpolate.CubicSpline(t[finite], target[finite])(corrected_t[inside])
    return largest(engine - reference), largest(fitted[inside] - interpolated)


def _defects(pack: Pack, scenario: CorrectedScenario, run: CaseRun) -> Chart:
    t = pack.column(scenario.segment_t, 6)
    before, after = _rows(scenario.before), _rows(scenario.after)

    def worst(rows: Array) -> Column:
        return pack.column(np.max(np.abs(rows), axis=0), 3)

    names = ", ".join(run.series.components)
    return Chart(
        part=CAUSE,
        title=f"{scenario.scenario}: defects before and after",
        x_label="t [s]",
        y_label="relative defect",
        curves=(
            Curve("as the file is", "before", t, worst(before)),
            Curve("with the value that was found", "after", t, worst(after)),
        ),
        key=(f"Extrapolated segments, the largest of {names}: free of the error of the time step."),
        summary=f"The largest defect falls from {sci(largest(before.ravel()))} to"
        f" {sci(largest(after.ravel()))}.",
        log_y=True,
        over_time=True,
    )


def _rows(rows: Rows) -> Array:
    return np.array([values(row) for row in rows])
