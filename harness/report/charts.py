"""The numbers of a case's plots: which curves, in which units, and what they say in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.report.text import percent, quantity, sci, shown
from harness.verdict import FLOOR
from reference.numeric import Array

Row = Sequence[float | None]


@dataclass(frozen=True)
class Curve:
    """One curve; its role and its place among its kind say how it is drawn.

    Attributes:
        label: entry of the legend; curves of one label are shown and hidden together.
        name: what hovering over it says.
        role: `reference`, `engine`, `raw`, `defect`, `uncertainty`, `rungs`, `plain`, `draws` or
            `guide`.
        place: number of the component, for those roles that have several.
        x, y: values; nan where there is none.
    """

    label: str
    name: str
    role: str
    place: int
    x: Array
    y: Array


@dataclass(frozen=True)
class Chart:
    """One plot.

    Attributes:
        title: what it shows.
        x_label, y_label: with units.
        log_x, log_y: which axes are logarithmic.
        over_time: whether x is the time of the motion, shared with the case's other charts.
        curves: in drawing order.
        y_limits: part of the y axis to show at first; None shows all.
        key: how to tell the curves apart.
        summary: what is to be seen, in words with numbers.
    """

    title: str
    x_label: str
    y_label: str
    log_x: bool
    log_y: bool
    over_time: bool
    curves: tuple[Curve, ...]
    y_limits: tuple[float, float] | None
    key: str
    summary: str


def amplitudes(cases: Iterable[Mapping[str, Any]]) -> dict[str, list[float]]:
    """Largest magnitude of each component over all cases of a folder."""
    found: dict[str, list[float]] = {}
    for case in cases:
        if case["series"] is not None:
            sizes = [_largest(row) for row in case["series"]["reference"]]
            before = found.get(case["folder"], [0.0] * len(sizes))
            found[case["folder"]] = [max(a, b) for a, b in zip(before, sizes, strict=True)]
    return found


def charts(
    case: Mapping[str, Any], units: Sequence[str], reach: Sequence[float]
) -> tuple[Chart, ...]:
    """The plots of one case: each coordinate's motion, the errors over time, the convergence.

    Args:
        case: its record; none without series.
        units: of each component.
        reach: largest magnitude of each component in the system's motions, see `amplitudes`.
    """
    series = case["series"]
    if series is None:
        return ()
    half = len(series["components"]) // 2
    motions = (_motion(case, i, units[i]) for i in range(half))
    return (*motions, _errors(series, reach), _convergence(case))


def _motion(case: Mapping[str, Any], i: int, unit: str) -> Chart:
    series = case["series"]
    name = shown(series["components"][i])
    t, reference, engine = (
        _values(row) for row in (series["t"], series["reference"][i], series["engine"][i])
    )
    low, high = _ends(reference)
    span = (high - low) or 1.0
    least, most = _ends(engine)
    away = least < low - span or most > high + span
    step = quantity(case["shipped_step"], "s")
    return Chart(
        f"{name}: reference and engine", "t [s]", f"{name} [{shown(unit)}]", False, False, True,
        (
            Curve("reference", "reference", "reference", 0, t, reference),
            Curve(f"engine at {step}", "engine", "engine", 0, t, engine),
        ),
        (low - span, high + span) if away else None,
        "Wide line: the solution of the equations. Dashed: the engine at its shipped step.",
        f"{name} over {quantity(_ends(t)[1], 's')}: the reference stays between {low:.3g} and"
        f" {high:.3g} {shown(unit)}; the engine at a step of {step} is off by"
        f" {_largest(series['error'][i]):.2g} {shown(unit)} at most.",
    )  # fmt: skip


def _errors(series: Mapping[str, Any], reach: Sequence[float]) -> Chart:
    t, segment_t = _values(series["t"]), _values(series["segment_t"])
    curves, largest = [], {"raw": 0.0, "defect": 0.0, "uncertainty": 0.0}
    for i, component in enumerate(series["components"]):
        name = shown(component)
        size = max(_largest(series["reference"][i]), FLOOR * reach[i]) or 1.0
        rows = (
            ("raw", "raw error", t, _values(series["error"][i]) / size),
            ("uncertainty", "uncertainty", segment_t, _values(series["defect_uncertainty"][i])),
            ("defect", "defect", segment_t, _values(series["defect"][i])),
        )
        for role, told, x, y in rows:
            curves.append(Curve(name, f"{name}, {told}", role, i, x, np.abs(y)))
            largest[role] = max(largest[role], _largest(y.tolist()))
    raw, defect, uncertainty = (largest[role] for role in ("raw", "defect", "uncertainty"))
    return Chart(
        "Error over time", "t [s]", "relative error", False, True, True, tuple(curves), None,
        "Line: raw error of the whole run at the shipped step, of the amplitude. Marks: defect of"
        " each extrapolated segment, of the movement; thin line: its uncertainty.",
        f"Largest of any component among these samples: raw error {percent(raw)}, defect of an"
        f" extrapolated segment {sci(defect)}, its uncertainty {sci(uncertainty)}.",
    )  # fmt: skip


def _convergence(case: Mapping[str, Any]) -> Chart:
    found, plain = case["series"]["convergence"], case["series"]["plain"]
    h, raw = _values(found["h"]), _values(found["raw"])
    draws = _values(found["draws"])
    curves = [
        Curve("segments", "segments, raw", "rungs", 0, h, raw),
        Curve("limit", "change of the limit", "draws", 0, h[1 : len(draws) + 1], draws),
        Curve(
            "whole run", "whole run, raw", "plain", 0, _values(plain["h"]), _values(plain["error"])
        ),
    ]
    slope, whose = case["order"], "observed"
    if slope is None:
        slope, whose = case.get("claimed_order"), "claimed"
    if slope is not None and len(h) > 1 and raw[-1] > 0:
        ends = np.array(_ends(np.concatenate([curve.x for curve in curves])))
        label = f"slope {slope:.2f} ({whose})"
        guide = raw[-1] * (ends / h[-1]) ** slope
        curves.append(Curve(label, label, "guide", 0, ends, guide))
    told = f"the error of the segments falls from {sci(_at(raw, 0))} to {sci(_at(raw, -1))}"
    return Chart(
        "Convergence", "step h [s]", "relative error", True, True, False, tuple(curves), None,
        "Circles: root mean square over the segments, step by step. Squares: whole runs, largest"
        " error. Triangles: how far each finer step still moved the limit. Dots: the slope.",
        f"As the step falls from {quantity(_at(h, 0), 's')} to {quantity(_at(h, -1), 's')},"
        f" {told}; the last one moved the extrapolated limit by {sci(_at(draws, -1))}.",
    )  # fmt: skip


def _values(row: Row) -> Array:
    values: Array = np.array([np.nan if value is None else value for value in row], dtype=float)
    return values


def _at(values: Array, place: int) -> float | None:
    return float(values[place]) if len(values) and np.isfinite(values[place]) else None


def _largest(row: Row) -> float:
    return max(
        (abs(value) for value in row if value is not None and np.isfinite(value)), default=0.0
    )


def _ends(values: Array) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
