"""What to do next, in a line or two under the summary: the change, and the command that tells."""

from __future__ import annotations

import shlex
from pathlib import Path

from harness.records.cause import Cause
from harness.records.model import Model
from harness.records.results import Results
from harness.text.causes import IN_FILE, digits_known
from harness.text.troubles import explained_alike, shown_line

MOST = 3
"""Changes that are told; the page has them all."""

DEFAULT_OUT = Path("reports")


def next_steps(results: Results, out: Path) -> list[str]:
    """Lines, each a thing to do; none where all agrees.

    Args:
        results: of the run.
        out: the folder that it wrote to.
    """
    changes = list(dict.fromkeys(one for model in _explained(results) for one in _changes(model)))
    lines = [f"change {one}" for one in changes[:MOST]]
    if len(changes) > MOST:
        lines.append(f"and {len(changes) - MOST} more, on the page: {out / 'index.html'}")
    if results.failed:
        there = "" if out == DEFAULT_OUT else f" --out {shlex.quote(str(out))}"
        lines.append(f"then  crosscheck run --last-failed{there}")
    return lines


def _explained(results: Results) -> list[Model]:
    return [
        alike[0]
        for alike in explained_alike(results.models)
        if (found := alike[0].diagnosis) is not None and found.explained
    ]


def _changes(model: Model) -> list[str]:
    """`file:line from 3.3 to 3.6`, of the numbers that stand in a file."""
    assert model.diagnosis is not None
    causes = model.diagnosis.explanations[0].causes
    return [
        f"{shown_line(model.folder, cause.where[0])} from {cause.nominal:.10g} to {value}"
        for cause in causes
        if (value := _wanted(cause)) and cause.where and cause.nominal is not None
    ]


def _wanted(cause: Cause) -> str:
    """The number that the motion wants in a file; empty where it says none."""
    if cause.kind not in IN_FILE or cause.estimate is None or cause.standard_error is None:
        return ""
    return digits_known(cause.estimate, cause.standard_error)
