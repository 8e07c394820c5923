"""Print results in a terminal: the verdict, the fixes, the models, and a summary line."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from physics_crosscheck.harness.engines.registry import absent_extras, engines_reading
from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import Case, EventTime, Stepping, WholeStep
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.results.coverage import (
    coverage_lines,
    coverage_summary,
    unread_line,
)
from physics_crosscheck.harness.results.failure import acting_texts, advice_lines
from physics_crosscheck.harness.results.headline import by_poses, headline, is_single_file
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from physics_crosscheck.harness.results.places import shown_path
from physics_crosscheck.harness.results.status import (
    LEAST,
    counted,
    duration,
    listed,
    percent,
    step_words,
    unread_words,
    unsettled_steps,
)
from physics_crosscheck.harness.results.visible import visible
from .console import STYLES, WORDS, print_hint, print_wrapped
from .models_table import finite_values, is_chaotic, print_matrix, print_models
from .problems import MAX_PROBLEMS, print_problems

GROWS = 1e-9
"""Minimum distance of a step's largest eigenvalue from the unit circle, above rounding."""

MAX_CASES = 12
"""Maximum number of cases of a file to name."""

COUNTS_AT = 44
"""Column of a header's counts if there is room."""


def print_results(
    console: Console,
    results: Results,
    *,
    quiet: bool = False,
    details: bool = False,
    report: Path | None = None,
) -> None:
    """Print the targets, the problems with their fixes, the models, and the summary.

    Args:
        console: to print on; lines are wrapped to its width.
        results: results of the run.
        quiet: whether to print problems and the summary only.
        details: whether to print all details of the report: errors, coverage, linearizations,
            steps.
        report: path of the written page.
    """
    several = len({case.folder for case in results.cases}) > 1
    if not quiet:
        if (first := headline(results)) and any(case.engine != "-" for case in results.cases):
            print_wrapped(console, " ".join(first))
        _print_header(console, results)
        if several:
            print_matrix(console, results)
    codes = print_problems(console, results, details=details)
    if not quiet:
        _print_models(console, results, details)
        if details:
            _print_details(console, results)
        _print_advice(console, results, details)
        _print_notes(console, results, details)
    if results.baseline is not None:
        _print_changes(console, results.baseline)
        codes += [
            one.code
            for one in results.baseline.changes
            if not one.status.passes and one.status is not Status.NEW
        ]
    _print_last(console, summary(results), report)
    if not quiet:
        print_hint(console, explain_hint(codes))


def summary(results: Results) -> str:
    """Return one line: how many cases agree and to how many digits, or how many do not."""
    counts = Counter(case.outcome for case in results.cases if not case.accepted)
    reached = all(case.engine != "-" for case in results.cases)
    unit = "engine" if reached and is_single_file(results) else "case"
    total = len(results.cases) - counts[Outcome.ABSENT]
    agreeing = [case for case in results.cases if case.outcome is Outcome.AGREES]
    digits = finite_values(one.digits for one in agreeing)
    to = f" to {min(digits):.1f} digits" if digits else ""
    if agreeing and results.stopped and len(agreeing) == total:
        whole = total + len(results.not_run)
        parts = [f"{total} of {counted(whole, unit)} {_verb(total, 'agrees', 'agree')}{to}"]
    elif not total:
        parts = ["no case was run" if not results.cases else "nothing was tested"]
    elif len(agreeing) == total:
        every = f"1 {unit} agrees" if total == 1 else f"all {total} {unit}s agree"
        every = f"both {unit}s agree" if total == 2 else every
        parts = [f"{every}{to}"]
    else:
        parts = _failing(counts, total, unit)
        if agreeing:
            share = "" if parts else f" of {counted(total, unit)}"
            parts.append(f"{len(agreeing)}{share} {_verb(len(agreeing), 'agrees', 'agree')}{to}")
    if counts[Outcome.ABSENT]:
        parts.append(f"{counts[Outcome.ABSENT]} skipped")
    parts += _reservations(results)
    line = ", ".join(parts)
    return f"{line[0].upper()}{line[1:]} ({_time(results.seconds)})"


