"""Results of `check` as a table, a page and plots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from io import StringIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from physics_crosscheck.harness.records.base import Number, Rows
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.terminal.console import WORDS
from physics_crosscheck.harness.render.terminal.problems import print_problems
from physics_crosscheck.harness.render.terminal.table import summary
from .markup import badge, block, line, paper, shown, table
from .optional import new_axes
from .trajectory import MotionError, Trajectory, units_of_rates

if TYPE_CHECKING:
    from matplotlib.axes import Axes

What = Literal["verdicts", "steps"]

MOST_ROWS = 60
"""Maximum number of rows of a page; `to_frame` has all."""

_OUTCOME = re.compile(rf" *({'|'.join(WORDS.values())}) +(.*)")
_OF_WORD = {word: Outcome(name) for name, word in WORDS.items()}


def columns(cases: Iterable[Case]) -> Mapping[str, list[object]]:
    """Return table columns with one row per case; missing numbers are nan."""
    rows = [_row(case) for case in cases]
    heads = list(rows[0] if rows else _row(_NONE))
    return {head: [row[head] for row in rows] for head in heads}


_NONE = Case(system="", model="", scenario="", engine="", folder="", outcome=Outcome.ABSENT)


def _tenth(case: Case) -> Number:
    """Return the time step for a global error of 0.1 %."""
    run = case.full_run
    return None if run is None else {one.target: one.step for one in run.steps_for}.get(0.001)


def _row(case: Case) -> dict[str, object]:
    verdict, run = case.verdict, case.full_run
    return {
        "system": case.system,
        "model": case.model,
        "engine": case.engine,
        "scenario": case.scenario,
        "outcome": str(case.outcome),
        "discrepancy": _number(None if verdict is None else verdict.discrepancy),
        "uncertainty": _number(None if verdict is None else verdict.uncertainty),
        "component": "" if verdict is None else verdict.component,
        "global error": _number(None if run is None else run.global_error),
        "step (s)": _number(None if run is None else run.time_step),
        "order": _number(None if run is None else run.order),
        "step for 0.1 % (s)": _number(_tenth(case)),
        "energy error": _number(None if run is None else run.energy_error),
        "integrator": "" if run is None else run.integrator,
        "accepted": case.accepted,
        "reason": case.reason,
        "run time (s)": case.seconds,
    }


def _number(value: Number) -> float:
    return float("nan") if value is None else value


def page(results: Results) -> str:
    """Return the table of verdicts, followed by the problems with their causes."""
    heads = [
        *("system", "model", "engine", "scenario", "outcome"),
        *("discrepancy", "uncertainty", "global error", "step (s)", "order", "0.1 % at (s)"),
    ]
    cases = results.cases[:MOST_ROWS]
    hidden = len(results.cases) - len(cases)
    more = [line(f"and {hidden} more, in .cases and .to_frame()", faint=True)] if hidden else []
    return block(
        table(heads, map(_cells, cases), text_columns=5),
        *more,
        *(_outcome_badge(text) for text in _troubles(results)),
        line(summary(results), strong=True),
    )


def _cells(case: Case) -> list[str]:
    verdict, run = case.verdict, case.full_run
    return [
        *(escape(x) for x in (case.system, case.model, case.engine, case.scenario)),
        badge(case.outcome) + (" accepted" if case.accepted else ""),
        shown(None if verdict is None else verdict.discrepancy, "{:.1e}"),
        shown(None if verdict is None else verdict.uncertainty, "{:.1e}"),
        shown(None if run is None else run.global_error, "{:.2%}"),
        shown(None if run is None else run.time_step, "{:g}"),
        shown(None if run is None else run.order, "{:.2f}"),
        shown(_tenth(case), "{:.2g}"),
    ]


def _troubles(results: Results) -> list[str]:
    """Return the problems as the terminal prints them."""
    text = StringIO()
    print_problems(paper(text, 10_000), results)
    return text.getvalue().splitlines()


def _outcome_badge(text: str) -> str:
    match = _OUTCOME.fullmatch(text)
    if match is not None:
        return f'<div style="margin:8px 0 0">{badge(_OF_WORD[match[1]])} {escape(match[2])}</div>'
    if not text.strip():
        return ""
    inner = len(text) - len(text.lstrip())
    style = f"padding-left:{inner * 0.6:.1f}em;overflow-wrap:anywhere;white-space:pre-wrap"
    style += "" if inner else ";font-weight:600;margin-top:8px"
    return f'<div style="{style}">{escape(text.strip())}</div>'


@dataclass(frozen=True, kw_only=True)
class Trajectories:
    """The motions of a case at the file's time step, as far as `results.json` has them.

    Attributes:
        simulated: motion of the model in its engine.
        reference: motion of the equations, at the same times.
        errors: simulated minus reference.
    """

    simulated: Trajectory
    reference: Trajectory
    errors: Trajectory


def trajectories(results: Results, case: Case) -> Trajectories:
    """Return the motions of a case.

    Raises:
        MotionError: if it has none, with the reason.
    """
    if case.series is None or case.full_run is None:
        raise MotionError(f"{case.id} has no motion: {case.outcome}, {case.reason}")
    series, run = case.series, case.full_run
    system = next((one for one in results.systems if one.folder == case.folder), None)
    coordinate_units = [] if system is None else [c.unit or "1" for c in system.coordinates]
    units = (
        (*coordinate_units, *units_of_rates(coordinate_units))
        if coordinate_units
        else ("?",) * len(series.components)
    )
    step = _number(run.time_step)
    engine = f"{case.model} in {case.engine}, {run.integrator}, a step of {step:g} s"

    def trajectory_of(rows: Rows, origin: str) -> Trajectory:
        columns = [[_number(value) for value in row] for row in rows]
        return Trajectory(
            t=np.array([_number(time) for time in series.t]),
            names=series.components,
            units=units,
            values=np.array(columns).T,
            uncertainty=None,
            system=case.system,
            scenario=case.scenario,
            origin=origin,
            step=step,
        )

    return Trajectories(
        simulated=trajectory_of(series.engine, engine),
        reference=trajectory_of(series.reference, "the equations"),
        errors=trajectory_of(series.error, f"{engine} minus the equations"),
    )


def plot(results: Results, what: What, ax: Axes | None) -> Axes:
    """Draw verdicts, or errors over the time step.

    Raises:
        ValueError: if `what` has another value, or no case has the data.
        ImportError: without matplotlib.
    """
    if what not in ("verdicts", "steps"):
        raise ValueError(f"{what!r} can't be drawn; 'verdicts' and 'steps' can")
    drawn = [case for case in results.cases if case.verdict is not None]
    if what == "steps":
        drawn = [case for case in drawn if case.series is not None]
    if not drawn:
        raise ValueError(f"no case has {what}, so there is nothing to draw")
    if ax is None:
        height = 0.28 * len(drawn) + 0.8 if what == "verdicts" else 3.4
        ax = new_axes(1, height)[0]
    (_verdicts if what == "verdicts" else _steps)(results, drawn, ax)
    return ax


def _verdicts(results: Results, cases: list[Case], ax: Any) -> None:
    """Draw discrepancy and uncertainty of each case on one logarithmic axis."""
    rows = range(len(cases))
    verdicts = [case.verdict for case in cases if case.verdict is not None]
    ax.plot([_number(v.discrepancy) for v in verdicts], rows, "o", label="discrepancy")
    ax.plot(
        [_number(v.uncertainty) for v in verdicts], rows, "|", markersize=12, label="uncertainty"
    )
    ax.axvline(results.resolution, linestyle=":", color="grey", label="resolution asked")
    ax.set_xscale("log")
    ax.set_yticks(rows, [f"{case.id}  {case.outcome}" for case in cases], fontsize="small")
    ax.invert_yaxis()
    ax.set_xlabel("of how far a component moves over a segment")
    ax.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3)
    ax.grid(alpha=0.3, axis="x")


def _steps(_: Results, cases: list[Case], ax: Any) -> None:
    """Draw global errors over the time step, with a ring at the file's own step."""
    for case in cases:
        assert case.series is not None
        runs = case.series.full_runs
        points = sorted(
            (_number(h), _number(error)) for h, error in zip(runs.h, runs.error, strict=True)
        )
        (curve,) = ax.plot(
            *zip(*points, strict=True), "o-", markersize=3, linewidth=1, label=str(case.id)
        )
        run = case.full_run
        if run is not None:
            own_step = [_number(run.time_step)], [_number(run.global_error)]
            ax.plot(*own_step, "o", markersize=9, fillstyle="none", color=curve.get_color())
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("step (s)")
    ax.set_ylabel("global error, of the amplitude")
    if len(cases) <= 12:
        ax.legend(fontsize="x-small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    ax.grid(alpha=0.3, which="both")
