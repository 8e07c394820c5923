"""What the report shows of one case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from harness.records.outcome import Outcome
from harness.report.text import NOTHING, agreeing_digits, percent, quantity, sci, shown

SYMBOLS = {"AGREES": "✓", "ABSENT": "○", "UNRESOLVED": "?", "DIFFERS": "≠", "FAILED": "✕"}

Fact = tuple[str, str]


@dataclass(frozen=True)
class CaseView:
    """One case.

    Attributes:
        id: its permalink.
        outcome, symbol: what became of it.
        model, engine, scenario: its name.
        judged: whether it ran to an end with a discrepancy.
        digits, discrepancy, uncertainty, raw_error: as the matrix shows them.
        told: all of these in words.
        reason: for what is not AGREES.
        printed: what a failed case printed.
        accepted: why its difference is accepted, where it is.
        facts: titled lists of everything else, (title, ((what, value), ...)).
        cost: what its step costs, in one sentence.
        steps: (error, step that gives it).
        pack: id of its numbers and plots; empty without series.
        sorts: of digits, E, U, raw error and step, as numbers that sort.
    """

    id: str
    outcome: str
    symbol: str
    system: str
    model: str
    engine: str
    scenario: str
    judged: bool
    digits: str
    discrepancy: str
    uncertainty: str
    raw_error: str
    told: str
    reason: str
    printed: str
    accepted: str
    facts: tuple[tuple[str, tuple[Fact, ...]], ...]
    cost: str
    steps: tuple[Fact, ...]
    step: str
    pack: str
    sorts: tuple[str, ...]


def severity(case: Mapping[str, Any]) -> tuple[int, float]:
    """Sorts cases worst first."""
    return -Outcome(case["outcome"]).severity, -(case["discrepancy"] or 0.0)


def case_view(
    case: Mapping[str, Any], identity: str, pack: str, scenario: Mapping[str, Any] | None
) -> CaseView:
    """The view of one case.

    Args:
        case: its record.
        identity: its permalink.
        pack: id of its numbers and plots; empty without series.
        scenario: the system's record of its scenario; None where the system could not be read.
    """
    outcome = case["outcome"]
    judged = case["discrepancy"] is not None and outcome != Outcome.FAILED
    digits = agreeing_digits(case["discrepancy"], case["uncertainty"]) if judged else NOTHING
    told = outcome
    if judged:
        told = (
            f"{outcome}, {digits} digits, E {sci(case['discrepancy'])},"
            f" U {sci(case['uncertainty'])}, raw error {percent(case['raw_error'])}"
        )
    facts = (
        ("Verdict", _verdict(case, digits)),
        ("At the shipped step", _at_shipped_step(case)),
        ("Other steps", _steps(case)),
        ("Run", _run(case, scenario)),
    )
    return CaseView(
        id=identity,
        outcome=outcome,
        symbol=SYMBOLS[outcome],
        system=shown(case["system"]),
        model=shown(case["model"]),
        engine=shown(case["engine"]),
        scenario=shown(case["scenario"]),
        judged=judged,
        digits=digits,
        discrepancy=sci(case["discrepancy"]),
        uncertainty=sci(case["uncertainty"]),
        raw_error=percent(case["raw_error"]),
        told=told,
        reason=shown(case["reason"]),
        printed=shown(case.get("printed") or ""),
        accepted=shown(case.get("accepted") or ""),
        facts=tuple((title, rows) for title, rows in facts if rows),
        cost=_cost(case) if judged else "",
        steps=tuple(
            (f"{100 * entry['target']:g}\u00a0%", quantity(entry["step"], "s", 3))
            for entry in case.get("steps_for", ())
            if entry["step"] is not None
        ),
        step=quantity(case["shipped_step"], "s", 3),
        pack=pack,
        sorts=_sorts(case, judged),
    )


def _sorts(case: Mapping[str, Any], judged: bool) -> tuple[str, ...]:
    """Numbers that sort: what is missing is worse than any number."""
    worst = max(case["discrepancy"] or 0.0, case["uncertainty"] or 0.0)
    known = judged and case["uncertainty"] is not None
    columns = (
        worst if known else None,
        case["discrepancy"],
        case["uncertainty"],
        case["raw_error"],
        case["shipped_step"],
    )
    return tuple("" if value is None else f"{value:.6g}" for value in columns)


def _cost(case: Mapping[str, Any]) -> str:
    """What the step costs, and where the cost goes."""
    if case["raw_error"] is None:
        return ""
    step, error = quantity(case["shipped_step"], "s", 3), percent(case["raw_error"])
    if case["outcome"] == Outcome.DIFFERS:
        told = (
            f"At the step of {step} the whole motion is off by {error} of the amplitude at most,"
            " by the step and by what differs"
        )
    else:
        told = f"The step of {step} costs you {error} of the amplitude over the whole motion"
    apart = case.get("apart")
    if apart is None:
        return f"{told}."
    return (
        f"{told}: by the end the amplitude is {_signed(apart['amplitude'])} off and the phase"
        f" {quantity(_size(apart['phase']), 'rad', 2)} {_late(apart['phase'])}."
    )


def _signed(value: float | None) -> str:
    return percent(value) if value is None or value < 0 else f"+{percent(value)}"


def _size(value: float | None) -> float | None:
    return None if value is None else abs(value)


def _late(phase: float | None) -> str:
    return "" if phase is None else "late" if phase > 0 else "early"


def _verdict(case: Mapping[str, Any], digits: str) -> tuple[Fact, ...]:
    if case["discrepancy"] is None and case["uncertainty"] is None:
        return ()
    order = quantity(case["order"], "", 4)
    if "claimed_order" in case:
        order = f"{order} seen, {case['claimed_order']} claimed"
    return (
        ("agreeing digits", digits),
        ("discrepancy E", sci(case["discrepancy"])),
        ("uncertainty U", sci(case["uncertainty"])),
        ("component", shown(case["component"])),
        ("segment at", quantity(case.get("time"), "s")),
        ("order in h", order),
    )


def _at_shipped_step(case: Mapping[str, Any]) -> tuple[Fact, ...]:
    if case["shipped_step"] is None and case["raw_error"] is None:
        return ()
    rows = [
        ("step", quantity(case["shipped_step"], "s")),
        ("raw error", percent(case["raw_error"])),
    ]
    apart = case.get("apart")
    if apart is not None:
        rows += [
            ("amplitude, at the end", percent(apart["amplitude"])),
            ("phase, at the end", quantity(apart["phase"], "rad", 3)),
            ("frequency", percent(apart["frequency"])),
            ("damping ratio", quantity(apart["damping"], "", 3)),
            ("of the error, these explain", percent(apart["explained"])),
        ]
    if case.get("energy_error") is not None:
        rows.append(("energy balance", percent(case["energy_error"])))
    if case.get("constraint_drift") is not None:
        rows.append(("constraint drift", f"{case['constraint_drift']:.2g} (engine units)"))
    return tuple(rows)


def _steps(case: Mapping[str, Any]) -> tuple[Fact, ...]:
    rows = []
    if case.get("raw_order") is not None:
        rows.append(("order of whole runs", f"{case['raw_order']:.3f}"))
    checked = case.get("checked_step")
    if checked is not None:
        rows.append(
            (
                "checked by a run",
                f"{percent(checked['measured'])} at {quantity(checked['step'], 's', 3)},"
                f" {100 * checked['target']:g}\u00a0% foretold",
            )
        )
    return tuple(rows)


def _run(case: Mapping[str, Any], scenario: Mapping[str, Any] | None) -> tuple[Fact, ...]:
    rows = []
    if scenario is not None:
        rows.append(("scenario", shown(scenario["description"])))
        rows += [(shown(name), shown(text)) for name, text in scenario["inputs"].items()]
    if case.get("integrator"):
        rows.append(("integrator", shown(case["integrator"])))
    if case.get("steps") is not None:
        rows.append(("engine steps for the limits", f"{case['steps']:,}".replace(",", "\u202f")))
    if case.get("rungs"):
        rows.append(("steps a segment", ", ".join(str(rung) for rung in case["rungs"])))
    if case["seconds"]:
        rows.append(("took", quantity(case["seconds"], "s", 2)))
    return tuple(rows)
