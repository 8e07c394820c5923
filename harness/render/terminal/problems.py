"""Problems in a terminal: cause and fix of each, once for all affected cases."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.codes import part_code
from physics_crosscheck.harness.records.finding import AuditFinding, Explanation
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT, brief_cause, cause_sentences
from physics_crosscheck.harness.results.failure import acting_texts
from physics_crosscheck.harness.results.headline import difference, engine_title, is_single_file
from physics_crosscheck.harness.results.issues import (
    Issue,
    collect_issues,
    explained_alike,
    untold_failures,
)
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.next_steps import (
    DROPS_MASSLESS,
    advice_of,
    changes_of,
    massless_links,
    massless_places,
    stated_changes,
)
from physics_crosscheck.harness.results.places import lines_listed, placed, shown_line, shown_path
from physics_crosscheck.harness.results.status import counted, listed
from .console import STYLES, WORDS, print_wrapped

MAX_PROBLEMS = 40
"""Maximum number of problems to print; the report lists all."""

OUTPUT_LINES = 6
"""Number of last output lines of a failed case."""

INDENT = 8
"""Indentation of the lines after a problem's first line."""

NUMBERS = ("literal", "unbound literal", "taken")
"""Kinds of causes that are one number of the file."""

NUMBERS_NAMED = 3
"""Number of other numbers with the same effect to name."""

SAME_FAULT = ("inertia", "stiffness", "damping", "acceleration", "linearization")
"""Kinds of findings without a line, about terms that the motions depend on."""

Note = tuple[str, str]
"""A label such as `cause`, or an empty one, and its text."""


@dataclass(frozen=True, kw_only=True)
class PrintedProblem:
    """A problem.

    Attributes:
        outcome: outcome that gives its status word and colour.
        code: message code of the cause, or else of the observation.
        name: the model file or the engines that it concerns.
        headline: the observation.
        notes: cause, place and fix.
        output: output of the engine.
    """

    outcome: Outcome
    code: str
    name: str
    headline: str
    notes: tuple[Note, ...] = ()
    output: tuple[str, ...] = ()


def print_problems(console: Console, results: Results, *, details: bool = False) -> list[str]:
    """Print every problem of a run, the worst first, and return the codes of failures.

    Args:
        console: to print on.
        results: results of the run.
        details: whether to list all cases, findings and residuals.
    """
    all_problems = problems(results, details=details)
    width = max((len(WORDS[problem.outcome]) for problem in all_problems), default=0)
    for problem in all_problems[:MAX_PROBLEMS]:
        _print_problem(console, problem, max(width, 5))
    if len(all_problems) > MAX_PROBLEMS:
        hidden = counted(len(all_problems) - MAX_PROBLEMS, "more problem")
        print_wrapped(console, f"  {hidden}: see the report")
    return [problem.code for problem in all_problems if problem.outcome is not Outcome.ABSENT]


def problems(results: Results, *, details: bool = False) -> list[PrintedProblem]:
    """Return the problems of a run, the worst first."""
    short = is_single_file(results)
    found_problems = [
        _of_trouble(one, results, short, details) for one in collect_issues(results.cases)
    ]
    found_problems += [
        PrintedProblem(
            outcome=Outcome.FAILED,
            code=part_code(),
            name=model.engine if short else str(model.id),
            headline=with_code(part_code(), f"the {what} failed: {why}"),
        )
        for model, what, why in untold_failures(results)
    ]
    found_problems += _faults(results, short, details)
    return sorted(found_problems, key=lambda one: -one.outcome.severity)


