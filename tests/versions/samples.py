"""Sample results of two versions of an engine that ran one case."""

from __future__ import annotations

from typing import Any

import msgspec

from physics_crosscheck.harness.extras.versions.run import upgrade
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case, Stepping
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.versions import Measured, Upgrade, VersionRun
from tests.baseline.samples import case, measurement


def run(
    version: str,
    *cases: Case,
    motion: Measurement | str | None = None,
    models: tuple[Model, ...] = (),
) -> VersionRun:
    """Build a version's results; `motion` applies to all cases, as a text it is their failure."""
    chosen = cases or (case(),)
    motion = measurement() if motion is None else motion
    failure = motion if isinstance(motion, str) else ""
    measured = None if isinstance(motion, str) else motion
    return VersionRun(
        version=version,
        cases=chosen,
        models=models,
        measured=tuple(
            Measured(folder=each.folder, case=each.id, measurement=measured, failure=failure)
            for each in chosen
            if each.verdict is not None
        ),
    )


def between(before: VersionRun, after: VersionRun) -> Upgrade:
    """Compare the results of two versions."""
    return upgrade(before, after, "e", 1e-9)


def failed(scenario: str = "free", **fields: Any) -> Case:
    """Build a case that failed to run."""
    nothing = {"verdict": None, "full_run": None}
    given = {"scenario": scenario, "reason": "m.xml: no such joint", **nothing, **fields}
    return case(Outcome.FAILED, **given)


def stepping(outcome: Outcome) -> Stepping:
    """Build the comparison of a single step with the given outcome."""
    return Stepping(
        rule="semi-implicit Euler",
        besides="",
        step=0.002,
        outcome=outcome,
        discrepancy=0.0,
        uncertainty=1e-14,
        component="x",
        digits=1.0,
        digits_later=1.0,
    )


def linearization(k: float = 47.0, *, differs: bool = False) -> EngineLinearization:
    """Build the linearization of an oscillator of stiffness k, with a bound of 1e-10."""
    return EngineLinearization(
        equilibrium="rest",
        a=((0.0, 1.0), (-k, -0.5)),
        b=((), ()),
        a_error=0.0,
        b_error=None,
        a_bound=1e-10,
        differs=differs,
        poles=(),
        taylor_poles=(),
        transfer_error=None,
        mode_similarity=1.0,
        frequencies=(),
        response=(),
        taylor_response=(),
    )


def remark(message: str, actual: float | None = None, subject: str = "") -> AuditFinding:
    """Build a note of an audit."""
    return AuditFinding(
        kind="default",
        subject=(subject or message,),
        message=message,
        location=None,
        expected=None,
        actual=actual,
        severity="note",
    )


MODEL = Model(
    system="spring",
    model="m.xml",
    engine="e",
    folder="models/spring",
    text="",
    sidecar="",
    linearizations=(linearization(),),
    audit=(remark("the step is 0.002 s"),),
)


def model(**fields: Any) -> Model:
    """Return the model with some fields changed."""
    return msgspec.structs.replace(MODEL, **fields)
