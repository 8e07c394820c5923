"""Results for the terminal: one row a model and engine, then every case that needs a look."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from harness.records.outcome import Outcome
from harness.text.causes import cause_sentences
from harness.text.findings import audit_lines

STYLES = {
    "AGREES": "green", "ABSENT": "yellow", "UNRESOLVED": "magenta", "DIFFERS": "bold red",
    "FAILED": "bold red reverse",
}  # fmt: skip

MOST_TOLD = 40


def print_results(console: Console, found: Mapping[str, Any]) -> None:
    """Print the table of models, then what does not agree, worst first, then the summary line."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("system", "model", "engine"):
        table.add_column(name, no_wrap=True)
    table.add_column("outcome", no_wrap=True)
    for name in ("discrepancy", "uncertainty", "raw error", "at step", "order", "0.1 % at"):
        table.add_column(name, justify="right", no_wrap=True)
    rows = [_row(cases) for cases in _groups(found["cases"])]
    for row in rows:
        table.add_row(*row)
    console.print(table)
    if any(row[-1].endswith("*") for row in rows):
        console.print("* one of the motions is too sensitive for a step to be told", style="dim")
    differ = {_model_key(case) for case in found["cases"] if case["outcome"] == "DIFFERS"}
    _print_linear(console, [m for m in found["models"] if _model_key(m) not in differ])
    amiss = [case for case in found["cases"] if case["outcome"] != "AGREES"]
    troubled = [case for case in amiss if not case.get("accepted")]
    troubled.sort(key=lambda c: (-Outcome(c["outcome"]).severity, -(c["discrepancy"] or 0)))
    for case in troubled[:MOST_TOLD]:
        console.print()
        outcome = case["outcome"]
        console.print(f"[{STYLES[outcome]}]{outcome}[/] {escape(case_id(case))}")
        console.print(f"  {escape(case['reason'])}", soft_wrap=True)
        for line in (case.get("printed") or "").splitlines()[-6:]:
            console.print(f"  | {escape(line)}", soft_wrap=True)
    for model in found["models"]:
        if model.get("diagnosis"):
            _print_diagnosis(console, model)
        if audit_findings(model):
            where = f"{model['system']}/{model['model']} [{model['engine']}]"
            console.print(f"\n[bold]audit[/] of {escape(where)}", soft_wrap=True)
            for text in audit_lines(model["audit"], notes=False):
                console.print(f"  {escape(text)}", soft_wrap=True)
    if len(troubled) > MOST_TOLD:
        console.print(f"\nand {len(troubled) - MOST_TOLD} more, in results.json")
    _print_accepted(console, [case for case in amiss if case.get("accepted")])
    _print_changes(console, found.get("baseline") or {"changes": []})
    console.print()
    console.print(summary(found))