def _failing(counts: Counter[Outcome], total: int, unit: str) -> list[str]:
    """Return the number of cases per failing outcome, the worst first."""
    verbs = {
        Outcome.FAILED: ("failed", "failed"),
        Outcome.DIFFERS: ("differs", "differ"),
        Outcome.UNRESOLVED: ("is unresolved", "are unresolved"),
        Outcome.REFUSED: ("was refused", "were refused"),
    }
    if unit == "engine":
        verbs[Outcome.REFUSED] = ("refuses the file", "refuse the file")
    failing = [(counts[one], *verb) for one, verb in verbs.items() if counts[one]]
    if not failing:
        return []
    number, *verb = failing[0]
    first = f"{number} of {counted(total, unit)} {_verb(number, *verb)}"
    return [first, *(f"{n} {_verb(n, *each)}" for n, *each in failing[1:])]


def _verb(number: int, singular: str, several: str) -> str:
    return singular if number == 1 else several


def _reservations(results: Results) -> list[str]:
    """Return the reservations of a summary: other faults, failures, and omitted parts."""
    parts = []
    differing = {(c.folder, c.model) for c in results.cases if c.outcome is Outcome.DIFFERS}
    faulty = {
        (model.folder, model.model)
        for model in results.models
        if model.findings and not model.accepted
    }
    if hidden := faulty - differing:
        parts.append(f"the audit finds faults in {counted(len(hidden), 'model file')}")
    failed = Counter(what for model in results.models for what, _ in model.failures)
    parts += [f"{counted(number, what, _PLURALS[what])} failed" for what, number in failed.items()]
    if accepted := sum(bool(case.accepted) for case in results.cases):
        parts.append(f"{counted(accepted, 'difference')} accepted")
    if refused := len(results.refusals):
        parts.append(f"{counted(refused, 'refusal')} ignored without --strict")
    if posed := sum(map(by_poses, results.cases)):
        parts.append(f"{posed} by poses only")
    if results.stopped:
        parts.append(f"stopped by {results.stopped}, {len(results.not_run)} not run")
    if results.cached:
        parts.append(f"{results.cached} reused from the cache")
    return parts


_PLURALS = {"audit": "audits", "linearization": "linearizations", "diagnosis": "diagnoses"}


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"


def largest(case: Case) -> Number:
    """Return the largest discrepancy or uncertainty of a case, over components and segments."""
    if case.verdict is None:
        return None
    sizes = finite_values((case.verdict.largest_discrepancy, case.verdict.largest_uncertainty))
    return max(sizes, default=None)


def agreement(worst: Number) -> str:
    """Return the end of pytest's summary: the agreement of cases; empty if none agrees."""
    return "" if worst is None else f"; all that agree do so to {worst:.1e}"


def case_line(done: int, total: int, case: Case) -> str:
    """Return one plain line for a finished case, for logs; a total of 0 is unknown."""
    verdict = case.verdict
    number = ""
    if case.shown is Outcome.DIFFERS and verdict is not None and verdict.discrepancy is not None:
        number = f"  off by {percent(verdict.discrepancy)}"
    elif (digits := case.digits) is not None and case.outcome is Outcome.AGREES:
        number = f"  {digits:.1f} digits"
    count = f"{done}/{total}" if total else f"{done}"
    return f"[{count}] {WORDS[case.shown]:<10} {case.id}{number}"


def _print_header(console: Console, results: Results) -> None:
    """Print the targets, and how many cases have which status."""
    if is_single_file(results):
        folder = results.cases[0].folder
        title = next((one.title for one in results.systems if one.folder == folder), "")
        print_wrapped(console, f"{shown_path(folder)}  {title}".rstrip(), indent=2)
        return
    systems = {case.folder: case.system for case in results.cases}
    models = counted(len({(case.folder, case.model) for case in results.cases}), "model")
    first = next(iter(systems.values()), "")
    name = f"{first}  {models}" if len(systems) == 1 else f"{len(systems)} systems, {models}"
    counts = Counter(case.shown for case in results.cases)
    words = ", ".join(f"{counts[one]} {WORDS[one]}" for one in Outcome if counts[one])
    if systems:
        print_wrapped(console, f"{name.ljust(min(COUNTS_AT, console.width // 2))}  {words}")


