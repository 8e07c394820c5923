"""What a diagnosis found, in sentences: the same in the terminal, the report and pytest."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.cause import IN_FILE, Cause, digits_known
from physics_crosscheck.harness.records.finding import Explanation

SWITCHES = ("axis", "default", "exchange", "dropped")
"""Kinds that have no number: they hold or don't."""

BEGIN_WITH_AUDIT = "no one or two causes explain the motions; begin with what the audit finds wrong"
"""Of a model with `unexplained_findings`, instead of the cause that leaves least."""


def cause_sentences(explanation: Explanation) -> list[str]:
    """An explanation in words: a sentence a cause, what it leaves, and what it is tied with."""
    tail = f"leaves {explanation.remaining:.1e} of the discrepancy"
    if explanation.tied_with:
        others = ", ".join(map(str, explanation.tied_with))
        tail += f"; no motion here tells it from: {others}"
    return [*map(_sentence, explanation.causes), tail]


def _sentence(cause: Cause) -> str:
    places = ", ".join(dict.fromkeys(map(str, cause.locations)))
    name = f"{cause} ({places})" if places else str(cause)
    if cause.kind == "dropped":
        return f"{name} in the file, 0 in the engine"
    if cause.kind in SWITCHES:
        return f"{name} explains the motion"
    fitted, nominal = _fitted(cause.estimate, cause.standard_error), _digits(cause.nominal)
    if cause.kind == "taken":
        return f"{name} is {nominal} in the file, {fitted} in the engine"
    if cause.kind in IN_FILE:
        return f"{name} is {nominal}, the motion wants {fitted}"
    return f"{name} is {fitted} in the model, {nominal} in the equations"


def _fitted(value: Number, error: Number) -> str:
    """A fitted value and its standard error."""
    if value is None or error is None:
        return f"{_digits(value)} ± unknown"
    return f"{digits_known(value, error)} ± {error:.1g}"


def _digits(value: Number) -> str:
    return "unknown" if value is None else f"{value:.10g}"
