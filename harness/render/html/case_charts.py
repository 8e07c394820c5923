"""The plots of one case: motion, phase portrait, errors, energy, convergence, work-precision."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.records.case import Convergence
from physics_crosscheck.harness.records.outcome import FLOOR
from .packs import Array, Chart, Curve
from .runs import CaseRun, coarse_to_fine, ends, largest, single, values
from .text import percent, quantity, sci

OVERLAID = 9
"""Maximum number of other runs in one plot; more would be indistinguishable."""

MOTION, ERROR, COST = "Motion", "Error", "Step size"
"""Tabs of a case."""


def case_charts(
    run: CaseRun, others: Sequence[CaseRun], units: Sequence[str], magnitudes: Sequence[float]
) -> tuple[Chart, ...]:
    """Return the plots of a case.

    Args:
        run: its run.
        others: runs of other models and engines in its scenario.
        units: unit of each component.
        magnitudes: largest magnitude of each component in the system's motions.
    """
    half = len(run.reference) // 2
    names = run.series.components
    deciding = names.index(run.verdict.component) if run.verdict.component in names else 0
    # An empty series has no leading plot.
    motions = _led(
        (_motion(run, others, i, units[i]) for i in range(half)), deciding % max(half, 1)
    )
    errors = _led((_error(run, i, units[i], magnitudes[i]) for i in range(2 * half)), deciding)
    return (
        *motions,
        *(_phase(run, i, units) for i in range(half)),
        *_energy(run),
        *errors,
        _convergence(run),
        *_work_precision(run, others),
    )


def _led(charts: Iterable[Chart], leading: int) -> list[Chart]:
    """Mark the chart to show first, and put it there."""
    marked = [replace(chart, lead=i == leading) for i, chart in enumerate(charts)]
    return sorted(marked, key=lambda chart: not chart.lead)


def _motion(run: CaseRun, others: Sequence[CaseRun], i: int, unit: str) -> Chart:
    series = run.series
    name = series.components[i]
    reference, engine = values(series.reference[i]), values(series.engine[i])
    low, high = ends(reference)
    span = (high - low) or 1.0
    least, highest = ends(engine)
    away = least < low - span or highest > high + span
    return Chart(
        part=MOTION,
        title=f"{name}: reference and engines",
        x_label="t [s]",
        y_label=f"{name} [{unit}]",
        curves=(
            Curve("reference", "reference", run.t, run.reference[i]),
            *(
                Curve(other.label, "other", other.t, other.engine[i], place)
                for place, other in enumerate(others)
            ),
            Curve(f"this: {run.label}, {run.step}", "engine", run.t, run.engine[i]),
            *_events(run, i),
        ),
        key=(
            "Wide line: the solution of the equations. Dashes: this engine at its time "
            "step. Thin lines: the others. The legend hides and shows each."
        )
        + (" Circles: events of the solution." if run.full_run.events else ""),
        summary=f"{name} over {quantity(series.t[-1], 's')}: the reference stays between {low:.3g}"
        f" and {high:.3g} {unit}; this engine differs by at"
        f" most {largest(series.error[i]):.2g} {unit}.",
        over_time=True,
        y_limits=(low - span, high + span) if away else None,
    )


def _events(run: CaseRun, i: int) -> Iterator[Curve]:
    times = np.array([event.time for event in run.full_run.events])
    if len(times):
        on_curve = np.interp(times, values(run.series.t), values(run.series.reference[i]))
        x, y = run.pack.column(times, 7), run.pack.column(on_curve, 6)
        yield Curve("events", "event", x, y)


def _phase(run: CaseRun, i: int, units: Sequence[str]) -> Chart:
    names = run.series.components
    half = len(names) // 2
    position, speed = (values(run.series.reference[k]) for k in (i, half + i))
    limits = ends(speed)
    span = (limits[1] - limits[0]) or 1.0
    return Chart(
        part=MOTION,
        title=f"Phase portrait of {names[i]}",
        x_label=f"{names[i]} [{units[i]}]",
        y_label=f"{names[half + i]} [{units[half + i]}]",
        curves=(
            Curve("reference", "reference", run.reference[i], run.reference[half + i]),
            Curve(f"this: {run.label}, {run.step}", "engine", run.engine[i], run.engine[half + i]),
        ),
        key="Velocity over position, drawn as the motion.",
        summary=f"The reference reaches {largest(position):.3g} {units[i]} and"
        f" {largest(speed):.3g} {units[half + i]}.",
        y_limits=(limits[0] - 0.3 * span, limits[1] + 0.3 * span),
    )


def _error(run: CaseRun, i: int, unit: str, magnitude: float) -> Chart:
    series = run.series
    name = series.components[i]
    size = max(largest(series.reference[i]), FLOOR * magnitude) or 1.0
    error = single(series.error[i]) / size
    defect, bound = values(series.defect[i]), values(series.defect_uncertainty[i])
    by_steps = run.verdict.decided_by == "single steps"
    what = "single step" if by_steps else "extrapolated segment"
    movement = "movement in a step" if by_steps else "displacement"
    segment_t = run.pack.column(series.segment_t, 6)
    curves = (
        Curve("uncertainty", "band", segment_t, run.pack.column(bound, 3)),
        Curve("global", "global_error", run.t, run.pack.column(error, 4)),
        Curve(
            "single steps" if by_steps else "extrapolated",
            "defect",
            segment_t,
            run.pack.column(defect, 3),
        ),
    )
    triangles = (
        f" Triangles: the defect of each {what}, over its {movement}; "
        "up and filled for +, down and hollow for −. Grey: its uncertainty; the model "
        "differs where a triangle stands above the grey."
    )
    largest_defect = (
        f", defect of a{'n' if not by_steps else ''} {what} {sci(largest(defect))}, its "
        f"uncertainty {sci(largest(bound))}"
    )
    has_defects = len(defect) > 0  # a robot's are at drawn states
    return Chart(
        part=ERROR,
        title=f"{name}: error against uncertainty" if has_defects else f"{name}: error",
        x_label="t [s]",
        y_label="relative error",
        curves=curves if has_defects else curves[1:2],
        key=(
            "Line: engine − reference of the full run at dt, over the amplitude "
            f"({size:.3g} {unit}); solid where the engine is ahead (+), dotted "
            "where it is behind (−)."
        )
        + triangles * has_defects,
        summary=f"Largest among these samples: error at dt {percent(largest(error))}"
        f"{largest_defect * has_defects}.",
        log_y=True,
        over_time=True,
        over_error=True,
    )


def _energy(run: CaseRun) -> Iterator[Chart]:
    energy = run.series.energy
    if energy is None:
        return
    held, supplied = single(energy.held), single(energy.supplied)
    dissipated = single(energy.dissipated)
    gap = held - supplied + dissipated
    shares = (
        ("gained, T + V", held),
        ("work of the inputs", supplied),
        ("taken by dampers", dissipated),
        ("unaccounted for", gap),
    )
    yield Chart(
        part=MOTION,
        title="Energy balance of this engine",
        x_label="t [s]",
        y_label="energy [J]",
        curves=tuple(
            Curve(label, "share", run.t, run.pack.column(row, 5), place)
            for place, (label, row) in enumerate(shares)
        ),
        key=(
            "Since the start, at dt. The gain equals the work of the inputs minus the "
            "energy that dampers take. The rest is the integrator's error."
        ),
        summary=(
            f"At most {largest(gap):.2g} J is unaccounted for, "
            f"{percent(run.full_run.energy_error)} of the energy exchanged."
        ),
        over_time=True,
    )


def _convergence(run: CaseRun) -> Chart:
    full, column = run.series.full_runs, run.pack.column
    steps = values(full.h)[coarse_to_fine(full)]
    segments = run.series.convergence
    curves = [] if segments is None else _segment_curves(run, segments)
    curves.append(Curve("full run", "full_run", column(steps, 6), run.error))
    wanted = [(entry.step, entry.target) for entry in run.full_run.steps_for if entry.step]
    if wanted:
        x, y = np.array(wanted).T
        targets = ", ".join(f"{100 * target:g} %" for _, target in wanted)
        curves.append(Curve(targets, "target", column(x, 6), column(y, 6)))
    summary = (
        f"At {quantity(full.h[0], 's')} the error of the full run is {percent(full.error[0])}."
    )
    if segments is not None:
        curves += _slope(run, segments, steps)
        h, defect = values(segments.h), values(segments.defect)
        summary = (
            f"As the step falls from {quantity(_value(h, 0), 's')} to"
            f" {quantity(_value(h, -1), 's')}, the error of the segments falls from"
            f" {sci(_value(defect, 0))} to {sci(_value(defect, -1))};"
            " the last one moved the extrapolated limit by"
            f" {sci(_value(values(segments.increments), -1))}."
        )
    circles = (
        "Circles: root mean square over the segments, step by step. Triangles: how far each finer "
        "step moved the limit. Dots: the slope. "
    )
    return Chart(
        part=COST,
        title="Convergence",
        x_label="step h [s]",
        y_label="relative error",
        curves=tuple(curves),
        key=("" if segments is None else circles)
        + "Squares: full runs, largest error."
        + (" Diamonds: the steps that would give these errors." if wanted else ""),
        summary=summary,
        log_x=True,
        log_y=True,
    )


def _segment_curves(run: CaseRun, segments: Convergence) -> list[Curve]:
    """Return the errors of segments, and the increments of their limit."""
    column, h = run.pack.column, values(segments.h)
    increments = values(segments.increments)
    x, defect = column(h, 6), column(values(segments.defect), 4)
    later = column(h[1 : len(increments) + 1], 6)
    return [
        Curve("segments", "rungs", x, defect),
        Curve("increments of the limit", "increments", later, column(increments, 4)),
    ]


def _slope(run: CaseRun, segments: Convergence, steps: Array) -> Iterator[Curve]:
    h, defect, column = values(segments.h), values(segments.defect), run.pack.column
    slope, whose = run.verdict.order, "observed"
    if slope is None:
        slope, whose = run.verdict.claimed_order, "claimed"
    if len(h) > 1 and defect[-1] > 0:
        step_range = np.array(ends(np.concatenate([h, steps])))
        guide = defect[-1] * (step_range / h[-1]) ** slope
        label = f"slope {slope:.2f} ({whose})"
        yield Curve(label, "guide", column(step_range, 6), column(guide, 4))


def _work_precision(run: CaseRun, others: Sequence[CaseRun]) -> Iterator[Chart]:
    if run.seconds is None:
        return
    curves = [Curve(f"this: {_method(run)}", "full_run", run.seconds, run.error)]
    curves += [
        Curve(_method(other), "work", other.seconds, other.error, place)
        for place, other in enumerate(others)
        if other.seconds is not None
    ]
    runs = run.series.full_runs
    finest = int(coarse_to_fine(runs)[-1])
    yield Chart(
        part=COST,
        title="Work and precision",
        x_label="time of the run [s]",
        y_label="relative error",
        curves=tuple(curves),
        key=(
            "Time of each engine's full run against its error, at dt and at other "
            "steps, each half or twice the last. Further to the lower left is better."
        ),
        summary=f"This engine takes {quantity(runs.seconds[0], 's', 2)} for an error of"
        f" {percent(runs.error[0])}, and {quantity(runs.seconds[finest], 's', 2)} for"
        f" {percent(runs.error[finest])}.",
        log_x=True,
        log_y=True,
    )


def _method(run: CaseRun) -> str:
    integrator = run.full_run.integrator
    return f"{run.label}, {integrator}" if integrator else run.label


def _value(values: Array, place: int) -> float | None:
    return float(values[place]) if len(values) and np.isfinite(values[place]) else None