def _print_advice(console: Console, results: Results, details: bool) -> None:
    """Print implausible numbers of each model file, by kind, unless they are accepted."""
    files = {(model.folder, model.model): model for model in results.models if model.advice}
    for model in files.values():
        count = counted(len(model.advice), "implausible number")
        title = f"{shown_path(model.model)}: {count} (advice, not part of the verdict)"
        console.print(f"[bold]{title}[/]")
        for line in advice_lines(model.advice, details=details):
            print_wrapped(console, line, lead="  ", indent=4)


def _print_models(console: Console, results: Results, details: bool) -> None:
    cases = [c for c in results.cases if c.engine != "-" and c.outcome is not Outcome.ABSENT]
    if details:
        if any(case.shown is not Outcome.AGREES for case in cases):
            console.print()
        print_models(console, cases)
    elif len({case.folder for case in cases}) == 1:
        red = any(case.shown is not Outcome.AGREES for case in cases)
        if red and len({case.model for case in cases}) > 1:
            print_matrix(console, results)
        else:
            _print_engines(console, [case for case in cases if case.passes])


def _print_engines(console: Console, cases: Sequence[Case]) -> None:
    """Print one line per engine in which cases of a folder pass."""
    by_engine: dict[str, list[Case]] = {}
    for case in cases:
        by_engine.setdefault(case.engine, []).append(case)
    width = max((len(name) for name in by_engine), default=0)
    for engine, agreeing in by_engine.items():
        digits = finite_values(one.digits for one in agreeing if not one.accepted)
        parts = [f"{min(digits):.1f} digits"] if digits else []
        parts += dict.fromkeys(one.accepted for one in agreeing if one.accepted)
        parts += ["poses only"] if any(map(by_poses, agreeing)) else []
        if len(cases) > len(by_engine):
            parts.insert(0, f"{counted(len(agreeing), 'case'):<8}")
        if chaotic := sum(map(is_chaotic, agreeing)):
            parts.append(f"{chaotic} chaotic")
        style, word = STYLES[Outcome.AGREES], WORDS[Outcome.AGREES]
        text = f"{engine:<{width}}  {'  '.join(parts)}"
        print_wrapped(console, text, lead=f"  {word:<5} ", style=style, indent=8)


def _print_notes(console: Console, results: Results, details: bool) -> None:
    """Print a short line each about coverage, accepted differences and reservations."""
    if details:
        return
    if line := unread_line(results.models):
        print_wrapped(console, line)
    if len({case.folder for case in results.cases}) == 1 and (
        line := coverage_summary(results.models)
    ):
        print_wrapped(console, f"{line}; --details lists the rest")
        for line in _acting_lines(results):
            print_wrapped(console, line, indent=2)
    for system in results.systems:
        meshes = () if system.scene is None else system.scene.unread
        unseen = ("missing", "not a regular file", "without a reader")
        missing = [one for one in meshes if one.problem in unseen]
        if missing:
            print_wrapped(console, f"{unread_words(missing)}; these shapes are left out")
    lines = [
        *time_step_lines(results.cases),
        *creep_lines(results),
        *event_lines(results.cases),
        *whole_step_lines(results.cases, details=False),
    ]
    for line in lines:
        print_wrapped(console, line)
    for reason in dict.fromkeys(case.reason for case in results.cases if by_poses(case)):
        print_wrapped(console, reason)
    agreeing = [c for c in results.cases if c.outcome is Outcome.AGREES and not by_poses(c)]
    if reserved := [case for case in agreeing if case.reason]:
        verb = _verb(len(reserved), "agrees", "agree")
        text = f"{counted(len(reserved), 'case')} {verb} with a reservation"
        print_wrapped(console, f"{text}; --details lists {_verb(len(reserved), 'it', 'them')}")


