"""Compare two runs: which cases changed, and by how much."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.records.base import Number, SourceLine
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.history import digits_known
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.terminal.versions import (
    MOST_TOLD,
    error_change,
    print_changes,
    print_text,
    verdicts,
)
from physics_crosscheck.harness.results.issues import explained_alike
from physics_crosscheck.harness.results.next_steps import ProposedChange, changes_of
from physics_crosscheck.harness.results.status import counted

Kind = Literal["verdict", "new", "gone", "digits", "global error", "step"]
"""Kinds of changes of a case, the worst first."""

KINDS: tuple[Kind, ...] = ("verdict", "gone", "new", "digits", "global error", "step")

DIGITS_MOVED = 0.5
"""Minimum change in digits to report; rounding alone changes a few tenths."""

ERROR_MOVED = 0.01
"""Minimum relative change of a global error to report.

Changes from rounding in an engine's version, or from rounding in a chaotic motion, are smaller.
"""


@dataclass(frozen=True, kw_only=True)
class CaseMovement:
    """A case in two runs.

    Attributes:
        id: its name.
        kinds: kinds of changes; empty without a change.
        before, after: outcomes; None if the run lacks the case.
        digits: digits that agree in every component, in each run; None if unknown.
        global_error: global error in each run.
        step: the model's time step in each run, seconds.
        reason: reason in the later run.
    """

    id: CaseId
    kinds: tuple[Kind, ...]
    before: Outcome | None
    after: Outcome | None
    digits: tuple[Number, Number]
    global_error: tuple[Number, Number]
    step: tuple[Number, Number]
    reason: str

    @property
    def worse(self) -> bool:
        """True if its verdict is worse or fewer digits agree."""
        if self.before is None or self.after is None:
            return False
        if self.before is not self.after:
            return self.after.severity > self.before.severity
        return "digits" in self.kinds and (self.digits[1] or 0.0) < (self.digits[0] or 0.0)


@dataclass(frozen=True, kw_only=True)
class TwoRuns:
    """Changes from one run to another.

    Attributes:
        before, after: times of the runs, UTC.
        versions: (name, before, after) of those that differ; "none" if not installed.
        fixed, broken: causes in the earlier run only, and in the later one only: a line each.
        cases: all cases, changed ones first.
    """

    before: str
    after: str
    versions: tuple[tuple[str, str, str], ...]
    fixed: tuple[str, ...]
    broken: tuple[str, ...]
    cases: tuple[CaseMovement, ...]

    @property
    def moved(self) -> tuple[CaseMovement, ...]:
        """The changed cases."""
        return tuple(case for case in self.cases if case.kinds)


def two_runs(before: Results, after: Results) -> TwoRuns:
    """Compare a run with an earlier one by the names of the cases, in any folder."""
    was, now = _named(before.cases), _named(after.cases)
    cases = [_movement(key[0], was.get(key), now.get(key)) for key in dict.fromkeys([*was, *now])]
    then, today = _causes(before), _causes(after)
    return TwoRuns(
        before=before.created,
        after=after.created,
        versions=tuple(_versions(before.versions, after.versions)),
        fixed=tuple(one for one in then if one not in today),
        broken=tuple(one for one in today if one not in then),
        cases=tuple(sorted(cases, key=_first)),
    )


def headline(runs: TwoRuns) -> str:
    """Return one line: how many cases changed, and how."""
    counts = Counter(kind for case in runs.moved for kind in case.kinds)
    kinds = {
        "verdict": "with another verdict", "new": "new", "gone": "gone",
        "digits": "with another difference", "global error": "with another error at dt",
        "step": "with another dt",
    }  # fmt: skip
    parts = [f"{counts[kind]} {kinds[kind]}" for kind in KINDS if counts[kind]]
    worse = sum(case.worse for case in runs.cases)
    line = f"{counted(len(runs.cases), 'case')}: {', '.join(parts) or 'nothing changed'}"
    return f"{line}; {worse} worse" if worse else line


def digits_change(then: Number, now: Number) -> str:
    """Return the change in agreeing digits."""
    if then is None and now is None:
        return "-"
    before, after = ("-" if one is None else f"{one:.1f}" for one in (then, now))
    return before if before == after else f"{before} -> {after}"


def print_two_runs(console: Console, runs: TwoRuns) -> None:
    """Print the summary, then what changed, worst first."""
    print_text(console, f"{'FAIL' if runs.moved else 'ok'}  {headline(runs)}")
    for what, then, now in runs.versions:
        print_text(console, f"{what} {then} -> {now}")
    both = [case for case in runs.moved if case.before is not None and case.after is not None]
    if shown_causes := both[:MOST_TOLD]:
        _print_table(console, shown_causes)
    if len(both) > MOST_TOLD:
        print_text(console, f"and {len(both) - MOST_TOLD} more, on the page")
    for kind in ("gone", "new"):
        models: dict[str, list[str]] = {}
        for case in runs.moved:
            if kind in case.kinds:
                models.setdefault(str(case.id.of_model), []).append(case.id.scenario)
        for model, scenarios in models.items():
            print_text(console, f"{kind}  {model}: {', '.join(scenarios)}")
    for line in runs.fixed:
        print_text(console, f"fixed  {line}")
    for line in runs.broken:
        print_text(console, f"new fault  {line}")


def _print_table(console: Console, cases: Sequence[CaseMovement]) -> None:
    rows = [
        (
            str(case.id),
            ", ".join(case.kinds),
            verdicts(case.before, case.after),
            digits_change(*case.digits),
            error_change(*case.global_error),
        )
        for case in cases
    ]
    print_changes(console, "digits", rows)


def _named(cases: Iterable[Case]) -> Mapping[tuple[CaseId, int], Case]:
    """Return cases by name and, for equal names, their order."""
    times: Counter[CaseId] = Counter()
    by_name = {}
    for case in cases:
        by_name[case.id, times[case.id]] = case
        times[case.id] += 1
    return by_name


def _movement(name: CaseId, was: Case | None, now: Case | None) -> CaseMovement:
    digits = digits_known(was), digits_known(now)
    errors, steps = _of_run("global_error", was, now), _of_run("time_step", was, now)
    before, after = (None if one is None else one.outcome for one in (was, now))
    kinds: list[Kind] = []
    if before is None or after is None:
        kinds.append("new" if before is None else "gone")
    else:
        if before is not after:
            kinds.append("verdict")  # digits and error change with it
        else:
            if None not in digits and abs((digits[1] or 0.0) - (digits[0] or 0.0)) >= DIGITS_MOVED:
                kinds.append("digits")
            if _apart(*errors):
                kinds.append("global error")
        if None not in steps and steps[0] != steps[1]:
            kinds.append("step")
    return CaseMovement(
        id=name,
        kinds=tuple(kinds),
        before=before,
        after=after,
        digits=digits,
        global_error=errors,
        step=steps,
        reason="" if now is None else now.reason,
    )


def _of_run(name: str, was: Case | None, now: Case | None) -> tuple[Number, Number]:
    then, today = (
        None if one is None or one.full_run is None else getattr(one.full_run, name)
        for one in (was, now)
    )
    return then, today


def _apart(then: Number, now: Number) -> bool:
    if then is None or now is None:
        return then is not now
    return abs(now - then) > ERROR_MOVED * max(abs(then), abs(now))


def _causes(results: Results) -> list[str]:
    """Return the faults of each explained model file, a line per number."""
    lines = (
        f"{alike[0].system}/{_change_text(change)}"
        for alike in explained_alike(results.models)
        for change in changes_of(alike[0])
    )
    return list(dict.fromkeys(lines))


def _change_text(change: ProposedChange) -> str:
    shorter = tuple(map(_short, change.locations))
    return str(dataclasses.replace(change, locations=shorter))


def _short(where: SourceLine) -> SourceLine:
    """Return a line without its folders, which can differ between runs."""
    return replace(where, file=where.file.replace("\\", "/").rpartition("/")[2])


def _versions(
    before: Mapping[str, str | None], after: Mapping[str, str | None]
) -> Iterator[tuple[str, str, str]]:
    for name in dict.fromkeys([*before, *after]):
        then, now = before.get(name) or "none", after.get(name) or "none"
        if then != now:
            yield name, then, now


def _first(case: CaseMovement) -> tuple[bool, int, float]:
    """Return a sort key: worse cases first, then by what changed and by how much."""
    rank = min((KINDS.index(kind) for kind in case.kinds), default=len(KINDS))
    digits = abs((case.digits[1] or 0.0) - (case.digits[0] or 0.0))
    return not case.worse, rank, -digits
