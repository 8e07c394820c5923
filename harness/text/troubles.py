"""What doesn't agree, for the terminal: each thing once, however many cases it is seen in."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from rich.console import Console

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.finding import SAME, AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.text.causes import BEGIN_WITH_AUDIT, cause_sentences
from physics_crosscheck.harness.text.findings import audit_lines
from physics_crosscheck.harness.text.markup import escape
from physics_crosscheck.harness.text.places import placed
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.styles import STYLES

MOST_TOLD = 40


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


def print_troubles(console: Console, results: Results) -> None:
    """Print them: cases, what could not be done, findings, and last the causes."""
    found = troubles(results.cases)
    for trouble in found[:MOST_TOLD]:
        _print_trouble(console, trouble)
    if len(found) > MOST_TOLD:
        console.print(f"\nand {len(found) - MOST_TOLD} more, in results.json")
    _print_failures(console, results)
    _print_audits(console, results.models)
    for alike in explained_alike(results.models):
        _print_diagnosis(console, alike)


def _kind(case: Case) -> Hashable:
    if case.outcome is Outcome.DIFFERS:
        return case.outcome, case.folder, case.model
    if case.kind:
        return case.outcome, case.kind, case.verdict.component if case.verdict else ""
    return case.outcome, case.reason


def _worst_first(case: Case) -> tuple[int, float]:
    discrepancy = 0.0 if case.verdict is None else case.verdict.discrepancy or 0.0
    return -case.outcome.severity, -discrepancy


def _print_trouble(console: Console, trouble: Trouble) -> None:
    case = trouble.worst
    if case.outcome is Outcome.ABSENT:
        told = f"{counted(1 + len(trouble.others), 'case')}: {case.reason}"
        console.print(f"\n[{STYLES[case.outcome]}]{case.outcome}[/] {escape(told)}", soft_wrap=True)
        return
    console.print(f"\n[{STYLES[case.outcome]}]{case.outcome}[/] {escape(str(case.id))}")
    console.print(f"  {escape(case.reason)}", soft_wrap=True)
    for line in case.stdout.splitlines()[-6:]:
        console.print(f"  | {escape(line)}", soft_wrap=True)
    if trouble.others:
        console.print(f"  {escape(_others(trouble))}", soft_wrap=True)


def _others(trouble: Trouble) -> str:
    """How many more there are, and which."""
    one, others = trouble.worst, trouble.others
    models = {other.key[:2] for other in others} | {one.key[:2]}
    if len(models) > 1:
        names = dict.fromkeys(f"{case.system}/{case.model}" for case in (one, *others))
        return f"and {len(others)} more, of {len(names)} model files: {', '.join(names)}"
    by_engine = sorted(others, key=lambda case: case.engine)
    each = [
        f"{', '.join(case.scenario for case in cases)} [{engine}]"
        for engine, cases in groupby(by_engine, key=lambda case: case.engine)
    ]
    return f"and {len(others)} more: {'; '.join(each)}"


def _print_diagnosis(console: Console, alike: Sequence[Model]) -> None:
    model = alike[0]
    diagnosis = model.diagnosis
    assert diagnosis is not None
    console.print(f"\n[bold]cause[/] in {escape(named_models(alike))}", soft_wrap=True)
    if not diagnosis.explanations:
        console.print(f"  none found: {escape(diagnosis.failure)}", soft_wrap=True)
        return
    if model.unexplained_findings:
        console.print(f"  {BEGIN_WITH_AUDIT}, above", soft_wrap=True)
        return
    if not diagnosis.explained:
        console.print("  unexplained; what leaves least is")
    for sentence in cause_sentences(placed(diagnosis.explanations[0], model.folder)):
        console.print(f"  {escape(sentence)}", soft_wrap=True)


def _print_audits(console: Console, models: Iterable[Model]) -> None:
    for alike in audited_alike(models):
        console.print(f"\n[bold]audit[/] of {escape(named_models(alike))}", soft_wrap=True)
        for text in audit_lines(alike[0].findings):
            console.print(f"  {escape(text)}", soft_wrap=True)


def _print_failures(console: Console, results: Results) -> None:
    for model, what, why in untold_failures(results):
        style = STYLES[Outcome.FAILED]
        console.print(f"\n[{style}]FAILED[/] {what} of {escape(str(model.id))}")
        console.print(f"  {escape(why)}", soft_wrap=True)


def named_models(alike: Sequence[Model]) -> str:
    """A model file, and the engines that it is meant in."""
    engines = ", ".join(model.engine for model in alike)
    return f"{alike[0].system}/{alike[0].model} [{engines}]"
