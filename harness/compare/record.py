"""Record of a comparison, to print and write."""

from __future__ import annotations

import datetime

import numpy as np

from physics_crosscheck.harness.compare.candidate import Candidate, Facts
from physics_crosscheck.harness.compare.compare import CompareOptions, Findings
from physics_crosscheck.harness.compare.judge import Judgement
from physics_crosscheck.harness.compare.own_file import OwnFile
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.records.base import number, numbers
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedModel,
    ComparedRuns,
    Comparison,
)
from physics_crosscheck.harness.records.outcome import Outcome


def comparison_record(findings: Findings, created: datetime.datetime) -> Comparison:
    """Build the record of a comparison."""
    options, judged, recorded = findings.options, findings.judgement, findings.recorded
    return Comparison(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(
            _model(*model)
            for model in zip(
                (options.a, options.b), findings.facts, findings.own_files, strict=True
            )
        ),
        outcome=judged.outcome,
        strict=options.strict,
        reason=judged.reason,
        kind=judged.kind,
        found=Compared(
            discrepancy=number(judged.discrepancy),
            uncertainty=number(judged.uncertainty),
            component=judged.component,
            joints=tuple(findings.match.names),
            by_component=numbers(_by_component(judged)),
            map=tuple(findings.match.pairing),
            left_out=tuple(findings.match.left_out),
            states_of=findings.match.source,
            runs=ComparedRuns(
                count=len(recorded.runs.z),
                length=recorded.runs.length,
                driven=int(recorded.driven.sum()),
                lost=recorded.lost,
            ),
            turned=findings.turned,
            left_when_turned=number(findings.remaining) if findings.turned else None,
            properties=findings.properties,
            explained=None if findings.explained is None else number(findings.explained.share),
            off=_off(findings),
            terms=findings.differing_terms,
            differences=findings.trials,
            untried=findings.untried,
            untested=findings.untested,
            impossible=findings.impossible,
            notes=findings.notes,
            seconds=findings.seconds,
        ),
    )


def _by_component(judged: Judgement) -> list[float]:
    """Return the largest discrepancy of each component, or only of differing ones if any."""
    differs = judged.outcome is Outcome.DIFFERS
    shown = np.where(judged.certain | (not differs), judged.by_component, 0.0)
    return [float(one) for one in shown]


def failed_record(
    options: CompareOptions, failure: Failure, created: datetime.datetime
) -> Comparison:
    """Build the record of a comparison that could not run."""
    return Comparison(
        created=_spelled(created),
        resolution=options.resolution,
        models=tuple(_model(candidate, None, OwnFile()) for candidate in (options.a, options.b)),
        outcome=Outcome.FAILED,
        strict=options.strict,
        reason=failure.reason,
        kind=failure.kind,
        stdout=failure.stdout,
    )


def _spelled(created: datetime.datetime) -> str:
    return created.isoformat(timespec="seconds")


def _model(candidate: Candidate, facts: Facts | None, own_file: OwnFile) -> ComparedModel:
    return ComparedModel(
        model=str(candidate.sidecar.model),
        engine=candidate.engine,
        version=engines()[candidate.engine].version(),
        notes=candidate.notes,
        coordinates=None if facts is None else facts.coordinates,
        integrator=None if facts is None else facts.integrator,
        step=None if facts is None else number(facts.step),
        gravity=None if facts is None else numbers(facts.gravity),
        case=own_file.case,
        diagnosis=own_file.diagnosis,
    )


def _off(findings: Findings) -> tuple[float | None, ...] | None:
    """Return the deviations from the equations, of A and of B."""
    if findings.explained is None:
        return None
    off = findings.explained.off
    return tuple(numbers(off if findings.match.source == "A" else off[::-1]))
