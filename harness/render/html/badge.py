"""A badge with the verdict of a run, as a picture or as data for shields.io."""

from __future__ import annotations

import html
import json
from collections import Counter
from pathlib import Path

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
        failing = Counter(case.outcome for case in amiss)
        labels = {
            Outcome.FAILED: "failed", Outcome.DIFFERS: "differ", Outcome.UNRESOLVED: "unresolved",
            Outcome.REFUSED: "refused",
        }  # fmt: skip
        parts = [f"{failing[one]} {word}" for one, word in labels.items() if failing[one]]
        return f"{', '.join(parts)} of {len(results.cases)}", "orange"
    agreeing = [case for case in results.cases if case.outcome is Outcome.AGREES]
    digits_of_cases = [digits for case in agreeing if (digits := case.digits) is not None]
    to = f" to {min(digits_of_cases):.1f} digits" if digits_of_cases else ""
    return f"{len(agreeing)} of {len(results.cases)} agree{to}", "green"


def shields(results: Results) -> str:
    """Return the badge as JSON for shields.io: https://shields.io/badges/endpoint-badge"""
    text, colour = message(results)
    badge = {"schemaVersion": 1, "label": LABEL, "message": text, "color": _SHIELDS[colour]}
    return json.dumps(badge) + "\n"


def picture(results: Results) -> str:
    """Return the badge as SVG, with the same words for screen readers."""
    words, colour = message(results)
    label_width, right = _width(LABEL), _width(words)
    whole = f"{LABEL}: {words}"
    texts = "".join(
        f'<text x="{x + wide / 2:g}" y="14" textLength="{wide - 12}">{html.escape(text)}</text>'
        for text, x, wide in ((LABEL, 0, label_width), (words, label_width, right))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{label_width + right}" height="20"'
        f' role="img" aria-label="{html.escape(whole)}"><title>{html.escape(whole)}</title>'
        f'<rect width="{label_width + right}" height="20" rx="3" fill="{_COLOURS[colour]}"/>'
        f'<path d="M3 0h{label_width - 3}v20H3a3 3 0 0 1-3-3V3a3 3 0 0 1 3-3z" fill="#333a41"/>'
        '<g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif"'
        f' font-size="11">{texts}</g></svg>\n'
    )


def _width(text: str) -> int:
    """Return the width of a text in Verdana at 11 pixels, with margins."""
    return round(6.9 * len(text)) + 12
