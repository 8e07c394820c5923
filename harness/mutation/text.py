"""Mutations for the terminal and as JSON: literals, known mistakes, and one line that sums up."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Any

from harness.mutation.mutate import (
    AGREES,
    CAUGHT,
    FAULTS,
    KNOWN,
    LITERAL,
    MISSED,
    NAMED,
    REFUSED,
    SIZES,
    SOUND,
    UNSEEN,
    Mutation,
)

MARKS = {NAMED: "named", CAUGHT: "caught", REFUSED: "refused", UNSEEN: ".", MISSED: "MISSED"}

COUNTED = (NAMED, CAUGHT, MISSED, REFUSED, UNSEEN)
HEADS = ("named", "caught", "MISSED", "refused", "no effect")
"""Columns of the table of known mistakes: the verdicts, and what they are called there."""


def mutation_lines(rows: Sequence[Mutation]) -> list[str]:
    """Tables by model and engine, known mistakes by kind, what was not named, and the summary."""
    lines = []
    literal = [row for row in rows if row.kind == LITERAL]
    width = max((len(row.place) for row in literal), default=10)
    for (system, model, engine), group in groupby(rows, _model):
        mine = list(group)
        lines += ["", f"{system}/{model} [{engine}]"]
        lines += _literals([row for row in mine if row.kind == LITERAL], width)
        lines += [f"  {r.name}, {r.place}: {r.verdict}, {r.told}" for r in mine if r.kind == SOUND]
    lines += _mistakes([row for row in rows if row.kind == KNOWN])
    lines += _unnamed(rows)
    return [*lines, "", summary(rows)]


def _model(row: Mutation) -> tuple[str, str, str]:
    return row.system, row.model, row.engine


def _literals(rows: Sequence[Mutation], width: int) -> Iterator[str]:
    """A row a literal, a mark a fault."""
    if rows:
        head = "".join(f"{label:>10}" for label in FAULTS)
        yield f"  {'literal':<{width}}{'first seen at':>15}{head}"
    for place, marks in groupby(rows, lambda r: r.place):
        faults = {row.name: row for row in marks}
        first = next(iter(faults.values())).first_caught
        seen = f"{first:.0e}" if math.isfinite(first) else "no motion"
        cells = "".join(
            f"{MARKS[faults[label].verdict] if label in faults else '':>10}" for label in FAULTS
        )
        yield f"  {place:<{width}}{seen:>15}{cells}"


def _mistakes(rows: Sequence[Mutation]) -> Iterator[str]:
    """A row a kind of mistake: how many were made, what became of them, when the last was seen."""
    names = list(dict.fromkeys(row.name for row in rows))
    if not names:
        return
    width = max(map(len, names)) + 2
    head = "".join(f"{title:>10}" for title in HEADS)
    yield ""
    yield f"{'known mistakes':<{width}}{'made':>6}{head}  seen from this share of it on"
    for name in names:
        mine = [row for row in rows if row.name == name]
        counts = [sum(row.verdict == verdict for row in mine) for verdict in COUNTED]
        shares = [row.first_caught for row in mine if math.isfinite(row.first_caught)]
        worst = f"  {max(shares):.0e}" if shares else ""
        cells = "".join(f"{count or '.':>10}" for count in counts)
        yield f"{name:<{width}}{len(mine):>6}{cells}{worst}"


def _unnamed(rows: Sequence[Mutation]) -> Iterator[str]:
    """What was caught under another name, and what was missed, known mistakes refused included."""
    for title, chosen in (
        (
            "caught, but another cause was told:",
            [r for r in rows if r.verdict == CAUGHT and r.kind != SOUND],
        ),
        ("missed:", [r for r in rows if r.verdict == MISSED]),
        (
            "no mistake, but told to be one:",
            [r for r in rows if r.kind == SOUND and r.verdict != AGREES],
        ),
        ("refused by the engine:", [r for r in rows if r.verdict == REFUSED and r.kind == KNOWN]),
    ):
        if chosen:
            yield ""
            yield title
        for r in chosen:
            told = f": {r.told}" if r.told else ""
            yield f"  {r.system}/{r.model} [{r.engine}] {r.place} {r.name}{told}"


def summary(rows: Sequence[Mutation]) -> str:
    """One line: of the faults that motions can show, how many were caught, and named."""
    told = []
    for label, chosen in (
        ("small faults", [r for r in rows if r.kind == LITERAL and r.name in SIZES]),
        (
            "mistakes",
            [r for r in rows if r.kind == KNOWN or (r.kind == LITERAL and r.name not in SIZES)],
        ),
    ):
        seen = [r for r in chosen if r.verdict not in (UNSEEN, REFUSED)]
        caught = sum(r.verdict != MISSED for r in seen)
        named = sum(r.verdict == NAMED for r in seen)
        refused = sum(r.verdict == REFUSED for r in chosen)
        counts = f"{caught} of {len(seen)} caught, {named} named, {refused} refused by the engine"
        told.append(f"{label}: {counts}")
    sound = [r for r in rows if r.kind == SOUND]
    agree = sum(r.verdict == AGREES for r in sound)
    told.append(f"another step or integrator: {agree} of {len(sound)} agree")
    literals = {(*_model(r), r.place) for r in rows if r.verdict == UNSEEN and r.kind == LITERAL}
    return f"{'; '.join(told)}; {len(literals)} literals that no motion depends on (see audit)"


def mutation_json(rows: Sequence[Mutation]) -> str:
    """All rows and the summary as JSON; what is infinite or not a number becomes null."""
    records = [{key: _plain(value) for key, value in asdict(row).items()} for row in rows]
    found = {"schema": 1, "summary": summary(rows), "rows": records}
    return json.dumps(found, allow_nan=False, indent=1) + "\n"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
