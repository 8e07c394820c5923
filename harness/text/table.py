"""Results for the terminal: a table of models, what is to be known of them, what doesn't agree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from rich.console import Console

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.text.coverage import coverage_lines
from physics_crosscheck.harness.text.dynamics import dynamics_lines
from physics_crosscheck.harness.text.markup import escape
from physics_crosscheck.harness.text.models_table import known, print_models
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.stepping import stepping_lines
from physics_crosscheck.harness.text.troubles import MOST_TOLD, print_troubles

GROWS = 1e-9
"""By how much more than rounding the largest eigenvalue of a step is off the unit circle."""


def print_results(console: Console, results: Results, *, quiet: bool = False) -> None:
    """Print the table of models, what is to be known of them, and last what doesn't agree.

    Last stands what one looks for first: each cause once, then the summary line.

    Args:
        console: to print on; nothing is cut to its width.
        results: to be printed.
        quiet: whether what agrees is only counted.
    """
    if not quiet:
        print_models(console, [c for c in results.cases if c.outcome is not Outcome.ABSENT])
        differ = {case.id.of_model for case in results.cases if case.outcome is Outcome.DIFFERS}
        _print_linear(console, [model for model in results.models if model.id not in differ])
        _print_stepping(console, results.cases)
        _print_reservations(console, results.cases)
        _print_coverage(console, results.models)
        amiss = [case for case in results.cases if case.outcome is not Outcome.AGREES]
        _print_accepted(console, [case for case in amiss if case.accepted])
    if results.baseline is not None:
        _print_changes(console, results.baseline)
    print_troubles(console, results)
    console.print()
    console.print(escape(summary(results)), soft_wrap=True)


def summary(results: Results) -> str:
    """One line: how many of each outcome, and how long it took."""
    counts = Counter(case.outcome for case in results.cases)
    parts = [f"{counts[o]} {o}" for o in Outcome if counts[o]]
    agreeing = [case for case in results.cases if case.outcome is Outcome.AGREES]
    differing = sum(bool(case.accepted) for case in results.cases)
    accepted = f"; {differing} accepted as known differences" if differing else ""
    worst = max(known(largest(case) for case in agreeing), default=None)
    told = agreement(worst)
    return (
        f"{counted(len(results.cases), 'case')}: {', '.join(parts)}{accepted}"
        f"{_unfinished(results)}{told}; {results.seconds:.1f} s{_cached(results)}"
    )


def _cached(results: Results) -> str:
    """How many cases were not run, since they had been."""
    return f"; {results.cached} had from the cache" if results.cached else ""


def _unfinished(results: Results) -> str:
    """What a summary says of what was not done: a failed audit finds nothing, which is no pass."""
    failed = Counter(what for model in results.models for what, _ in model.failures)
    parts = [f"{number} FAILED as {what}" for what, number in failed.items()]
    if refused := len(results.refusals):
        parts.append(f"{counted(refused, 'refusal')} ignored without --strict")
    if results.untested:
        parts.append(results.untested)
    if results.stopped:
        parts.append(f"stopped by {results.stopped}, {len(results.not_run)} not run")
    return "".join(f"; {part}" for part in parts)


def largest(case: Case) -> Number:
    """The largest discrepancy or uncertainty of a case, over all components and segments."""
    if case.verdict is None:
        return None
    sizes = known((case.verdict.largest_discrepancy, case.verdict.largest_uncertainty))
    return max(sizes, default=None)


def agreement(worst: Number) -> str:
    """The end of a summary: to what cases agree that do; empty where none does."""
    return "" if worst is None else f"; all that agree do so to {worst:.1e}"


def case_line(done: int, total: int, case: Case) -> str:
    """One plain line for a finished case, for logs."""
    numbers = ""
    if case.verdict is not None:
        e, u = _or_infinite(case.verdict.discrepancy), _or_infinite(case.verdict.uncertainty)
        numbers = f"  E {e:.1e}  U {u:.1e}"
    return f"[{done}/{total}] {case.outcome:<10} {case.id}{numbers}"


def _or_infinite(value: Number) -> float:
    return float("inf") if value is None else value


def _print_linear(console: Console, models: Iterable[Model]) -> None:
    """How far linearizations equal Taylor's; those that don't are findings of their models."""
    alike = [(model, one) for model in models for one in model.linearizations if not one.differs]
    lost = [str(model.id) for model, one in alike if one.a_bound is None]
    errors: list[tuple[float, Model, EngineLinearization]] = [
        (max(one.a_error, one.b_error or 0.0), model, one)
        for model, one in alike
        if one.a_error is not None and one.a_bound is not None
    ]
    if errors:
        worst, model, one = max(errors, key=lambda entry: entry[0])
        where = f"{model.id} about {one.equilibrium}"
        console.print(
            f"\nThe engines' own linearizations where motions agree, {len(errors)}, equal Taylor's"
            f" A and B to {worst:.1e} of the largest entry (worst: {escape(where)}).",
            soft_wrap=True,
        )
    _print_steps(console, alike)
    if lost:
        told = ", ".join(dict.fromkeys(lost))
        console.print(f"\nLinearizations without a limit: {escape(told)}.", soft_wrap=True)


def _print_steps(console: Console, alike: list[tuple[Model, EngineLinearization]]) -> None:
    """Of one step at the shipped size: how near to its rule, and where it grows for itself."""
    steps = [(model, one, one.one_step) for model, one in alike if one.one_step is not None]
    ruled = [
        (step.error, model)
        for model, _, step in steps
        if step.error is not None and not step.differs  # what acts in a step is told of its cases
    ]
    if ruled:
        error, model = max(ruled, key=lambda entry: entry[0])
        console.print(
            f"\nOne step, linearized about {len(ruled)} of those equilibria, equals the engine's"
            f" own rule on the equations to {error:.1e} of the largest entry that it changes"
            f" (worst: {escape(str(model.id))}).",
            soft_wrap=True,
        )
    for model, one, step in steps:
        grown, exact = step.radius or 0.0, step.exact_radius or 0.0
        if grown > 1 + GROWS and exact < 1 - GROWS:
            console.print(
                f"\nAbout {escape(one.equilibrium)}, {escape(str(model.id))} grows by"
                f" {grown - 1:.1e} in each step of {step.step:g} s, where the equations die out.",
                soft_wrap=True,
            )


def _print_stepping(console: Console, cases: Iterable[Case]) -> None:
    """Accelerations, and next states: how near they are to the equations', and which are not."""
    cases = list(cases)
    lines = [*dynamics_lines(cases), *stepping_lines(cases)]
    if lines:
        console.print()
    for line in lines:
        console.print(escape(line), soft_wrap=True)


