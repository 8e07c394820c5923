"""Models by engines as a table of a page: `python -m campaigns.engines RESULTS.json`.

The results come from `crosscheck run FOLDER|ROBOT...`. A cell states the worst outcome of a model's
cases in an engine, and how many digits agree. The lines below the table give the reason of each
case that does not agree.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.render.html.cases import digits_of


def cell(cases: Sequence[Case]) -> str:
    """Return the worst outcome of some cases; if all agree, with the fewest digits that agree."""
    if not cases:
        return ""
    worst = min(cases, key=lambda case: -case.outcome.severity)
    agreeing = [digits_of(case) for case in cases if case.outcome is worst.outcome]
    digits = min(agreeing, key=lambda one: float(one) if one[0].isdigit() else 99.0)
    return f"{worst.outcome}, {digits}" if worst.outcome is Outcome.AGREES else str(worst.outcome)


def table(cases: Sequence[Case]) -> list[str]:
    """Return lines of Markdown: one row per model, one column per engine, then the reasons."""
    engines = list(dict.fromkeys(case.engine for case in cases))
    rows = list(dict.fromkeys((case.folder, case.system, case.model) for case in cases))
    lines = [f"| model | {' | '.join(engines)} |", f"|---|{'---|' * len(engines)}"]
    for folder, system, model in rows:
        of_model = [case for case in cases if (case.folder, case.model) == (folder, model)]
        cells = (cell([case for case in of_model if case.engine == name]) for name in engines)
        lines.append(f"| {system}/{model} | {' | '.join(cells)} |")
    for case in cases:
        if case.outcome is not Outcome.AGREES:
            lines.append(f"- {case.id}: {case.outcome}: {case.reason}")
    return lines


if __name__ == "__main__":
    print("\n".join(table(read_results(Path(sys.argv[1])).cases)))
