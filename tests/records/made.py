"""Handmade records: a case that agrees, with fields that a test overrides."""

from io import StringIO
from typing import Any

from rich.console import Console

from physics_crosscheck.harness.records.case import CheckedStep, Stepping, TargetStep
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.records import (
    AuditFinding,
    Case,
    Cause,
    Diagnosis,
    Explanation,
    FullRun,
    Model,
    Outcome,
    Results,
    Verdict,
)


def verdict(**fields: Any) -> Verdict:
    defaults: dict[str, Any] = {
        "discrepancy": 1e-13, "uncertainty": 2e-12, "component": "x", "time": 0.5,
        "largest_discrepancy": 3e-13, "largest_uncertainty": 4e-12, "order": 0.99,
        "claimed_order": 1, "rungs": (1, 2, 3), "steps": 60,
    }  # fmt: skip
    return Verdict(**defaults | fields)


def full_run(**fields: Any) -> FullRun:
    defaults: dict[str, Any] = {
        "time_step": 0.002, "integrator": "Euler", "global_error": 0.005, "order": 1.0,
        "residual": 1e-12, "decomposition": None,
        "steps_for": (TargetStep(target=0.001, step=4e-4),),
        "checked_step": CheckedStep(target=0.001, step=4e-4, measured=0.001),
        "energy_error": 0.01, "constraint_drift": 0.0,
    }  # fmt: skip
    return FullRun(**defaults | fields)


def stepping(outcome: Outcome = Outcome.AGREES, **fields: Any) -> Stepping:
    defaults: dict[str, Any] = {
        "rule": "semi-implicit Euler", "besides": "", "step": 0.002, "outcome": outcome,
        "discrepancy": 3e-5, "uncertainty": 1e-11, "component": "x_dot", "digits": 1.4,
        "digits_later": 3.0,
    }  # fmt: skip
    return Stepping(**defaults | fields)


def case(outcome: Outcome = Outcome.AGREES, **fields: Any) -> Case:
    defaults: dict[str, Any] = {
        "system": "disc", "model": "mujoco.xml", "scenario": "free", "engine": "mujoco",
        "folder": "models/disc", "outcome": outcome, "seconds": 0.1,
    }  # fmt: skip
    if outcome.is_run:
        defaults |= {"verdict": verdict(), "full_run": full_run()}
    return Case(**defaults | fields)


def model(*findings: AuditFinding, **fields: Any) -> Model:
    defaults: dict[str, Any] = {
        "system": "disc", "model": "mujoco.xml", "engine": "mujoco", "folder": "models/disc",
        "text": "", "sidecar": "", "audit": findings,
    }  # fmt: skip
    return Model(**defaults | fields)


def finding(message: str = "is wrong", **fields: Any) -> AuditFinding:
    defaults: dict[str, Any] = {
        "kind": "literal", "subject": (message,), "message": message, "location": None,
        "expected": None, "actual": None, "severity": "finding",
    }  # fmt: skip
    return AuditFinding(**defaults | fields)


def cause(*subject: str, **fields: Any) -> Cause:
    defaults: dict[str, Any] = {
        "kind": "literal", "subject": subject, "nominal": 1.0, "estimate": 2.0,
        "standard_error": 0.1,
    }  # fmt: skip
    return Cause(**defaults | fields)


def diagnosis(*causes: Cause, remaining: float = 0.0, explained: bool = True) -> Diagnosis:
    explanation = Explanation(causes=causes, remaining=remaining)
    return Diagnosis(explanations=(explanation,), explained=explained)


def results(*cases: Case, models: tuple[Model, ...] = (), **fields: Any) -> Results:
    defaults: dict[str, Any] = {
        "created": "2026-01-01T00:00:00+00:00", "versions": {}, "resolution": 1e-9,
        "seconds": 1.5, "systems": (), "models": models, "cases": cases,
    }  # fmt: skip
    return Results(**defaults | fields)


def printed(run: Results, width: int = 160, **how: Any) -> str:
    """Return the terminal's text of a run."""
    out = StringIO()
    print_results(Console(file=out, width=width), run, **how)
    return out.getvalue()