def audit_findings(model: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The audit's findings of a model, its notes aside."""
    return [record for record in model.get("audit") or () if record["severity"] == "finding"]


def _print_diagnosis(console: Console, model: Mapping[str, Any]) -> None:
    where = f"{model['system']}/{model['model']} [{model['engine']}]"
    diagnosis = model["diagnosis"]
    console.print(f"\n[bold]cause[/] in {escape(where)}", soft_wrap=True)
    if not diagnosis.get("findings"):
        console.print(f"  none found: {escape(diagnosis.get('reason', ''))}", soft_wrap=True)
        return
    if not diagnosis["explained"]:
        console.print("  unexplained; what leaves least is")
    for sentence in cause_sentences(diagnosis["findings"][0]):
        console.print(f"  {escape(sentence)}", soft_wrap=True)


def _print_accepted(console: Console, cases: Sequence[Mapping[str, Any]]) -> None:
    """The known differences, each with the reason it was accepted with."""
    if cases:
        console.print("\n[bold]accepted[/] as they are")
    for case in cases:
        said = f"  {case_id(case)}: {case['outcome']}, {case['accepted']}"
        console.print(escape(said), soft_wrap=True)


def _print_changes(console: Console, baseline: Mapping[str, Any]) -> None:
    """What is not as it was accepted."""
    changes = baseline["changes"]
    if changes:
        console.print(f"\n[bold]since[/] {escape(baseline['name'])}")
    for change in changes[:MOST_TOLD]:
        said = f"  {change['kind']:<12}{case_id(change)}: {change['message']}"
        console.print(escape(said), soft_wrap=True)
    if len(changes) > MOST_TOLD:
        console.print(f"  and {len(changes) - MOST_TOLD} more, in results.json")


def summary(found: Mapping[str, Any]) -> str:
    """One line: how many of each outcome, and how long it took."""
    counts = Counter(case["outcome"] for case in found["cases"])
    parts = [f"{counts[o]} {o}" for o in Outcome if counts[o]]
    agreeing = [case for case in found["cases"] if case["outcome"] == "AGREES"]
    worst = max((max(c["discrepancy"], c["uncertainty"]) for c in agreeing), default=None)
    tail = f"; all that agree do so to {worst:.1e}" if worst is not None else ""
    known = sum(bool(case.get("accepted")) for case in found["cases"])
    tail = (f"; {known} accepted as known differences" if known else "") + tail
    return f"{len(found['cases'])} cases: {', '.join(parts)}{tail}; {found['seconds']:.1f} s"


def case_id(case: Mapping[str, Any]) -> str:
    """Readable name of a case, the same everywhere."""
    return f"{case['system']}/{case['model']}/{case['scenario']} [{case['engine']}]"


def line(done: int, total: int, case: Mapping[str, Any]) -> str:
    """One plain line for a finished case, for logs."""
    value = case["discrepancy"]
    number = ""
    if value is not None:
        number = f"  E {value:.1e}  U {case['uncertainty'] or float('inf'):.1e}"
    return f"[{done}/{total}] {case['outcome']:<10} {case_id(case)}{number}"


def _groups(cases: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    return [list(group) for _, group in itertools.groupby(cases, _model_key)]


def _model_key(record: Mapping[str, Any]) -> tuple[str, str, str]:
    return record["system"], record["model"], record["engine"]


def _row(cases: list[Mapping[str, Any]]) -> list[str]:
    counts = Counter(case["outcome"] for case in cases)
    outcome = ", ".join(f"[{STYLES[o]}]{counts[o]} {o}[/]" for o in reversed(Outcome) if counts[o])
    first = cases[0]
    steps = [s["step"] for c in cases for s in c.get("steps_for", ()) if s["target"] == 0.001]
    tenth = [step for step in steps if step is not None]
    return [
        escape(first["system"]),
        escape(first["model"]),
        escape(first["engine"]),
        outcome,
        _most(cases, "discrepancy", "{:.1e}"),
        _most(cases, "uncertainty", "{:.1e}"),
        _most(cases, "raw_error", "{:.2%}"),
        _most(cases, "shipped_step", "{:g} s"),
        _range([c["raw_order"] for c in cases if c.get("raw_order") is not None]),
        f"{min(tenth):.2g} s" + "*" * (len(tenth) < len(steps)) if tenth else "-",
    ]


def _most(cases: list[Mapping[str, Any]], key: str, form: str) -> str:
    values = [case[key] for case in cases if case.get(key) is not None]
    return form.format(max(values)) if values else "-"


def _range(values: list[float]) -> str:
    if not values:
        return "-"
    low, high = (f"{round(value, 1) + 0.0:.1f}" for value in (min(values), max(values)))
    return low if low == high else f"{low}-{high}"


def _print_linear(console: Console, models: Sequence[Mapping[str, Any]]) -> None:
    errors = [
        (max(one["A_error"], one["B_error"]), model, one)
        for model in models
        for one in model.get("linearization") or ()
        if one["A_error"] is not None
    ]
    if not errors:
        return
    worst, model, one = max(errors, key=lambda entry: entry[0])
    where = f"{model['system']}/{model['model']} [{model['engine']}] about {one['equilibrium']}"
    console.print(
        f"\nThe engines' own linearizations where motions agree, {len(errors)}, equal Taylor's A"
        f" and B to {worst:.1e} of the largest entry (worst: {escape(where)}).",
        soft_wrap=True,
    )
