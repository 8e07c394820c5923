"""A page on the changes between two runs, in the report's style, without a script."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.diff import Diff, RunDiff
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.cases import SYMBOLS
from physics_crosscheck.harness.render.html.text import percent, shown, slug
from physics_crosscheck.harness.render.terminal.two_runs import digits_change, headline
from physics_crosscheck.harness.results.status import counted


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """A case; `links` lead to it in each run's report, empty if missing."""

    name: str
    kinds: str
    worse: bool
    before: str
    after: str
    symbols: tuple[str, str]
    links: tuple[str, str]
    digits: str
    errors: tuple[str, str]
    ratio: str
    steps: tuple[str, str]
    reason: str


@dataclass(frozen=True, kw_only=True)
class TwoRunsPage:
    """The page; `reports` has each run's time and the path of its report."""

    title: str
    headline: str
    reports: tuple[tuple[str, str], ...]
    versions: tuple[tuple[str, str, str], ...]
    fixed: tuple[str, ...]
    broken: tuple[str, ...]
    moved: tuple[RunRow, ...]
    same: tuple[RunRow, ...]


def write_two_runs(path: Path, runs: RunDiff, folders: tuple[Path, Path]) -> None:
    """Write the page, with a relative link to each run's report if it exists.

    Args:
        path: path of the page.
        runs: changes between the runs.
        folders: folders with results and report of the earlier and the later run.
    """
    write_whole(path, render_two_runs(runs, path.parent, folders))


def render_two_runs(runs: RunDiff, place: Path, folders: tuple[Path, Path]) -> str:
    """Return the page as HTML, to be saved in the folder `place`."""
    pages = [folder / "index.html" for folder in folders]
    before, after = (
        Path(os.path.relpath(page, place)).as_posix() if page.is_file() else "" for page in pages
    )
    rows = [_row(case, before, after) for case in runs.cases]
    moved = len(runs.changed)
    page = TwoRunsPage(
        title=f"{moved} of {counted(len(rows), 'case')} changed",
        headline=shown(headline(runs)),
        reports=((_time(runs.before), before), (_time(runs.after), after)),
        versions=tuple((shown(a), shown(b), shown(c)) for a, b, c in runs.versions),
        fixed=tuple(map(shown, runs.fixed)),
        broken=tuple(map(shown, runs.broken)),
        moved=tuple(row for row in rows if row.kinds),
        same=tuple(row for row in rows if not row.kinds),
    )
    return template("two_runs.html", page=page)


def _row(case: Diff, before: str, after: str) -> RunRow:
    name = case.id
    fragment = f"#case-{slug(name.system, name.model, name.engine, name.scenario)}"
    then, now = case.global_errors
    before_outcome, after_outcome = case.outcomes
    return RunRow(
        name=shown(name),
        kinds=case.summary,
        worse=case.is_worse,
        before=before_outcome or "none",
        after=after_outcome or "none",
        symbols=(_symbol(before_outcome), _symbol(after_outcome)),
        links=(
            before + fragment if before and case.before else "",
            after + fragment if after and case.after else "",
        ),
        digits=digits_change(*case.digits).replace("->", "→"),
        errors=(percent(then), percent(now)),
        ratio=f"× {now / then:.3g}" if then and now and then != now else "",
        steps=(_seconds(case.time_steps[0]), _seconds(case.time_steps[1])),
        reason=shown(case.after.reason if case.after else ""),
    )


def _time(created: str) -> str:
    """Return the time of a run to the minute."""
    return f"{shown(created)[:16].replace('T', ' ')} UTC"


def _symbol(outcome: Outcome | None) -> str:
    return "" if outcome is None else SYMBOLS[outcome]


def _seconds(step: float | None) -> str:
    return "–" if step is None else f"{step:.3g}\u00a0s"