def _print_reservations(console: Console, cases: Iterable[Case]) -> None:
    """What is said of cases that agree all the same."""
    told = [case for case in cases if case.outcome is Outcome.AGREES and case.reason]
    if told:
        console.print("\n[bold]AGREES[/], with a reservation")
    for case in told[:MOST_TOLD]:
        console.print(f"  {escape(str(case.id))}: {escape(case.reason)}", soft_wrap=True)
    if len(told) > MOST_TOLD:
        console.print(f"  and {len(told) - MOST_TOLD} more, in results.json")


def _print_coverage(console: Console, models: Iterable[Model]) -> None:
    """What the verdicts cover, a line a model."""
    lines = coverage_lines(models)
    if lines:
        console.print("\n[bold]covered[/]")
    for line in lines:
        console.print(f"  {escape(line)}", soft_wrap=True)


def _print_accepted(console: Console, cases: Sequence[Case]) -> None:
    """The known differences, each with the reason it was accepted with."""
    if cases:
        console.print("\n[bold]accepted[/] as they are")
    for case in cases:
        said = f"  {case.id}: {case.outcome}, {case.accepted}"
        console.print(escape(said), soft_wrap=True)


def _print_changes(console: Console, baseline: BaselineChanges) -> None:
    """What is not as it was accepted."""
    if baseline.changes:
        console.print(f"\n[bold]since[/] {escape(baseline.name)}")
    for change in baseline.changes[:MOST_TOLD]:
        said = f"  {change.kind:<12}{change.id}: {change.message}"
        console.print(escape(said), soft_wrap=True)
    if len(baseline.changes) > MOST_TOLD:
        console.print(f"  and {len(baseline.changes) - MOST_TOLD} more, in results.json")
