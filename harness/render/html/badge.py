"""A badge with the verdict of a run, as a picture or as data for shields.io."""

from __future__ import annotations

import html
import json
from collections import Counter
from pathlib import Path

from physics_crosscheck.harness.records.history import digits_known
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import write_whole

LABEL = "crosscheck"

# Dark enough for white letters: contrast of at least 4.5.
_COLOURS = {"green": "#00694c", "orange": "#ab4300", "grey": "#5a6570"}
_SHIELDS = {"green": "brightgreen", "orange": "orange", "grey": "lightgrey"}


def write_badge(path: Path, results: Results) -> None:
    """Write a badge: `.json` for shields.io's endpoint, a picture for any other name."""
    text = shields(results) if path.suffix == ".json" else picture(results)
    write_whole(path, text)


def message(results: Results) -> tuple[str, str]:
    """Return the text of the badge and its colour."""
    counts = Counter(case.outcome for case in results.cases)
    amiss = [case for case in results.cases if not case.passes and case.outcome != Outcome.ABSENT]
    if not results.cases or len(results.cases) == counts[Outcome.ABSENT]:
        return "nothing tested", "grey"
    if amiss:
        left = Counter(case.outcome for case in amiss)
        said = {
            Outcome.FAILED: "failed", Outcome.DIFFERS: "differ", Outcome.UNRESOLVED: "unresolved",
            Outcome.REFUSED: "refused",
        }  # fmt: skip
        parts = [f"{left[one]} {word}" for one, word in said.items() if left[one]]
        return f"{', '.join(parts)} of {len(results.cases)}", "orange"
    agreeing = [case for case in results.cases if case.outcome is Outcome.AGREES]
    known = [digits for case in agreeing if (digits := digits_known(case)) is not None]
    to = f" to {min(known):.1f} digits" if known else ""
    return f"{len(agreeing)} of {len(results.cases)} agree{to}", "green"


def shields(results: Results) -> str:
    """Return the badge as JSON for shields.io: https://shields.io/badges/endpoint-badge"""
    said, colour = message(results)
    badge = {"schemaVersion": 1, "label": LABEL, "message": said, "color": _SHIELDS[colour]}
    return json.dumps(badge) + "\n"


def picture(results: Results) -> str:
    """Return the badge as SVG, with the same words for screen readers."""
    said, colour = message(results)
    left, right = _width(LABEL), _width(said)
    whole = f"{LABEL}: {said}"
    texts = "".join(
        f'<text x="{x + wide / 2:g}" y="14" textLength="{wide - 12}">{html.escape(text)}</text>'
        for text, x, wide in ((LABEL, 0, left), (said, left, right))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img"'
        f' aria-label="{html.escape(whole)}"><title>{html.escape(whole)}</title>'
        f'<rect width="{left + right}" height="20" rx="3" fill="{_COLOURS[colour]}"/>'
        f'<path d="M3 0h{left - 3}v20H3a3 3 0 0 1-3-3V3a3 3 0 0 1 3-3z" fill="#333a41"/>'
        '<g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif"'
        f' font-size="11">{texts}</g></svg>\n'
    )


def _width(text: str) -> int:
    """Return the width of a text in Verdana at 11 pixels, with margins."""
    return round(6.9 * len(text)) + 12