def _print_details(console: Console, results: Results) -> None:
    differ = {case.id.of_model for case in results.cases if case.outcome is Outcome.DIFFERS}
    models = [model for model in results.models if model.id not in differ]
    _print_list(console, "linearization", [*_linear(models), *_single_steps(models)])
    _print_list(console, "events in full runs at dt", event_lines(results.cases, details=True))
    steps = whole_step_lines(results.cases, details=True)
    lines = [*dynamics_lines(results.cases), *stepping_lines(results.cases), *steps]
    _print_list(console, "single steps", lines)
    _print_list(console, "deciding checks", deciding_lines(results.cases))
    reserved = [c for c in results.cases if c.outcome is Outcome.AGREES and c.reason]
    _print_list(console, "reservations", [f"{case.id}: {case.reason}" for case in reserved])
    accepted = [c for c in results.cases if c.outcome is not Outcome.AGREES and c.accepted]
    lines = [f"{case.id}: {WORDS[case.outcome]}, {case.accepted}" for case in accepted]
    _print_list(console, "accepted", lines)
    _print_list(console, "acting", list(_acting_lines(results)))
    _print_list(console, "coverage", coverage_lines(results.models))


def _acting_lines(results: Results) -> Iterator[str]:
    """Yield what the numbers of agreeing files act as, if their systems declare it."""
    problems = {case.key for case in results.cases if case.outcome is not Outcome.AGREES}
    for model in results.models:
        if model.declares and model.key not in problems:
            for label, text in acting_texts(model.acting):
                yield f"{model.id} {label}: {text}"


def _print_list(console: Console, title: str, lines: Sequence[str]) -> None:
    if not lines:
        return
    console.print(f"\n[bold]{title}[/]")
    for line in lines:
        print_wrapped(console, line, lead="  ", indent=4)


def _linear(models: Iterable[Model]) -> list[str]:
    """Return the errors of engines' linearizations; differences are findings."""
    alike = [
        (model, linearization)
        for model in models
        for linearization in model.linearizations
        if not linearization.differs
    ]
    lost = dict.fromkeys(
        str(model.id) for model, linearization in alike if linearization.a_bound is None
    )
    errors: list[tuple[float, Model, EngineLinearization]] = [
        (max(linearization.a_error, linearization.b_error or 0.0), model, linearization)
        for model, linearization in alike
        if linearization.a_error is not None and linearization.a_bound is not None
    ]
    lines = []
    if errors:
        worst, model, linearization = max(errors, key=lambda entry: entry[0])
        lines.append(
            f"{counted(len(errors), 'linearization')} of the engines: A and B agree with the"
            f" equations to {worst:.1e} of the largest entry"
            f" (worst: {model.id} about {linearization.equilibrium})"
        )
    if lost:
        lines.append(f"linearization without a limit: {', '.join(lost)}")
    return lines


def _single_steps(models: Iterable[Model]) -> list[str]:
    """Return the error of a linearized step against the engine's rule, and growing modes."""
    steps = [
        (model, linearization, linearization.one_step)
        for model in models
        for linearization in model.linearizations
        if not linearization.differs and linearization.one_step is not None
    ]
    ruled = [
        (step.error, model)
        for model, _, step in steps
        if step.error is not None and not step.differs  # the cases report effects within a step
    ]
    lines = []
    if ruled:
        error, worst = max(ruled, key=lambda entry: entry[0])
        lines.append(
            f"{counted(len(ruled), 'linearized step')}: follows the engine's own rule to"
            f" {error:.1e} of the largest entry that it changes (worst: {worst.id})"
        )
    for model, linearization, step in steps:
        grown, exact = step.radius or 0.0, step.exact_radius or 0.0
        if grown > 1 + GROWS and exact < 1 - GROWS:
            lines.append(
                f"{model.id} grows by {grown - 1:.1e} in each step of {step.step:g} s about"
                f" {linearization.equilibrium}, where the equations decay"
            )
    return lines