def _print_problem(console: Console, problem: PrintedProblem, width: int) -> None:
    word = WORDS[problem.outcome]
    lead = f"  {word}{' ' * (width - len(word))} "
    first = f"{problem.name}  {problem.headline}"
    if len(lead) + len(first) > console.width:  # the file name is easier to find without folders
        print_wrapped(
            console, problem.name, lead=lead, style=STYLES[problem.outcome], indent=INDENT
        )
        print_wrapped(console, problem.headline, lead=" " * INDENT, indent=INDENT)
    else:
        print_wrapped(console, first, lead=lead, style=STYLES[problem.outcome], indent=INDENT)
    for label, text in problem.notes:
        before = f"{label}: ".ljust(7) if label else ""
        print_wrapped(console, text, lead=" " * INDENT + before, indent=INDENT + len(before))
    for line in problem.output:
        print_wrapped(console, line, lead=f"{' ' * INDENT}| ", indent=INDENT + 2)


def _of_trouble(issue: Issue, results: Results, short: bool, details: bool) -> PrintedProblem:
    case, cases = issue.worst, (issue.worst, *issue.others)
    if case.outcome is Outcome.DIFFERS:
        return _difference(cases, results, short, details)
    headline = with_code(case.code, case.reason)
    if case.outcome is Outcome.ABSENT:
        files = [shown_path(one.folder) for one in cases]
        name = listed(files, NUMBERS_NAMED) if case.kind else counted(len(cases), "case")
        return PrintedProblem(outcome=case.outcome, code=case.code, name=name, headline=headline)
    name = _engine_name(cases) if short else _case_name(case)
    notes = [] if short or not issue.others else [("", _others(cases, details))]
    notes += _acting_notes(results.model_of(case))
    return PrintedProblem(
        outcome=case.outcome,
        code=case.code,
        name=name,
        headline=headline,
        notes=tuple(notes),
        output=tuple(_printed(case)[-OUTPUT_LINES:]),
    )


def _acting_notes(model: Model | None) -> Iterator[Note]:
    """Yield what the numbers of a file act as, if its system declares what they are to act as."""
    if model is not None and model.declares:
        yield from acting_texts(model.acting)


def _printed(case: Case) -> list[str]:
    """Return the lines that a case printed, without those that an engine always prints."""
    banners = tuple(engine.banner for engine in engines().values() if engine.banner)
    return [line for line in case.stdout.splitlines() if not line.startswith(banners)]


def _case_name(case: Case) -> str:
    """Return the name of a case; of a file that no engine reached, its path."""
    return shown_path(case.folder) if case.engine == "-" else str(case.id)


def _engine_name(cases: Sequence[Case]) -> str:
    names = dict.fromkeys(case.engine for case in cases)
    return case.model if (case := cases[0]).engine == "-" else ", ".join(names)


def _others(cases: Sequence[Case], details: bool) -> str:
    """Return how many cases have the same problem; with details, their names."""
    models = dict.fromkeys(f"{case.system}/{case.model}" for case in cases)
    text = f"the same in {counted(len(cases) - 1, 'more case')}"
    if len(models) > 1:
        text += f" of {counted(len(models), 'model file')}"
    return f"{text}: {', '.join(str(case.id) for case in cases[1:])}" if details else text


def _difference(
    cases: Sequence[Case], results: Results, short: bool, details: bool
) -> PrintedProblem:
    """Return the problem of a model file whose motion differs in some engines."""
    worst = cases[0]
    keys = {case.key for case in cases}
    models = [model for model in results.models if model.key in keys]
    notes: list[Note] = []
    groups = explained_alike(models)
    for alike in groups:
        named = f" [{', '.join(one.engine for one in alike)}]" if len(groups) > 1 else ""
        notes += _cause_notes(alike[0], named, details)
        notes += _acting_notes(alike[0])
    engines = list(dict.fromkeys(case.engine for case in cases))
    name = ", ".join(engines) if short else f"{worst.system}/{worst.model} [{', '.join(engines)}]"
    place = [one for one in results.cases if (one.folder, one.model) == (worst.folder, worst.model)]
    codes = [code for alike in groups for code in _explaining_codes(alike[0])]
    headline = difference(worst) if codes else with_code(worst.code, difference(worst))
    if len(place) > len({one.engine for one in place}):
        verb = "differs" if len(cases) == 1 else "differ"
        headline += f" ({worst.scenario}); {len(cases)} of {len(place)} cases {verb}"
    if details:
        notes.append(("cases", ", ".join(str(case.id) for case in cases)))
    code = codes[0] if codes else worst.code
    return PrintedProblem(
        outcome=worst.outcome, code=code, name=name, headline=headline, notes=tuple(notes)
    )


