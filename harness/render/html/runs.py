"""Numbers of each case, packed once for its own plots and for comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.records.base import Numbers
from physics_crosscheck.harness.records.case import Case, FullRun, Series, StepErrors, Verdict
from physics_crosscheck.harness.render.html.packs import Array, Column, Pack
from physics_crosscheck.harness.render.html.text import quantity


@dataclass(frozen=True, kw_only=True)
class CaseRun:
    """One case's motion at the model's time step.

    Attributes:
        case: its record.
        verdict, full_run, series: the case's own.
        label: engine and file.
        step: time step of the model.
        pack: pack with its numbers.
        t: sample times.
        reference, engine: components at these times.
        error, seconds: values of the full runs, coarsest first; seconds can be None: not measured.
    """

    case: Case
    verdict: Verdict
    full_run: FullRun
    series: Series
    label: str
    step: str
    pack: Pack
    t: Column
    reference: tuple[Column, ...]
    engine: tuple[Column, ...]
    error: Column
    seconds: Column | None


def runs(cases: Sequence[Case]) -> list[CaseRun | None]:
    """Return the run of each case; None without series."""
    return [_run(case, place) for place, case in enumerate(cases)]


def _run(case: Case, place: int) -> CaseRun | None:
    verdict, full_run, series = case.verdict, case.full_run, case.series
    if verdict is None or full_run is None or series is None:
        return None
    pack = Pack(f"pack-case-{place}")
    seconds = series.full_runs.seconds
    order = coarse_to_fine(series.full_runs)
    return CaseRun(
        case=case,
        verdict=verdict,
        full_run=full_run,
        series=series,
        label=f"{case.engine}, {case.model}",
        step=quantity(full_run.time_step, "s", 3),
        pack=pack,
        t=pack.column(series.t, 7),
        reference=tuple(pack.column(row, 6) for row in series.reference),
        engine=tuple(pack.column(single(row), 6) for row in series.engine),
        error=pack.column(single(series.full_runs.error)[order], 5),
        seconds=pack.column(values(seconds)[order], 3) if any(seconds) else None,
    )


def coarse_to_fine(runs: StepErrors) -> NDArray[np.intp]:
    """Return the order of the runs by decreasing step; the records start with the model's step."""
    return np.argsort(-values(runs.h))


def values(row: Numbers) -> Array:
    """Return numbers of results as an array; nan if missing."""
    # Converting to float makes None nan.
    return np.array(row, dtype=float)


def single(row: Numbers) -> Array:
    """Return numbers; nan for those beyond plotting range, as in a diverged motion."""
    numbers = values(row)
    return np.where(np.abs(numbers) > np.finfo(np.float32).max, np.nan, numbers)


def largest(row: Numbers | Array) -> float:
    """Return the largest finite magnitude; 0 without one."""
    magnitudes = np.abs(np.asarray(row, dtype=float))
    finite = magnitudes[np.isfinite(magnitudes)]
    return float(finite.max()) if finite.size else 0.0


def ends(numbers: Array) -> tuple[float, float]:
    """Return the minimum and maximum of the finite values; zeros without one."""
    finite = numbers[np.isfinite(numbers)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
