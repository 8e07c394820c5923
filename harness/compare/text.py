"""A comparison for the terminal, and as a record for machines."""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from harness.compare.candidate import Candidate, Facts
from harness.compare.compare import CompareOptions, Comparison
from harness.compare.diff import Edit
from harness.compare.trials import Trial
from harness.engines.registry import engines
from harness.records.outcome import Outcome
from harness.schedule.workers import Failure
from harness.text.table import STYLES

SCHEMA = 1
MOST_TOLD = 20


def print_comparison(console: Console, found: Comparison) -> None:
    """Print both models, the outcome, the terms that differ, and the lines that do."""

    def say(text: str, style: str = "") -> None:
        console.print(f"[{style}]{escape(text)}[/]" if style else escape(text), soft_wrap=True)

    sides = (found.wish.a, found.wish.b)
    for side, told in zip(sides, found.facts, strict=True):
        pull = ", ".join(f"{g:g}" for g in told.gravity)
        said = f", gravity ({pull})" if pull else ""
        say(f"{side.label}  {side.sidecar.model} in {side.engine}{said}")
    for note in (*found.notes, *found.match.told):
        say(f"   {note}", "dim")
    if found.match.left_out:
        names = ", ".join(found.match.left_out)
        say(f"   left out of {found.match.source}: {names}, which follow or stay put", "dim")
    recorded, judged = found.recorded, found.judgement
    say(
        f"   {len(recorded.runs.z)} runs of {recorded.runs.length:.3g} s from states of"
        f" {found.match.source}, {int(recorded.driven.sum())} of them under known forces"
    )
    console.print()
    style = STYLES[judged.outcome]
    console.print(
        f"[{style}]{judged.outcome}[/]  discrepancy {judged.discrepancy:.1e}, uncertainty"
        f" {judged.uncertainty:.1e}, on {escape(judged.component)}"
    )
    if judged.reason:
        say(f"  {judged.reason}")
    if judged.outcome is not Outcome.AGREES and len(found.match.names) > 1:
        say(f"  by joint: {_by_joint(found)}")
    for joint in found.turned:
        say(
            f"  {joint} turns the other way in B; map it so with --joints, or turn its axis"
            f" (that leaves {found.left:.1e})"
        )
    _print_terms(console, found)
    _print_trials(console, found)


def _by_joint(found: Comparison) -> str:
    n = len(found.match.names)
    worst = np.maximum(found.judgement.by_component[:n], found.judgement.by_component[n:])
    order = np.argsort(-worst)
    names = [f"{found.match.names[i]} {worst[i]:.1e}" for i in order[:MOST_TOLD]]
    return ", ".join(names)


def _print_terms(console: Console, found: Comparison) -> None:
    if found.terms:
        console.print("\nterms of the equations that differ, the weightiest first")
        for term in found.terms[:MOST_TOLD]:
            console.print(f"  {escape(term.message)}", soft_wrap=True)
        if len(found.terms) > MOST_TOLD:
            console.print(f"  and {len(found.terms) - MOST_TOLD} more")
    elif found.judgement.outcome is Outcome.DIFFERS and not found.turned:
        console.print("\nno single term differs by more than it can be measured to")


def _print_trials(console: Console, found: Comparison) -> None:
    if not found.trials:
        return
    agrees = found.judgement.outcome is Outcome.AGREES
    console.print("\nwhere the files differ, A -> B")
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    for _ in range(3):
        table.add_column(overflow="fold")
    shown = [one for one in found.trials if not agrees or len(one.edits) == 1]
    for trial in shown[:MOST_TOLD]:
        if len(trial.edits) == 1:
            (edit,) = trial.edits
            table.add_row(
                *(
                    escape(cell)
                    for cell in (
                        _place(edit),
                        f"{edit.label}: {edit.old} -> {edit.new}",
                        _effect(trial, agrees),
                    )
                )
            )
        else:
            table.add_row("", f"all {len(trial.edits)} together", _effect(trial, agrees))
    console.print(table)
    if len(shown) > MOST_TOLD:
        console.print(f"and {len(shown) - MOST_TOLD} more, see --json")
    if found.untried:
        console.print(f"{found.untried} more differences of the files were not tried alone")


