"""The status word and the colour of each outcome in the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from physics_crosscheck.harness.records.outcome import Outcome

STYLES: Mapping[str, str] = {
    Outcome.AGREES: "green", Outcome.ABSENT: "dim", Outcome.REFUSED: "bold magenta",
    Outcome.UNRESOLVED: "magenta", Outcome.DIFFERS: "bold red", Outcome.FAILED: "bold red reverse",
}  # fmt: skip
"""Colours that are readable on a light and on a dark background: not yellow, cyan or white."""

WORDS: Mapping[str, str] = {
    Outcome.AGREES: "ok", Outcome.ABSENT: "skipped", Outcome.REFUSED: "REFUSED",
    Outcome.UNRESOLVED: "UNRESOLVED", Outcome.DIFFERS: "FAIL", Outcome.FAILED: "ERROR",
}  # fmt: skip
"""The status words of the terminal; JSON keeps the names of the outcomes."""