def _explaining_codes(model: Model) -> list[str]:
    """Return the codes of the causes of a difference, or of the findings that replace them."""
    diagnosis = model.diagnosis
    if diagnosis is None or not diagnosis.explained:
        return [one.code for one in model.unexplained_findings]
    return [cause.code for cause in diagnosis.explanations[0].causes]


def _cause_notes(model: Model, engines: str, details: bool) -> list[Note]:
    diagnosis = model.diagnosis
    assert diagnosis is not None
    best = diagnosis.best and placed(diagnosis.best, model.folder)
    if not diagnosis.explained or best is None:
        finding_notes = list(map(_finding_note, _of_file(model, model.unexplained_findings)))
        if finding_notes and not details:
            return [*finding_notes, *_fixes(model, model.unexplained_findings)]
        nothing = ": ".join(filter(None, ["none found", diagnosis.failure]))
        closest = nothing if best is None else f"none found; closest: {cause_sentences(best)[0]}"
        text = BEGIN_WITH_AUDIT if finding_notes else closest
        return [
            *finding_notes,
            (f"cause{engines}", text),
            *_fixes(model, model.unexplained_findings),
        ]
    if details:
        *sentences, tail = cause_sentences(best)
        coded = zip((cause.code for cause in best.causes), sentences, strict=True)
        notes = [(f"cause{engines}", with_code(*one)) for one in coded]
        notes.append(("", tail))
        return [*notes, *_cause_fixes(model, best.causes)]
    notes = [note for cause in best.causes for note in _brief_notes(cause, model, engines)]
    return [*notes, *_tie_notes(best, model), *_cause_fixes(model, best.causes)]


def _tie_notes(explanation: Explanation, model: Model) -> list[Note]:
    """Return other numbers of the file with the same effect, unless the audit decides."""
    causes = explanation.causes
    if any(_is_same(finding, cause) for finding in model.findings for cause in causes):
        return []
    tied = [str(one) for one in explanation.tied_with if one.kind in NUMBERS]
    names = listed(tied, NUMBERS_NAMED)
    return [("or", f"{names}: the same effect on these motions")] if tied else []


def _brief_notes(cause: Cause, model: Model, engines: str) -> list[Note]:
    massless = massless_links(cause, model)
    if massless:
        text = f"{engine_title(model.engine)} {DROPS_MASSLESS}"
        return [
            (f"cause{engines}", with_code(cause.code, text)),
            ("", massless_places(massless, model)),
        ]
    text = brief_cause(cause)
    if cause.kind == "dropped":
        text = f"{engine_title(model.engine)} drops {cause}"
    notes = [(f"cause{engines}", with_code(cause.code, text))]
    if cause.locations and not cause.replacement:  # a fix uses other names
        notes.append(("", lines_listed([(one, "") for one in cause.locations], "")))
    return notes


def _cause_fixes(model: Model, causes: Sequence[Cause]) -> list[Note]:
    texts = [f"change {one}" for one in changes_of(model)]
    return [("fix", text) for text in [*texts, *advice_of(model, causes)]]


def _fixes(model: Model, findings: Iterable[AuditFinding]) -> list[Note]:
    changes = dict.fromkeys(map(str, stated_changes(model, findings)))
    return [("fix", f"change {one}") for one in changes]


def _of_file(model: Model, findings: Iterable[AuditFinding]) -> list[AuditFinding]:
    """Return findings with the paths of their lines relative to the working folder."""
    return [
        replace(one, location=shown_line(model.folder, one.location)) if one.location else one
        for one in findings
    ]


