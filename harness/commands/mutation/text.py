"""Mutation results for the terminal: literals, known mistakes, and a summary line."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutation
from physics_crosscheck.harness.render.terminal.console import wrapped
from physics_crosscheck.harness.results.status import counted
from .survey import FAULTS, SIZES

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
    """Return the summary, the faults without a right cause, and tables by model and by mistake.

    Args:
        rows: rows of all models.
        width: columns; a table that is wider becomes a list.
    """
    lines = _unnamed(rows)
    literal = _of_kind(rows, FaultKind.LITERAL)
    first = max((len(row.location) for row in literal), default=10)
    for model, group in groupby(rows, _model):
        mine = list(group)
        lines += ["", str(model), *_literals(_of_kind(mine, FaultKind.LITERAL), first, width)]
        lines += [
            f"  {row.name}, {row.location}: {row.verdict}, {row.message}"
            for row in _of_kind(mine, FaultKind.NONE)
        ]
    lines += _mistakes(_of_kind(rows, FaultKind.MISTAKE), width)
    head, *parts = _summary_parts(rows)
    whole = [head, *(f"  {part}" for part in parts), *lines]
    return [part for line in whole for part in wrapped(line, width)]


def _of_kind(rows: Sequence[Mutation], kind: FaultKind) -> list[Mutation]:
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
        # Zero: no slope predicts it, as for shapes.
        seen = "untested" if first is None else f"{first:.0e}" if first else ""
        if narrow:
            marked = ", ".join(f"{name} {MARKS[row.verdict]}" for name, row in faults.items())
            result = f"detected from {seen}; {marked}" if first else seen or marked
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
    narrow = width + 9 + 10 * len(HEADS) + 27 > columns
    yield ""
    if narrow:
        yield "known mistakes"
    else:
        yield f"{'known mistakes':<{width}}{'planted':>9}{head}  detected from this share"
    for name in names:
        mine = [row for row in rows if row.name == name]
        counts = [sum(row.verdict is verdict for row in mine) for verdict in HEADS]
        shares = [row.first_caught for row in mine if row.first_caught]
        worst = f"  {max(shares):.0e}" if shares else ""
        if narrow:
            parts = zip(counts, HEADS.values(), strict=True)
            verdicts = ", ".join(f"{number} {title}" for number, title in parts if number)
            limit = f"; detected from {worst.strip()}" if worst else ""
            yield f"  {name}: {len(mine)} planted, {verdicts}{limit}"
            continue
        cells = "".join(f"{count or '.':>10}" for count in counts)
        yield f"{name:<{width}}{len(mine):>9}{cells}{worst}"


def _unnamed(rows: Sequence[Mutation]) -> list[str]:
    """Return missed faults, those with a wrong cause, and known mistakes that were refused."""
    planted = [row for row in rows if row.kind is not FaultKind.NONE]
    none, mistakes = _of_kind(rows, FaultKind.NONE), _of_kind(rows, FaultKind.MISTAKE)
    chosen = {
        "missed:": _with(rows, FaultVerdict.MISSED),
        "false alarms:": [row for row in none if row.verdict is not FaultVerdict.AGREES],
        "caught, but with another cause:": _with(planted, FaultVerdict.CAUGHT),
        "refused by the engine:": _with(mistakes, FaultVerdict.REFUSED),
    }
    lines: list[str] = []
    for title, some in chosen.items():
        if some:
            lines += ["", title]
        for row in some:
            message = f": {row.message}" if row.message else ""
            lines.append(f"  {_model(row)} {row.location} {row.name}{message}")
    return lines


def _with(rows: Sequence[Mutation], verdict: FaultVerdict) -> list[Mutation]:
    return [row for row in rows if row.verdict is verdict]


def summary(rows: Sequence[Mutation]) -> str:
    """Return one line: how many of the visible faults were caught, and how many named."""
    return "; ".join(_summary_parts(rows))


def _summary_parts(rows: Sequence[Mutation]) -> list[str]:
    """Return the verdict, then the counts by kind of fault, without kinds that were not tried."""
    literal, mistakes = _of_kind(rows, FaultKind.LITERAL), _of_kind(rows, FaultKind.MISTAKE)
    small = [row for row in literal if row.name in SIZES]
    large = [row for row in literal if row.name not in SIZES]
    none = _of_kind(rows, FaultKind.NONE)
    agree = len(_with(none, FaultVerdict.AGREES))
    unseen = {(_model(row), row.location) for row in _with(literal, FaultVerdict.UNTESTED)}
    missed = len(_with(rows, FaultVerdict.MISSED))
    wrong = (
        (f"{missed} missed", missed),
        (counted(len(none) - agree, "false alarm"), len(none) - agree),
    )
    bad = [text for text, number in wrong if number]
    planted = counted(len(rows) - len(none) - len(_with(rows, FaultVerdict.UNTESTED)), "fault")
    parts = [f"FAIL  {planted}: {', '.join(bad)}" if bad else f"ok  {planted}, none missed"]
    for name, faults in (("small faults", small), ("mistakes", [*mistakes, *large])):
        parts += [f"{name}: {_counts(faults)}"] if faults else []
    parts += [f"another dt or integrator: {agree} of {len(none)} agree"] if none else []
    parts += [f"{counted(len(unseen), 'literal')} untested (no effect on motion)"] if unseen else []
    return parts


def _counts(rows: Sequence[Mutation]) -> str:
    refused = len(_with(rows, FaultVerdict.REFUSED))
    seen = len(rows) - refused - len(_with(rows, FaultVerdict.UNTESTED))
    caught = seen - len(_with(rows, FaultVerdict.MISSED))
    named = len(_with(rows, FaultVerdict.NAMED))
    text = f"{caught} of {seen} caught, {named} named"
    return f"{text}, {refused} refused by the engine" if refused else text
