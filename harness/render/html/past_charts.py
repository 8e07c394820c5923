"""Plots of past runs: digits and global error over time, by engine version."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.history import Past
from physics_crosscheck.harness.render.html.packs import Chart, Curve, Pack
from physics_crosscheck.harness.render.html.text import percent, shown
from physics_crosscheck.harness.render.terminal.models_table import finite_values, is_chaotic
from physics_crosscheck.harness.results.status import counted

HISTORY = "History"

MAX_CURVES = 12
"""Maximum number of curves in one plot; more would be indistinguishable."""

COMMIT_LETTERS = 9
"""Number of letters of a commit to show."""

CHANGED_DIGITS = 0.5
"""Smallest change of agreeing digits to name."""

LAST = 6
"""Number of most recent commits to name."""

DATE_DIGITS = 11
"""Significant digits of a date in milliseconds: enough for seconds."""

Rows = Sequence[tuple[float, float]]
"""(milliseconds since 1970-01-01 UTC, value)."""


def by_case(history: Iterable[Past]) -> dict[CaseId, list[Past]]:
    """Group past runs by case."""
    by_name: dict[CaseId, list[Past]] = {}
    for past in history:
        by_name.setdefault(past.id, []).append(past)
    return by_name


def case_history(pack: Pack, past: Sequence[Past]) -> tuple[Chart, ...]:
    """Plot a case's past runs with one curve per version; no plots for fewer than two runs."""
    dated = [(when, one) for one in past if (when := _when(one.time)) is not None]
    if len(dated) < 2:
        return ()
    start = min(when for when, _ in dated)
    versions = dict.fromkeys(one.version for _, one in dated)

    def rows(value: Callable[[Past], Number]) -> dict[str, Rows]:
        name = shown(past[0].engine)
        return {
            shown(f"{name} {version}".strip()): [
                (_milliseconds(when), number)
                for when, one in dated
                if one.version == version and (number := value(one)) is not None
            ]
            for version in versions
        }

    commits = list(dict.fromkeys(one.commit[:COMMIT_LETTERS] for _, one in dated if one.commit))
    commit_note = f" Commits: {shown(', '.join(commits[-LAST:]))}." if commits else ""
    return _charts(
        pack,
        rows(lambda one: one.digits),
        rows(lambda one: one.global_error),
        f"{counted(len(dated), 'run')} since {start:%Y-%m-%d}.{commit_note}",
    )


def run_history(pack: Pack, cases: Sequence[Case], history: Sequence[Past]) -> tuple[Chart, ...]:
    """Plot whole runs with one curve per engine: its fewest digits and its largest error.

    Runs of fewer than half of the present cases were partial and are omitted.
    """
    whole = _whole_runs(cases, history)
    if len(whole) < 2:
        return ()
    start = min(whole)
    chaotic = {case.id for case in cases if is_chaotic(case)}
    engines = list(dict.fromkeys(case.engine for case in cases))[:MAX_CURVES]

    def rows(worst: Callable[[Iterable[float]], float], name: str) -> dict[str, Rows]:
        by_engine: dict[str, Rows] = {}
        for engine in engines:
            points = []
            for when, past in sorted(whole.items()):
                values: list[Number] = [
                    getattr(past_case, name)
                    for past_case in past
                    if past_case.engine == engine
                    and (name == "digits" or past_case.id not in chaotic)
                ]
                if there := finite_values(values):
                    points.append((_milliseconds(when), worst(there)))
            by_engine[shown(engine)] = points
        return by_engine

    return _charts(
        pack,
        rows(min, "digits"),
        rows(max, "global_error"),
        f"{counted(len(whole), 'run')} since {start:%Y-%m-%d}; the worst case of "
        "each engine; errors exclude chaotic motions.",
    )


