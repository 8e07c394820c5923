"""The plots of a model, a system and a diagnosis: linear equations, and what explains a motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.interpolate

from harness.report.packs import Chart, Column, Curve, Pack
from harness.report.runs import Run, ends, largest, single, values
from harness.report.text import percent, quantity, sci, shown
from reference.numeric import Array

PAIRS = 6
"""Pairs of output and input in one plot at most."""

LINEAR, CAUSE = "Linear equations", "Does it explain the motion?"

Record = Mapping[str, Any]


def responses(pack: Pack, model: Record, system: Record) -> tuple[Chart, ...]:
    """Frequency response of an engine's own linearization over the transfer functions."""
    charts = []
    pairs = [(o["name"], i["name"]) for o in system["outputs"] for i in system["inputs"]]
    for one in model["linearization"]:
        count = len(one["frequencies"])
        if not pairs or not count:
            continue
        w = pack.column(one["frequencies"], 5)
        found = {
            name: np.array([values(np.ravel(row).tolist()) for row in one[name]])
            for name in ("response", "taylor_response")
        }
        if found["response"].shape != (count, len(pairs)):
            continue
        curves: list[Curve] = []
        for place, (output, source) in enumerate(pairs[:PAIRS]):
            label = f"{shown(output)} / {shown(source)}"
            columns = {name: pack.column(grid[:, place], 5) for name, grid in found.items()}
            curves += [
                Curve(label, "transfer", place, w, columns["taylor_response"]),
                Curve(label, "response", place, w, columns["response"]),
            ]
        error = one["transfer_error"]
        charts.append(
            Chart(
                LINEAR,
                f"Frequency response about “{shown(one['equilibrium'])}”",
                "frequency [rad/s]",
                "output per input, SI units",
                tuple(curves),
                "Wide line: the transfer function of the linearized equations. Dashes: that of the"
                " engine, linearized by itself.",
                f"From {quantity(one['frequencies'][0], 'rad/s', 3)} to"
                f" {quantity(one['frequencies'][-1], 'rad/s', 3)}; they are apart by {sci(error)}"
                " of the largest value at most.",
                log_x=True,
                log_y=True,
            )
        )
    return tuple(charts)


def reaches(pack: Pack, system: Record) -> tuple[Chart, ...]:
    """How far the linear equations hold: their error over amplitude."""
    found = system["linearity"]
    if not found:
        return ()
    curves = tuple(
        Curve(
            f"{shown(one['equilibrium'])}, mode {one['mode'] + 1}",
            "reach",
            place,
            pack.column(one["amplitudes"], 5),
            pack.column(one["errors"], 4),
        )
        for place, one in enumerate(found)
    )
    last = found[0]
    return (
        Chart(
            LINEAR,
            "Linear against nonlinear",
            "amplitude [SI units]",
            "relative error",
            curves,
            "Largest error of the linear equations over one period of each mode, released at rest"
            " in its shape, relative to the amplitude.",
            f"At an amplitude of {last['amplitudes'][0]:g} the linear equations err by"
            f" {percent(last['errors'][0])} in the first of these modes, at"
            f" {last['amplitudes'][-1]:g} by {percent(last['errors'][-1])}.",
            log_x=True,
            log_y=True,
        ),
    )


def hypotheses(pack: Pack, diagnosis: Record) -> tuple[Chart, ...]:
    """What each hypothesis leaves of the discrepancy."""
    findings = diagnosis.get("findings", ())
    if not findings:
        return ()
    count = len(findings)
    # The best at the top.
    rows: Array = np.arange(count, dtype=np.float64)[::-1] + 0.5
    left = np.array([max(finding["remaining"], 1e-16) for finding in findings])
    floor = max(diagnosis.get("floor") or 0.0, 1e-16)
    y = pack.column(rows, 4)
    line = np.array([0.0, count])
    return (
        Chart(
            "Which cause?",
            "Ranked hypotheses",
            "share of the discrepancy left",
            "",
            (
                Curve("left", "lollipop", 0, pack.column(left, 4), y),
                Curve(
                    "uncertainty", "guide", 0, pack.column([floor, floor], 4), pack.column(line, 4)
                ),
            ),
            "Each hypothesis is one number, fitted to the motion; further to the left explains"
            " more. Dots: what the uncertainty alone would leave.",
            f"The best, {shown(findings[0]['cause'])}, leaves {sci(findings[0]['remaining'])} of"
            f" the discrepancy; the last of these leaves {sci(findings[-1]['remaining'])}.",
            log_x=True,
            names=tuple(shown(f["cause"]) for f in reversed(findings)),
        ),
    )


