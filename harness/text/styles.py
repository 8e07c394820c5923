"""Colours of outcomes: each means one thing, wherever it stands."""

from __future__ import annotations

from collections.abc import Mapping

from physics_crosscheck.harness.records.outcome import Outcome

STYLES: Mapping[str, str] = {
    Outcome.AGREES: "green", Outcome.ABSENT: "yellow", Outcome.REFUSED: "yellow",
    Outcome.UNRESOLVED: "magenta", Outcome.DIFFERS: "bold red", Outcome.FAILED: "bold red reverse",
}  # fmt: skip
