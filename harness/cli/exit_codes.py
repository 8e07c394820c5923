"""What the commands end with."""

from __future__ import annotations

from typing import Any

AGREE, DIFFER, USAGE, FAIL = 0, 1, 2, 3
"""Exit codes: all agree; a difference or nothing certain; wrong usage; something could not run."""


def exit_code(found: dict[str, Any], require_engines: bool) -> int:
    """The exit code of results; nothing run at all is a failure, a known difference none."""
    # Imported here: the gate ends with a code and needs neither, nor the sympy that they bring.
    from harness.records.outcome import Outcome
    from harness.text.table import audit_findings

    outcomes = {case["outcome"] for case in found["cases"] if not case.get("accepted")}
    if Outcome.FAILED in outcomes or not found["cases"]:
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED}:
        return DIFFER
    # What the audit finds in a model whose difference was accepted is what was accepted.
    accepted = {_model(case) for case in found["cases"] if case.get("accepted")}
    models = [model for model in found.get("models", ()) if _model(model) not in accepted]
    if any(audit_findings(model) for model in models):
        return DIFFER
    return AGREE


def _model(record: dict[str, Any]) -> tuple[str, ...]:
    return tuple(str(record.get(name)) for name in ("folder", "model", "engine"))
