"""Groups of what does not agree: each thing once, however many cases it affects."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import MEASURED, Case, ModelKey
from physics_crosscheck.harness.records.finding import SAME, AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results


@dataclass(frozen=True)
class Trouble:
    """Cases that have the same thing wrong: the worst, and the others."""

    worst: Case
    others: tuple[Case, ...]


def troubles(cases: Iterable[Case]) -> list[Trouble]:
    """Cases that don't agree and weren't accepted, worst first.

    Those of a model file that differ are together, and so are those of one kind in one component,
    or of one reason where a case names no kind.
    """
    found: dict[Hashable, list[Case]] = {}
    amiss = [c for c in cases if c.outcome is not Outcome.AGREES and not c.accepted]
    for case in sorted(amiss, key=_worst_first):
        found.setdefault(_kind(case), []).append(case)
    return [Trouble(worst, tuple(others)) for worst, *others in found.values()]


def explained_alike(models: Iterable[Model]) -> list[tuple[Model, ...]]:
    """Models whose motions have a diagnosis, those of one file and the same causes together."""
    found: dict[Hashable, list[Model]] = {}
    for model in models:
        if (diagnosis := model.diagnosis) is None:
            continue
        best = diagnosis.explanations[:1]
        causes = tuple((cause.id, cause.locations) for one in best for cause in one.causes)
        state = diagnosis.explained, bool(model.unexplained_findings), diagnosis.failure
        found.setdefault((model.folder, model.model, causes, state), []).append(model)
    return [tuple(one) for one in found.values()]


def audited_alike(models: Iterable[Model]) -> list[tuple[Model, ...]]:
    """Models with findings, those of one file and the same findings together."""
    found: list[list[Model]] = []
    for model in models:
        if model.findings:
            same = next((alike for alike in found if _same_findings(alike[0], model)), None)
            if same is None:
                found.append([model])
            else:
                same.append(model)
    return [tuple(alike) for alike in found]


def _same_findings(one: Model, other: Model) -> bool:
    mine, theirs = one.findings, other.findings
    return (one.folder, one.model, len(mine)) == (other.folder, other.model, len(theirs)) and all(
        map(_is_like, mine, theirs)
    )


def _is_like(one: AuditFinding, other: AuditFinding) -> bool:
    """Whether one message is right for both: numbers that it alone has must be the same."""
    return one.is_like(other, SAME) and (one.found is not None or one.message == other.message)


def untold_failures(results: Results) -> list[tuple[Model, str, str]]:
    """What could not be done of a model, and why, but for what its cases say already."""
    told: dict[ModelKey, set[str]] = {}
    for case in results.cases:
        told.setdefault(case.key, set()).add(case.reason)
    return [
        (model, what, why)
        for model in results.models
        for what, why in model.failures
        if why not in told.get(model.key, ())
    ]


def _kind(case: Case) -> Hashable:
    if case.outcome is Outcome.DIFFERS:
        return case.outcome, case.folder, case.model
    if case.kind in MEASURED:
        return case.outcome, case.kind, case.verdict.component if case.verdict else ""
    return case.outcome, case.reason


def _worst_first(case: Case) -> tuple[int, float]:
    discrepancy = 0.0 if case.verdict is None else case.verdict.discrepancy or 0.0
    return -case.outcome.severity, -discrepancy


def named_models(alike: Sequence[Model]) -> str:
    """A model file, and the engines that it is meant in."""
    engines = ", ".join(model.engine for model in alike)
    return f"{alike[0].system}/{alike[0].model} [{engines}]"