def redrawn(
    pack: Pack, diagnosis: Record, runs: Mapping[str, Run], units: Sequence[str]
) -> Iterator[Chart]:
    """The motion with the value that was found, and what it leaves of the defects.

    Args:
        runs: of the model, by scenario.
        units: of each component.
    """
    record = diagnosis.get("redrawn") or {}
    for one in record.get("scenarios", ()):
        run = runs.get(one["scenario"])
        if run is None:
            continue
        yield from _redrawn_motions(pack, record, one, run, units)
        yield _defects(pack, one, run)


def _redrawn_motions(
    pack: Pack, record: Record, one: Record, run: Run, units: Sequence[str]
) -> Iterator[Chart]:
    series = run.case["series"]
    t = pack.column(one["t"], 6)
    cause = shown(record["cause"])
    value = ", ".join(f"{estimate:.6g}" for estimate in record["estimate"])
    again = "equations" if record["what"] == "equations" else "file"
    for i in range(len(run.reference) // 2):
        name, unit = shown(series["components"][i]), shown(units[i])
        fitted = single(one["redrawn"][i])
        then, now = _apart(record, one, series, i)
        low, high = ends(values(series["reference"][i]))
        told = (
            f"The engine is off the reference by {then:.2g} {unit} at most, and off the equations"
            f" with {cause} = {value} by {now:.2g} {unit}: what is left is its step's."
            if again == "equations"
            else f"With {cause} = {value} the file runs within {now:.2g} {unit} of the reference."
        )
        margin = 0.5 * ((high - low) or 1.0)
        yield Chart(
            CAUSE,
            f"{shown(one['scenario'])}: {name}, redrawn",
            "t [s]",
            f"{name} [{unit}]",
            (
                Curve("reference", "reference", 0, run.t, run.reference[i]),
                Curve(f"{again} with {cause} = {value}", "redrawn", 0, t, pack.column(fitted, 6)),
                Curve(f"this: {run.label}", "engine", 0, run.t, run.engine[i]),
            ),
            f"Wide line: the equations as declared. Thin line: the {again} with the value that was"
            " found. Dashes: the engine with the file as it is.",
            told,
            over_time=True,
            y_limits=(low - margin, high + margin),
        )


def _apart(record: Record, one: Record, series: Record, i: int) -> tuple[float, float]:
    """Largest distance from the curve on which a run should be, before and after.

    Before: of the engine from the reference. After: of the engine from the equations with the value
    that was found, or of the file with it from the reference.
    """
    t, engine, reference = (
        values(series["t"]),
        single(series["engine"][i]),
        values(series["reference"][i]),
    )
    fitted = single(one["redrawn"][i])
    redrawn_t = values(one["t"])[: len(fitted)]
    target = engine if record["what"] == "equations" else reference
    known = np.isfinite(target)
    inside = (redrawn_t <= t[known][-1]) & np.isfinite(fitted)
    # The samples of the two don't coincide; a cubic is as good as the plot is smooth.
    at = scipy.interpolate.CubicSpline(t[known], target[known])(redrawn_t[inside])
    return largest(engine - reference), largest(fitted[inside] - at)


def _defects(pack: Pack, one: Record, run: Run) -> Chart:
    t = pack.column(one["segment_t"], 6)
    before, after = (np.array([values(row) for row in one[name]]) for name in ("before", "after"))

    def worst(rows: Any) -> Column:
        return pack.column(np.max(np.abs(rows), axis=0), 3)

    names = ", ".join(shown(name) for name in run.case["series"]["components"])
    return Chart(
        CAUSE,
        f"{shown(one['scenario'])}: defects before and after",
        "t [s]",
        "relative defect",
        (
            Curve("as the file is", "before", 0, t, worst(before)),
            Curve("with the value that was found", "after", 0, t, worst(after)),
        ),
        f"Extrapolated segments, the largest of {names}: no step is left in them.",
        f"The largest defect falls from {sci(largest(before.ravel()))} to"
        f" {sci(largest(after.ravel()))}.",
        log_y=True,
        over_time=True,
    )