def _print_changes(console: Console, baseline: BaselineChanges) -> None:
    """Print changes since the baseline; only the report lists cases that were never accepted."""
    changes = [one for one in baseline.changes if one.status is not Status.NEW]
    alike: dict[str, list[Diff]] = {}
    for change in changes:
        begin = f"{change.label}  {with_code(change.code, f'{change.system}/{change.model}')}"
        alike.setdefault(begin, []).append(change)
    lines = [f"{begin}  {_changes_text(group)}" for begin, group in alike.items()]
    if (hidden := len(lines) - MAX_PROBLEMS) > 0:
        del lines[MAX_PROBLEMS:]
        lines.append(f"{counted(hidden, 'more model file')}: see the report")
    _print_list(console, f"changes since {baseline.name}", lines)


def _changes_text(changes: Sequence[Diff]) -> str:
    """Return the cases of one model file that changed, and the first one's message."""
    first, *others = changes
    message = "; ".join(first.messages)
    if all(change.messages == first.messages for change in others):
        names = [f"{one.scenario} [{one.engine}]" for one in changes]
        more = f" and {len(names) - MAX_CASES} more" if len(names) > MAX_CASES else ""
        return f"{', '.join(names[:MAX_CASES])}{more}: {message}"
    more = f"; {counted(len(others), 'more case')} of the file in the report"
    return f"{first.scenario} [{first.engine}]: {message}{more}"


def _print_last(console: Console, line: str, report: Path | None) -> None:
    """Print the summary and the report's path on one line if they fit; the path is never split."""
    where = "" if report is None else f"Report: {shown_path(report)}"
    if where and len(line) + len(where) + 2 <= console.width:
        print_wrapped(console, f"{line}. {where}")
        return
    print_wrapped(console, line)
    if where:
        console.print(Text(visible(where)), soft_wrap=True)


def dynamics_lines(cases: Iterable[Case]) -> list[str]:
    """Return one line for all that agree; a case that differs reports it as its reason."""
    alike = [
        (one.forward_dynamics, one)
        for one in cases
        if one.forward_dynamics is not None and one.forward_dynamics.outcome is Outcome.AGREES
    ]
    if not alike:
        return []
    largest, worst = max(alike, key=lambda entry: entry[0].discrepancy or 0.0)
    states = sum(one.states for one, _ in alike)
    return [
        f"accelerations of {counted(len(alike), 'case')} at {counted(states, 'state')} agree to"
        f" {largest.discrepancy or 0.0:.1e} of the largest (worst: {worst.id})"
    ]


def event_lines(cases: Iterable[Case], *, details: bool = False) -> list[str]:
    """Return one line about the event times of full runs, or one for each event."""
    seen = [(event, case) for case in cases if case.full_run for event in case.full_run.events]
    if details:
        by_case = itertools.groupby(seen, lambda entry: entry[1].id)
        return [
            f"{name}: {'; '.join(_event_text(event) for event, _ in group)}"
            for name, group in by_case
        ]
    timed = [(abs(e.in_run - e.time), e, case) for e, case in seen if e.in_run is not None]
    if not timed:
        return []
    largest, event, worst = max(timed, key=lambda entry: entry[0])
    hidden = len(seen) - len(timed)
    unseen = f"; {hidden} not seen at dt" if hidden else ""
    return [
        f"{counted(len(timed), 'event')} of full runs at most {duration(largest)} off "
        f"(worst: {event.part}, {worst.id}){unseen}"
    ]


def _event_text(event: EventTime) -> str:
    """Return an event, and how far its time is off in the run at dt."""
    seen = "not seen" if event.in_run is None else f"{duration(abs(event.in_run - event.time))} off"
    return f"{event.part}, {event.change} at {event.time:.6g} s: {seen}"


FORMLESS = "contacts without a closed form"
"""End of the note on contacts that only two engines can judge."""

LEAST_CREEP = 1e-3
"""Speed of a contact that sticks above which it creeps, m/s."""

OFF = 0.01
"""Error of a time step above which several files are counted."""

AT_A_LIMIT = " at a limit"
"""End of the name of forces that are also counted without it."""

UNSETTLED = 4
"""Number of whole steps without agreement that are listed without `--details`."""


