"""Issues of a run: each problem once, with all cases that it affects."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import MEASURED, Case, ModelKey
from physics_crosscheck.harness.records.finding import SAME, AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results


@dataclass(frozen=True)
class Issue:
    """Cases with the same problem: the worst one, and the others."""

    worst: Case
    others: tuple[Case, ...]


def collect_issues(cases: Iterable[Case]) -> list[Issue]:
    """Group cases that don't agree and weren't accepted, worst first.

    Cases of one model file that differ form a group. So do cases with the same kind of difference
    in one component, and cases without a kind but with the same reason.
    """
    groups: dict[Hashable, list[Case]] = {}
    amiss = [c for c in cases if c.outcome is not Outcome.AGREES and not c.accepted]
    for case in sorted(amiss, key=_worst_first):
        groups.setdefault(_kind(case), []).append(case)
    return [Issue(worst, tuple(others)) for worst, *others in groups.values()]


def explained_alike(models: Iterable[Model]) -> list[tuple[Model, ...]]:
    """Group models that have a diagnosis by file and causes."""
    groups: dict[Hashable, list[Model]] = {}
    for model in models:
        if (diagnosis := model.diagnosis) is None:
            continue
        best = diagnosis.explanations[:1]
        causes = tuple((cause.id, cause.locations) for one in best for cause in one.causes)
        state = diagnosis.explained, bool(model.unexplained_findings), diagnosis.failure
        groups.setdefault((model.folder, model.model, causes, state), []).append(model)
    return [tuple(one) for one in groups.values()]


def audited_alike(models: Iterable[Model]) -> list[tuple[Model, ...]]:
    """Group models that have findings by file and findings."""
    groups: list[list[Model]] = []
    for model in models:
        if model.findings:
            same = next((alike for alike in groups if _same_findings(alike[0], model)), None)
            if same is None:
                groups.append([model])
            else:
                same.append(model)
    return [tuple(alike) for alike in groups]


def _same_findings(model: Model, other: Model) -> bool:
    mine, theirs = model.findings, other.findings
    return (model.folder, model.model, len(mine)) == (
        other.folder,
        other.model,
        len(theirs),
    ) and all(map(_is_like, mine, theirs))


def _is_like(finding: AuditFinding, other: AuditFinding) -> bool:
    """Return whether one message fits both: the numbers that only one contains must be equal."""
    return finding.is_like(other, SAME) and (
        finding.actual is not None or finding.message == other.message
    )


def untold_failures(results: Results) -> list[tuple[Model, str, str]]:
    """Return failures of models and their reasons, without those that the cases report."""
    reported: dict[ModelKey, set[str]] = {}
    for case in results.cases:
        reported.setdefault(case.key, set()).add(case.reason)
    return [
        (model, what, why)
        for model in results.models
        for what, why in model.failures
        if why not in reported.get(model.key, ())
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
    """Return a model file and the engines that it is used in."""
    engines = ", ".join(model.engine for model in alike)
    return f"{alike[0].system}/{alike[0].model} [{engines}]"
