"""Every case's numbers, packed once, for its own plots and for those of others beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.report.packs import Column, Pack
from harness.report.text import quantity, shown
from reference.numeric import Array

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """One case's motion at its shipped step.

    Attributes:
        case: its record.
        label: engine and file.
        step: the shipped one.
        pack: where its numbers are.
        t: sample times.
        reference, engine: components there.
        error, seconds: of the plain runs, coarsest first; seconds None where they were not taken.
    """

    case: Record
    label: str
    step: str
    pack: Pack
    t: Column
    reference: tuple[Column, ...]
    engine: tuple[Column, ...]
    error: Column
    seconds: Column | None


def runs(cases: Sequence[Record]) -> list[Run | None]:
    """The run of each case; None for those without series."""
    return [None if case["series"] is None else _run(case, i) for i, case in enumerate(cases)]


def _run(case: Record, place: int) -> Run:
    series = case["series"]
    pack = Pack(f"pack-case-{place}")
    step = quantity(case["shipped_step"], "s", 3)
    seconds = series["plain"].get("seconds")
    return Run(
        case,
        f"{shown(case['engine'])}, {shown(case['model'])}",
        step,
        pack,
        pack.column(series["t"], 7),
        tuple(pack.column(row, 6) for row in series["reference"]),
        tuple(pack.column(single(row), 6) for row in series["engine"]),
        pack.column(single(series["plain"]["error"]), 5),
        None if seconds is None else pack.column(seconds, 3),
    )


def values(row: Sequence[float | None]) -> Array:
    """Numbers of results; nan for those that are missing."""
    # As floats, None is nan.
    return np.array(row, dtype=float)


def single(row: Sequence[float | None]) -> Array:
    """The same, without what is beyond the range of a plot: a motion that has blown up."""
    found = values(row)
    return np.where(np.abs(found) > np.finfo(np.float32).max, np.nan, found)


def largest(row: Sequence[float | None] | Array) -> float:
    """Largest finite magnitude; 0 for none."""
    found = np.abs(np.asarray(row, dtype=float))
    finite = found[np.isfinite(found)]
    return float(finite.max()) if finite.size else 0.0


def ends(found: Array) -> tuple[float, float]:
    """Least and largest finite value; zeros for none."""
    finite = found[np.isfinite(found)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
