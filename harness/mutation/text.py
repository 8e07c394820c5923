"""Mutation results for the terminal: literals, known mistakes, and a summary line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from physics_crosscheck.harness.mutation.faults import FAULTS, SIZES
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutation
from physics_crosscheck.harness.render.terminal.console import wrapped
from physics_crosscheck.harness.results.status import counted

MARKS = {
    FaultVerdict.NAMED: "named",
    FaultVerdict.CAUGHT: "caught",
    FaultVerdict.REFUSED: "refused",
    FaultVerdict.UNTESTED: ".",
    FaultVerdict.MISSED: "MISSED",
}

HEADS = {
    FaultVerdict.NAMED: "named",
    FaultVerdict.CAUGHT: "caught",
    FaultVerdict.MISSED: "MISSED",
    FaultVerdict.REFUSED: "refused",
    FaultVerdict.UNTESTED: "no effect",
}
"""Columns of the table of known mistakes: verdicts and their headers."""


def mutation_lines(rows: Sequence[Mutation], width: int = 160) -> list[str]:
    """Return the summary, tables by model and by mistake, and the faults without a right cause.

    Args:
        rows: rows of all models.
        width: columns; a table that is wider becomes a list.
    """
    lines: list[str] = []
    literal = _of(rows, FaultKind.LITERAL)
    first = max((len(row.location) for row in literal), default=10)
    for model, group in groupby(rows, _model):
        mine = list(group)
        lines += ["", str(model), *_literals(_of(mine, FaultKind.LITERAL), first, width)]
        lines += [
            f"  {row.name}, {row.location}: {row.verdict}, {row.message}"
            for row in _of(mine, FaultKind.NONE)
        ]
    lines += _mistakes(_of(rows, FaultKind.MISTAKE), width)
    lines += _unnamed(rows)
    return [part for line in (summary(rows), *lines) for part in wrapped(line, width)]


def _of(rows: Sequence[Mutation], kind: FaultKind) -> list[Mutation]:
    return [row for row in rows if row.kind is kind]


def _model(row: Mutation) -> ModelId:
    return ModelId(system=row.system, model=row.model, engine=row.engine)


def _literals(rows: Sequence[Mutation], width: int, columns: int) -> Iterator[str]:
    """Yield a row for each literal with a mark for each fault, in a table if it fits."""
    narrow = 2 + width + 15 + 10 * len(FAULTS) > columns
    if rows and not narrow:
        head = "".join(f"{label:>10}" for label in FAULTS)
        yield f"  {'literal':<{width}}{'detected from':>15}{head}"
    for location, marks in groupby(rows, lambda r: r.location):
        faults = {row.name: row for row in marks}
        first = next(iter(faults.values())).first_caught
        seen = "untested" if first is None else f"{first:.0e}"
        if narrow:
            marked = ", ".join(f"{name} {MARKS[row.verdict]}" for name, row in faults.items())
            result = seen if first is None else f"detected from {seen}; {marked}"
            yield f"  {location}: {result}"
            continue
        cells = "".join(
            f"{MARKS[faults[label].verdict] if label in faults else '':>10}" for label in FAULTS
        )
        yield f"  {location:<{width}}{seen:>15}{cells}"


def _mistakes(rows: Sequence[Mutation], columns: int) -> Iterator[str]:
    """Yield a row for each kind of mistake: count, verdicts, and smallest detectable share."""
    names = list(dict.fromkeys(row.name for row in rows))
    if not names:
        return
    width = max(map(len, names)) + 2
    head = "".join(f"{title:>10}" for title in HEADS.values())
    narrow = width + 6 + 10 * len(HEADS) + 27 > columns
    yield ""
    if narrow:
        yield "known mistakes"
    else:
        yield f"{'known mistakes':<{width}}{'made':>6}{head}  detected from this share"
    for name in names:
        mine = [row for row in rows if row.name == name]
        counts = [sum(row.verdict is verdict for row in mine) for verdict in HEADS]
        shares = [row.first_caught for row in mine if row.first_caught is not None]
        worst = f"  {max(shares):.0e}" if shares else ""
        if narrow:
            parts = zip(counts, HEADS.values(), strict=True)
            verdicts = ", ".join(f"{number} {title}" for number, title in parts if number)
            limit = f"; detected from {worst.strip()}" if worst else ""
            yield f"  {name}: {len(mine)} made, {verdicts}{limit}"
            continue
        cells = "".join(f"{count or '.':>10}" for count in counts)
        yield f"{name:<{width}}{len(mine):>6}{cells}{worst}"


def _unnamed(rows: Sequence[Mutation]) -> Iterator[str]:
    """Yield faults with a wrong cause and missed faults, including known mistakes that were
    refused.
    """
    planted = [row for row in rows if row.kind is not FaultKind.NONE]
    none, mistakes = _of(rows, FaultKind.NONE), _of(rows, FaultKind.MISTAKE)
    chosen = {
        "caught, but with another cause:": _with(planted, FaultVerdict.CAUGHT),
        "missed:": _with(rows, FaultVerdict.MISSED),
        "false alarms:": [row for row in none if row.verdict is not FaultVerdict.AGREES],
        "refused by the engine:": _with(mistakes, FaultVerdict.REFUSED),
    }
    for title, some in chosen.items():
        if some:
            yield ""
            yield title
        for row in some:
            message = f": {row.message}" if row.message else ""
            yield f"  {_model(row)} {row.location} {row.name}{message}"


def _with(rows: Sequence[Mutation], verdict: FaultVerdict) -> list[Mutation]:
    return [row for row in rows if row.verdict is verdict]


def summary(rows: Sequence[Mutation]) -> str:
    """Return one line: how many of the visible faults were caught, and how many named."""
    literal, mistakes = _of(rows, FaultKind.LITERAL), _of(rows, FaultKind.MISTAKE)
    small = [row for row in literal if row.name in SIZES]
    large = [row for row in literal if row.name not in SIZES]
    none = _of(rows, FaultKind.NONE)
    agree = len(_with(none, FaultVerdict.AGREES))
    unseen = {(_model(row), row.location) for row in _with(literal, FaultVerdict.UNTESTED)}
    return (
        f"small faults: {_counts(small)}; mistakes: {_counts([*mistakes, *large])};"
        f" another dt or integrator: {agree} of {len(none)} agree;"
        f" {counted(len(unseen), 'literal')} untested (no effect on motion)"
    )


def _counts(rows: Sequence[Mutation]) -> str:
    refused = len(_with(rows, FaultVerdict.REFUSED))
    seen = len(rows) - refused - len(_with(rows, FaultVerdict.UNTESTED))
    caught = seen - len(_with(rows, FaultVerdict.MISSED))
    named = len(_with(rows, FaultVerdict.NAMED))
    return f"{caught} of {seen} caught, {named} named, {refused} refused by the engine"
