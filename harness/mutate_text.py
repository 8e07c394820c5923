"""Mutations for the terminal: a row a literal, a mark a fault, and one line that sums up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from harness.mutate import CAUGHT, FACTORS, MISSED, NAMED, REFUSED, SIZES, UNSEEN, Mutation

MARKS = {NAMED: "named", CAUGHT: "caught", REFUSED: "refused", UNSEEN: ".", MISSED: "MISSED"}


def mutation_lines(rows: Sequence[Mutation]) -> list[str]:
    """Tables by model and engine, what was caught but not named, and the summary."""
    width = max((len(row.address) for row in rows), default=10)
    head = "".join(f"{label:>10}" for label in FACTORS)
    lines = []
    for (system, model, engine), group in groupby(rows, lambda r: (r.system, r.model, r.engine)):
        lines += ["", f"{system}/{model} [{engine}]"]
        lines.append(f"  {'literal':<{width}}{'first seen at':>15}{head}")
        for address, marks in groupby(group, lambda r: r.address):
            faults = {row.label: row for row in marks}
            first = next(iter(faults.values())).first_caught
            seen = f"{first:.0e}" if math.isfinite(first) else "no motion"
            cells = "".join(
                f"{MARKS[faults[label].verdict] if label in faults else '':>10}"
                for label in FACTORS
            )
            lines.append(f"  {address:<{width}}{seen:>15}{cells}")
    unnamed = [row for row in rows if row.verdict == CAUGHT]
    if unnamed:
        lines += ["", "caught, but another cause was told:"]
        lines += [
            f"  {r.system}/{r.model} [{r.engine}] {r.address} {r.label}: {r.told}" for r in unnamed
        ]
    return [*lines, "", summary(rows)]


def summary(rows: Sequence[Mutation]) -> str:
    """One line: of the faults that motions can show, how many were caught, and named."""
    told = []
    for label, chosen in (
        ("small faults", [r for r in rows if r.label in SIZES]),
        ("mistakes", [r for r in rows if r.label not in SIZES]),
    ):
        seen = [r for r in chosen if r.verdict not in (UNSEEN, REFUSED)]
        caught = sum(r.verdict != MISSED for r in seen)
        named = sum(r.verdict == NAMED for r in seen)
        refused = sum(r.verdict == REFUSED for r in chosen)
        counts = f"{caught} of {len(seen)} caught, {named} named, {refused} refused by the engine"
        told.append(f"{label}: {counts}")
    unseen = len({(r.system, r.model, r.engine, r.address) for r in rows if r.verdict == UNSEEN})
    return f"{'; '.join(told)}; {unseen} literals that no motion depends on (see audit)"