def _finding_note(finding: AuditFinding) -> Note:
    where = "" if finding.location is None else f"{finding.location}: "
    return "found", with_code(finding.code, f"{where}{finding.message}")


def _faults(results: Results, short: bool, details: bool) -> list[PrintedProblem]:
    """Return one problem per model file with audit findings that no cause explains."""
    files: dict[tuple[str, str], list[Model]] = {}
    for model in results.models:
        if model.findings and not model.accepted:
            files.setdefault((model.folder, model.model), []).append(model)
    faults = [_fault(models, short, details) for models in files.values()]
    return [one for one in faults if one is not None]


def _fault(models: Sequence[Model], short: bool, details: bool) -> PrintedProblem | None:
    wanted: dict[tuple[object, ...], tuple[AuditFinding, list[Model]]] = {}
    for model in models:
        for audit_finding in model.findings:
            if details or not _is_explained(audit_finding, models):
                key = audit_finding.kind, audit_finding.subject, audit_finding.location
                wanted.setdefault(key, (audit_finding, []))[1].append(model)
    if not wanted or (not details and _poses_follow(wanted, models)):
        return None
    lines = [entry for entry in wanted.values() if entry[0].location is not None]
    rest = [entry for entry in wanted.values() if entry[0].location is None]
    shown = [*lines, *rest] if details or not lines else lines
    notes = []
    for audit_finding, where in shown:
        (finding,) = _of_file(where[0], [audit_finding])
        notes.append(_finding_note(finding))
    if len(shown) < len(wanted):
        more = counted(len(wanted) - len(shown), "more finding")
        notes.append(("also", f"{more} about computed terms; --details lists them"))
    for model in models:
        notes += [note for note in _fixes(model, model.findings) if note not in notes]
    engines = dict.fromkeys(model.engine for _, where in shown for model in where)
    name = f"{models[0].system}/{models[0].model} [{', '.join(engines)}]"
    return PrintedProblem(
        outcome=Outcome.DIFFERS,
        code=shown[0][0].code,
        name=models[0].model if short else name,
        headline=f"the audit finds {counted(len(wanted), 'fault')} in the file",
        notes=tuple(notes),
    )


def _poses_follow(wanted: Iterable[tuple[object, ...]], models: Sequence[Model]) -> bool:
    """Return whether only poses remain, and the fixes of causes correct every number."""
    if any(kind != "pose" for kind, *_ in wanted):
        return False
    fixes = {note for model in models for note in _fixes(model, model.findings)}
    of_causes = {
        note
        for model in models
        if model.diagnosis is not None and model.diagnosis.explained
        for note in _cause_fixes(model, model.diagnosis.explanations[0].causes)
    }
    return bool(fixes) and fixes <= of_causes


def _is_explained(finding: AuditFinding, models: Sequence[Model]) -> bool:
    """Return whether another problem already reports the same fault: a cause, or a difference."""
    for model in models:
        diagnosis = model.diagnosis
        if diagnosis is None or not diagnosis.explanations:
            continue
        if not diagnosis.explained:
            if any(finding.is_like(known, 0.1) for known in model.unexplained_findings):
                return True
            continue
        # A default is reported only with a wrong term, which follows from the cause.
        if finding.kind == "default" or (finding.location is None and finding.kind in SAME_FAULT):
            return True
        causes = diagnosis.explanations[0].causes
        if any(
            _is_same(finding, cause) or finding in massless_links(cause, model) for cause in causes
        ):
            return True
    return False


def _is_same(finding: AuditFinding, cause: Cause) -> bool:
    if set(finding.subject) & set(cause.subject):
        return True
    where = finding.location
    return where is not None and any(_is_same_place(where, each) for each in cause.locations)


def _is_same_place(line: SourceLine, other: SourceLine) -> bool:
    """Return whether two lines have the same number, or are equal if no number is known."""
    if Path(line.file).name != Path(other.file).name or line.line != other.line:
        return False
    return line.span is None or other.span is None or line.span == other.span