def whole_step_lines(cases: Iterable[Case], *, details: bool) -> list[str]:
    """Return a line for all whole steps that agree, one for each that differs or is unresolved."""
    cases = list(cases)
    steps = [(case.whole_step, case) for case in cases if case.whole_step is not None]
    alike = [(step, case) for step, case in steps if step.outcome is Outcome.AGREES]
    lines = []
    if alike:
        largest, worst = max(alike, key=lambda entry: entry[0].discrepancy or 0.0)
        acted = Counter[str]()
        for step, _ in alike:
            acted.update({term.name: term.count for term in step.acted})
        unresolved = sum(step.unresolved for step, _ in alike)
        more = f"; {counted(unresolved, 'more state')} unresolved" if unresolved else ""
        kinds = ", ".join(f"{count} {name}" for name, count in acted.items())
        if details:
            what = f", with {kinds}," if kinds else ", where no limit, contact or drive acts,"
            number = counted(sum(step.states for step, _ in alike), "state")
            which = f" (worst: {worst.id})" if len(alike) > 1 else ""
            size = largest.discrepancy or 0.0
            lines.append(f"whole steps at {number}{what} agree to {size:.1e}{which}{more}")
        elif kinds or more:
            forces = [name for name in acted if not name.endswith(AT_A_LIMIT)]
            what = ", ".join(forces) or "single steps"
            lines.append(f"{what}: follow the file{more}")
        lines += _not_compared(alike)
    lines += [
        f"whole steps in {case.engine}: {one}"
        for step, case in steps
        for one in step.contact_counts
    ]
    lines += dict.fromkeys(f"whole steps: {one}" for step, _ in steps for one in step.between)
    unsettled = [
        f"{case.id}: whole steps {why}" for case in cases if (why := unsettled_steps(case))
    ]
    shown = len(unsettled) if details else UNSETTLED
    lines += unsettled[:shown]
    if len(unsettled) > shown:
        lines.append(f"whole steps of {len(unsettled) - shown} more cases; --details lists them")
    others = [(case, why) for step, case in steps if (why := _why_not_compared(step))]
    if details:
        lines += [f"{case.id}: whole steps {why}" for case, why in others]
    elif others:
        engines = ", ".join(dict.fromkeys(case.engine for case, _ in others))
        lines.append(f"whole steps without a verdict in {engines}; --details gives the reason")
    return lines


def _not_compared(alike: Sequence[tuple[WholeStep, Case]]) -> Iterator[str]:
    """Yield what whole steps that agree do not compare, with its engines."""
    parts: dict[str, list[str]] = {}
    for step, case in alike:
        for part in step.omitted:
            parts.setdefault(part, []).append(case.engine)
    for part, names in parts.items():
        by_name = engines_reading(Path(alike[0][1].model).suffix)
        others = [one.name for one in by_name if one.on_request and part.endswith(FORMLESS)]
        others = [x for x in others if x not in {*absent_extras(), *(c.engine for _, c in alike)}]
        more = f"; --engine {names[0]} --engine {others[0]} compares the contacts" if others else ""
        yield f"not compared in {', '.join(dict.fromkeys(names))}: {part}{more}"


def _why_not_compared(step: WholeStep) -> str:
    """Return why whole steps have no verdict; empty if they have one, or nothing acts in them."""
    has_none = step.outcome is None and step.uncovered
    return f"not compared: {', '.join(step.uncovered)}" if has_none else ""


def time_step_lines(cases: Iterable[Case]) -> list[str]:
    """Return the error of the time step of one file, by engine, or one line for several files."""
    steps: dict[str, list[str]] = {}
    errors = list[tuple[float, Case]]()
    for case in cases:
        if (step := case.time_step) is not None:
            run, text = case.full_run, step_words(step)
            if run is not None and run.global_error is not None:
                text += f"; {percent(run.global_error)} in the full run"
            steps.setdefault(text, []).append(case.engine)
            errors.append((math.inf if step.error is None else step.error, case))
    if len({(case.folder, case.model) for _, case in errors}) > 1:
        coarse = sum(error > OFF for error, _ in errors)
        worst = max(errors, key=lambda one: one[0])[1]
        assert worst.time_step is not None
        if not coarse:
            off = percent(max(LEAST, *(error for error, _ in errors)))
            every = "both" if len(errors) == 2 else f"all {len(errors)}"
            return [f"time step: at most {off} off in {every} cases"]
        number = f"{coarse} of {counted(len(errors), 'case')}"
        return [
            f"time step: more than {percent(OFF)} off in {number}; worst: {worst.id},"
            f" {step_words(worst.time_step)}"
        ]
    return [
        f"time step{f' in {listed(names, 9)}' if len(errors) > 1 else ''}: {text}"
        for text, names in steps.items()
    ]


