"""Baseline entries built from the results of a case."""

from __future__ import annotations

import msgspec

from physics_crosscheck.harness.baseline.fingerprint import Dependencies
from physics_crosscheck.harness.baseline.seal import snapshot_key
from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.outcome import Outcome


def entry_of(
    case_id: CaseId, case: Case, measured: Measurement | None, now: Dependencies
) -> AcceptedCase:
    """Build the baseline entry of a case that was judged and measured, without a reason yet.

    Args:
        case_id: name of the case, with its system's name in the baseline.
        case: record of the case.
        measured: measurement of its model; None for a file that the engine refuses.
        now: present dependencies of the case.
    """
    verdict, full_run = case.verdict, case.full_run
    assert verdict is not None or measured is None  # measured cases have a verdict
    return summarized(
        AcceptedCase(
            system=case_id.system,
            model=case_id.model,
            scenario=case_id.scenario,
            engine=case_id.engine,
            summary="",
            reason="",
            outcome=case.outcome,
            outcome_reason=case.reason.replace(f"{case.folder}: ", f"{case.model}: "),
            discrepancy=verdict.discrepancy if verdict else None,
            uncertainty=verdict.uncertainty if verdict else None,
            component=verdict.component if verdict else "",
            constants=measured.constants if measured else {},
            global_error=full_run.global_error if full_run else None,
            global_order=full_run.order if full_run else None,
            time_step=full_run.time_step if full_run else None,
            integrator=full_run.integrator if full_run else "",
            order=verdict.order if verdict else None,
            claimed_order=verdict.claimed_order if verdict else 0,
            engine_version=now.engine_version,
            resolution=now.resolution,
            numerics=now.numerics,
            files=dict(now.files),
            snapshot=snapshot_key(measured.snapshot) if measured else "",
            end=measured.end if measured else (),
            end_uncertainty=measured.uncertainty if measured else (),
        )
    )


def summarized(entry: AcceptedCase) -> AcceptedCase:
    """Add a one-line summary for reviewers to an entry."""

    def short(value: Number, form: str) -> str:
        return "unknown" if value is None else format(value, form)

    if entry.outcome is Outcome.REFUSED:
        return msgspec.structs.replace(entry, summary=f"{entry.outcome}: {entry.outcome_reason}")
    summary = (
        f"{entry.outcome}, E {short(entry.discrepancy, '.0e')} U {short(entry.uncertainty, '.0e')}"
    )
    if entry.integrator:  # separate sampled states have no full run
        summary += (
            f"; global error {short(entry.global_error, '.2%')}"
            f" at {short(entry.time_step, 'g')} s, {entry.integrator}"
        )
    return msgspec.structs.replace(entry, summary=summary)