def _place(edit: Edit) -> str:
    """The line in A; that in B where it has another number."""
    a, b = (Path(where).name for where in (edit.where_a, edit.where_b))
    return a if a == b or a.rpartition(":")[2] == b.rpartition(":")[2] else f"{a}, {b}"


def _effect(trial: Trial, agrees: bool) -> str:
    if trial.told:
        return f"not tried: {trial.told}"
    if trial.moved == 0.0:
        return "no motion depends on it"
    if agrees:
        return f"moves the motions by {trial.moved:.1e}, which others undo"
    if trial.explained == 1.0:
        return "explains all of it"
    return f"explains {_share(trial.explained)} of it, moves by {trial.moved:.1e}"


def _share(explained: float) -> str:
    if explained <= 0.0005:
        return "nothing"
    return f"{100 * min(explained, 0.99999):.3g} %"


def record(found: Comparison, created: datetime.datetime) -> dict[str, Any]:
    """The whole comparison as plain JSON; what is not finite becomes null."""
    judged, recorded = found.judgement, found.recorded
    plain: dict[str, Any] = _plain(
        {
            **_head(found.wish, found.facts, created),
            "outcome": str(judged.outcome),
            "reason": judged.reason,
            "discrepancy": judged.discrepancy,
            "uncertainty": judged.uncertainty,
            "component": judged.component,
            "joints": list(found.match.names),
            "by_component": judged.by_component.tolist(),
            "map": list(found.match.told),
            "left_out": list(found.match.left_out),
            "states_of": found.match.source,
            "runs": {
                "count": len(recorded.runs.z),
                "length": recorded.runs.length,
                "driven": int(recorded.driven.sum()),
                "lost": recorded.lost,
            },
            "turned": list(found.turned),
            "left_when_turned": found.left if found.turned else None,
            "terms": [
                {
                    "kind": t.kind,
                    "joints": list(t.about),
                    "message": t.message,
                    "a": t.a,
                    "b": t.b,
                    "uncertainty": t.uncertainty,
                    "effect": t.effect,
                }
                for t in found.terms
            ],
            "differences": [_trial_record(trial) for trial in found.trials],
            "untried": found.untried,
            "notes": list(found.notes),
            "seconds": found.seconds,
        }
    )
    return plain


def failed_record(
    wish: CompareOptions, failure: Failure, created: datetime.datetime
) -> dict[str, Any]:
    """The record of a comparison that could not be run."""
    return {
        **_head(wish, None, created),
        "outcome": str(Outcome.FAILED),
        "reason": failure.reason,
        "printed": failure.stdout,
    }


def _head(
    wish: CompareOptions, told: tuple[Facts, Facts] | None, created: datetime.datetime
) -> dict[str, Any]:
    sides: list[tuple[Candidate, Facts | None]] = [
        (wish.a, told[0] if told else None),
        (wish.b, told[1] if told else None),
    ]
    known = engines()
    return {
        "schema": SCHEMA,
        "created": created.isoformat(timespec="seconds"),
        "resolution": wish.resolution,
        "models": [
            {
                "model": str(side.sidecar.model),
                "engine": side.engine,
                "version": known[side.engine].version(),
                "notes": list(side.notes),
                **(
                    {}
                    if one is None
                    else {
                        "coordinates": list(one.coordinates),
                        "integrator": one.integrator,
                        "step": one.step,
                        "gravity": list(one.gravity),
                    }
                ),
            }
            for side, one in sides
        ],
    }


def _trial_record(trial: Trial) -> dict[str, Any]:
    return {
        "edits": [
            {"what": e.label, "a": e.old, "b": e.new, "where_a": e.where_a, "where_b": e.where_b}
            for e in trial.edits
        ],
        "moved": trial.moved,
        "explained": trial.explained,
        "not_tried": trial.told,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