def creep_lines(results: Results) -> list[str]:
    """Return the fastest creep of contacts that stick, of one file that agrees in some engine."""
    rows = [(row.value, row, m) for m in results.models for row in m.acting if row.value]
    creeps = [one for one in rows if one[1].quantity == "creep" and not one[1].declared]
    if not creeps or len({(m.folder, m.model) for *_, m in creeps}) > 1:
        return []
    speed, row, model = max(creeps, key=lambda one: one[0])
    if speed < LEAST_CREEP:
        return []
    return [f"creep in {model.engine}: {1e3 * speed:.2g} mm/s ({row.subject}; {row.rule})"]


def stepping_lines(cases: Iterable[Case]) -> list[str]:
    """Return one line for all steps that follow their rule, then one per model that does not.

    A case that differs in the limit of small steps is omitted: its single step differs too.
    """
    steppings = [(case, case.stepping) for case in cases if case.stepping is not None]
    alike = [(case, stepping) for case, stepping in steppings if stepping.outcome is Outcome.AGREES]
    lines = [_alike(alike)] if alike else []
    seen = set()
    for case, stepping in steppings:
        model = case.id.of_model
        if stepping.outcome is Outcome.AGREES or case.outcome is Outcome.DIFFERS or model in seen:
            continue
        seen.add(model)
        lines.append(f"single step of {model} {_apart(stepping)}")
    return lines


def deciding_lines(cases: Iterable[Case]) -> list[str]:
    """Return a line for each deciding check with its largest E and U, and one on skipped checks."""
    by_check: dict[str, list[Case]] = {}
    for case in cases:
        if case.verdict is not None and case.outcome.is_run:
            by_check.setdefault(case.verdict.decided_by, []).append(case)
    lines = [_deciding(check, decided) for check, decided in by_check.items()]
    if any(case.skipped for decided in by_check.values() for case in decided):
        lines.append("skipped checks are not passed; --thorough runs all of them")
    return lines


def _deciding(check: str, cases: Sequence[Case]) -> str:
    verdicts = [case.verdict for case in cases if case.verdict is not None]
    sizes = (
        max(one.largest_discrepancy or 0.0 for one in verdicts),
        max(one.largest_uncertainty or 0.0 for one in verdicts),
    )
    return (
        f"{check} decide {counted(len(cases), 'case')}: largest difference {sizes[0]:.1e},"
        f" largest uncertainty {sizes[1]:.1e}"
    )


def _alike(cases: list[tuple[Case, Stepping]]) -> str:
    worst, stepping = max(cases, key=lambda entry: entry[1].discrepancy or 0.0)
    verb = "follows" if len(cases) == 1 else "follow"
    return (
        f"single step of {counted(len(cases), 'case')} {verb} the engine's own rule to"
        f" {stepping.discrepancy or 0.0:.1e} of how far it moves (worst: {worst.id})"
    )


def _apart(stepping: Stepping) -> str:
    if stepping.outcome is Outcome.UNRESOLVED:
        return (
            f"is too uncertain to compare with {stepping.rule} ({stepping.uncertainty or 0.0:.1e})"
        )
    why = f"; also acting: {stepping.besides}" if stepping.besides else (
        "; the integrator differs, or something acts at this step only"
    )  # fmt: skip
    off = "without bound" if stepping.discrepancy is None else f"by {stepping.discrepancy:.1e}"
    return (
        f"deviates from {stepping.rule} at {stepping.step:g} s: {stepping.component} {off}"
        f" of how far it moves (uncertainty {stepping.uncertainty or 0.0:.1e}){why}"
    )