def _whole_runs(cases: Sequence[Case], history: Sequence[Past]) -> dict[datetime, list[Past]]:
    """Return the runs of at least half of the present cases, by time."""
    present = {case.id for case in cases}
    runs: dict[datetime, list[Past]] = {}
    for past in history:
        if past.id in present and (when := _when(past.time)) is not None:
            runs.setdefault(when, []).append(past)
    return {
        when: runs[when]
        for when in sorted(runs)
        if 2 * len({past.id for past in runs[when]}) >= len(present)
    }


@dataclass(frozen=True, kw_only=True)
class PastRun:
    """A past run that the reader can pick.

    Attributes:
        time: milliseconds since 1970-01-01 UTC.
        name: date, commit and versions.
        summary: number of its cases by outcome.
        changes: cases whose outcome or digits differ from the run before.
    """

    time: float
    name: str
    summary: str
    changes: tuple[str, ...]


def past_runs(cases: Sequence[Case], history: Sequence[Past]) -> tuple[PastRun, ...]:
    """Return the runs of `run_history`, the earliest first."""
    before: dict[CaseId, Past] = {}
    runs = []
    for when, past in _whole_runs(cases, history).items():
        by_id = {one.id: one for one in past}
        commit = next((one.commit[:COMMIT_LETTERS] for one in past if one.commit), "")
        versions = {f"{one.engine} {one.version}" for one in past if one.version}
        outcomes = Counter(one.outcome for one in by_id.values())
        counts = ", ".join(f"{n} {outcome}" for outcome, n in outcomes.items())
        name = " · ".join(filter(None, (f"{when:%Y-%m-%d %H:%M}", commit, *sorted(versions))))
        changes = [_change(before[key], one) for key, one in by_id.items() if key in before]
        runs.append(
            PastRun(
                time=_milliseconds(when),
                name=shown(name),
                summary=f"{counted(len(by_id), 'case')}: {counts}",
                changes=tuple(filter(None, changes)),
            )
        )
        before |= by_id
    return tuple(runs) if len(runs) > 1 else ()


def _change(before: Past, after: Past) -> str:
    """Return how a case differs from the run before; empty if it does not."""
    if before.outcome is not after.outcome:
        return shown(f"{after.id}: {before.outcome} → {after.outcome}")
    then, now = before.digits, after.digits
    if then is not None and now is not None and abs(now - then) >= CHANGED_DIGITS:
        return shown(f"{after.id}: {then:.1f} → {now:.1f} digits")
    return ""


def _charts(
    pack: Pack, digits: Mapping[str, Rows], errors: Mapping[str, Rows], note: str
) -> tuple[Chart, ...]:
    charts = []
    for title, label, rows, log, form in (
        ("Agreeing digits", "digits", digits, False, "{:.1f}"),
        ("Error at dt", "relative error", errors, True, ""),
    ):
        curves = tuple(
            Curve(
                label=name,
                role="past",
                place=place,
                x=pack.column([date for date, _ in points], DATE_DIGITS),
                y=pack.column([value for _, value in points], 4),
            )
            for place, (name, points) in enumerate(rows.items())
            if points
        )
        if not curves:
            continue
        values = [value for points in rows.values() for _, value in points]
        low, high = min(values), max(values)
        ends = (form.format(low), form.format(high)) if form else (percent(low), percent(high))
        charts.append(
            Chart(
                part=HISTORY,
                title=title,
                x_label="date, UTC",
                dates=True,
                over_time=True,
                y_label=label,
                curves=curves,
                key="One mark per run; colour and shape identify the curve.",
                summary=f"{note} Between {ends[0]} and {ends[1]}.",
                log_y=log,
                y_limits=None if log else (0.0, max(16.0, high)),
            )
        )
    return tuple(charts)


def _when(time: str) -> datetime | None:
    try:
        date = datetime.fromisoformat(time)
    except ValueError:
        return None
    return date.astimezone(UTC) if date.tzinfo else date.replace(tzinfo=UTC)


def _milliseconds(when: datetime) -> float:
    return 1e3 * when.timestamp()
