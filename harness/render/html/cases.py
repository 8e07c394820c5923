"""The view of one case in the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import (
    Case,
    ForwardDynamics,
    FullRun,
    Stepping,
    Verdict,
    WholeStep,
)
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.system import ReferenceMotion
from physics_crosscheck.harness.render.html.scenes import SceneView
from physics_crosscheck.harness.render.html.text import (
    NOTHING,
    agreeing_digits,
    percent,
    quantity,
    sci,
    shown,
)
from physics_crosscheck.harness.render.terminal.models_table import CHAOTIC, is_chaotic
from physics_crosscheck.harness.results.status import unsettled_steps

SYMBOLS = {
    Outcome.AGREES: "✓",
    Outcome.ABSENT: "○",
    Outcome.REFUSED: "⊘",
    Outcome.UNRESOLVED: "?",
    Outcome.DIFFERS: "≠",
    Outcome.FAILED: "✕",
}

Fact = tuple[str, str]


@dataclass(frozen=True, kw_only=True)
class CaseView:
    """The view of one case.

    Attributes:
        id: its permalink.
        outcome, symbol: its outcome.
        model, engine, scenario: its name.
        judged: whether it finished with a discrepancy.
        chaotic: whether it agrees but no time step can follow its whole motion. Small initial
            differences grow large, which is not a fault.
        digits: number of digits that agree in every component.
        discrepancy, uncertainty: values of the component that decides.
        global_error: global error as in the matrix.
        reason: reason for an outcome other than AGREES.
        stdout: output of a failed case.
        accepted: reason for accepting its difference, if accepted.
        facts: titled lists of all other facts, (title, ((label, value), ...)).
        cost: cost of its time step, in one sentence.
        steps: (error, time step for it).
        pack: id of its numbers and plots; empty without series.
        scene: its bodies; None for declared energies.
        sorts: sort keys of digits, E, U, global error and step.
    """

    id: str
    outcome: Outcome
    symbol: str
    system: str
    model: str
    engine: str
    scenario: str
    judged: bool
    chaotic: bool
    digits: str
    discrepancy: str
    uncertainty: str
    global_error: str
    reason: str
    stdout: str
    accepted: str
    facts: tuple[tuple[str, tuple[Fact, ...]], ...]
    cost: str
    steps: tuple[Fact, ...]
    step: str
    pack: str
    scene: SceneView | None
    sorts: tuple[str, ...]

    @property
    def packs(self) -> tuple[str, ...]:
        """Ids of its packs."""
        states = "" if self.scene is None else self.scene.states
        return tuple(filter(None, (self.pack, states)))


def severity(case: Case) -> tuple[int, float]:
    """Return a sort key that puts the worst cases first; what is accepted counts as agreeing."""
    discrepancy = case.verdict.discrepancy if case.verdict else None
    outcome = Outcome.AGREES if case.accepted else case.outcome
    return -outcome.severity, -(discrepancy or 0.0)


def case_view(
    case: Case,
    identity: str,
    pack: str,
    scene: SceneView | None,
    scenario: ReferenceMotion | None,
    model: Model | None,
) -> CaseView:
    """Return the view of one case.

    Args:
        case: its record.
        identity: its permalink.
        pack: id of its numbers and plots; empty without series.
        scene: its bodies; None for declared energies.
        scenario: the system's record of its scenario; None if the system could not be read.
        model: the record of its model in its engine; None if it did not run.
    """
    verdict, full_run = case.verdict, case.full_run
    judged = is_judged(case)
    chaotic = is_chaotic(case)
    facts = (
        ("Verdict", () if verdict is None else _verdict(verdict, digits_of(case))),
        ("At dt", () if full_run is None else _at_shipped_step(full_run)),
        (
            "Accelerations",
            () if case.forward_dynamics is None else _dynamics_facts(case.forward_dynamics),
        ),
        ("One step", () if case.stepping is None else _one_step(case.stepping)),
        ("Whole steps", () if case.whole_step is None else _whole_step(case.whole_step)),
        ("Events", () if full_run is None else tuple(_event_facts(full_run))),
        ("Acts as", () if model is None else tuple(_acting_facts(model))),
        ("Other steps", () if full_run is None else tuple(_steps(full_run))),
        ("Run", tuple(_run(case, scenario))),
    )
    return CaseView(
        id=identity,
        outcome=case.outcome,
        symbol=SYMBOLS[case.outcome],
        system=shown(case.system),
        model=shown(case.model),
        engine=shown(case.engine),
        scenario=shown(case.scenario),
        judged=judged,
        chaotic=chaotic,
        digits=digits_of(case),
        discrepancy=sci(None if verdict is None else verdict.discrepancy),
        uncertainty=sci(None if verdict is None else verdict.uncertainty),
        global_error=CHAOTIC if chaotic else _global_error(full_run),
        reason=shown(_reason(case)),
        stdout=shown(case.stdout),
        accepted=shown(case.accepted),
        facts=tuple((title, rows) for title, rows in facts if rows),
        cost=_cost(full_run, case.outcome, chaotic) if full_run and judged else "",
        steps=() if full_run is None else _steps_for(full_run),
        step=quantity(None if full_run is None else full_run.time_step, "s", 3),
        pack=pack,
        scene=scene,
        sorts=_sorts(verdict, full_run, judged),
    )


def is_judged(case: Case) -> bool:
    """Return whether a case finished with a discrepancy."""
    is_known = case.verdict is not None and case.verdict.discrepancy is not None
    return is_known and case.outcome is not Outcome.FAILED


def _global_error(full_run: FullRun | None) -> str:
    return percent(None if full_run is None else full_run.global_error)


def digits_of(case: Case) -> str:
    """Return how many digits agree in every component; none for a case that was not judged."""
    if case.verdict is None or not is_judged(case):
        return NOTHING
    return agreeing_digits(case.verdict.largest_discrepancy, case.verdict.largest_uncertainty)


def _sorts(verdict: Verdict | None, full_run: FullRun | None, judged: bool) -> tuple[str, ...]:
    """Return sort keys; missing values sort as worst."""
    columns: list[float | None] = [None] * 5
    if verdict is not None:
        worst = max(verdict.largest_discrepancy or 0.0, verdict.largest_uncertainty or 0.0)
        is_known = judged and verdict.largest_uncertainty is not None
        columns[:3] = worst if is_known else None, verdict.discrepancy, verdict.uncertainty
    if full_run is not None:
        columns[3:] = full_run.global_error, full_run.time_step
    return tuple("" if value is None else f"{value:.6g}" for value in columns)


def _cost(full_run: FullRun, outcome: Outcome, chaotic: bool) -> str:
    """Return the cost of the time step, and its main part."""
    if full_run.global_error is None:
        return ""
    step, error = quantity(full_run.time_step, "s", 3), percent(full_run.global_error)
    if chaotic:
        until = quantity(full_run.resolved_until, "s", 3)
        followed = f", here until {until}" if full_run.resolved_until else ""
        return (
            "The motion is chaotic: small differences grow, so any time step "
            f"follows it only for a while{followed}. Later the error is {error} of "
            f"the amplitude (dt = {step}). This is not a fault of the model: the "
            "verdict uses short segments."
        )
    if outcome is Outcome.DIFFERS:
        sentence = (
            f"At dt = {step}, the error of the whole motion is at most {error} of "
            "the amplitude, from the time step and the difference"
        )
    else:
        sentence = f"At dt = {step}, the error is {error} of the amplitude over the whole motion"
    parts = full_run.decomposition
    if parts is None:
        return f"{sentence}."
    return (
        f"{sentence}: by the end the amplitude is {_signed(parts.amplitude)} off and the phase"
        f" {quantity(_size(parts.phase), 'rad', 2)} {_phase_text(parts.phase)}."
    )


def _signed(value: float | None) -> str:
    return percent(value) if value is None or value < 0 else f"+{percent(value)}"


def _size(value: float | None) -> float | None:
    return None if value is None else abs(value)


def _phase_text(phase: float | None) -> str:
    return "" if phase is None else "late" if phase > 0 else "early"


def _steps_for(full_run: FullRun) -> tuple[Fact, ...]:
    return tuple(
        (f"{100 * entry.target:g}\u00a0%", quantity(entry.step, "s", 3))
        for entry in full_run.steps_for
        if entry.step is not None
    )


def _verdict(verdict: Verdict, digits: str) -> tuple[Fact, ...]:
    if verdict.discrepancy is None and verdict.uncertainty is None:
        return ()
    order, by_steps = quantity(verdict.order, "", 4), verdict.decided_by == "single steps"
    return (
        ("decided by", verdict.decided_by),
        ("agreeing digits", digits),
        ("worst component", shown(verdict.component)),
        ("discrepancy E", sci(verdict.discrepancy)),
        ("uncertainty U", sci(verdict.uncertainty)),
        ("largest E", sci(verdict.largest_discrepancy)),
        ("largest U", sci(verdict.largest_uncertainty)),
        ("step at" if by_steps else "segment at", quantity(verdict.time, "s")),
        ("order", f"{order} measured, {verdict.claimed_order} claimed"),
    )


def _dynamics_facts(dynamics: ForwardDynamics) -> tuple[Fact, ...]:
    """Return facts about the accelerations that the engine computes without a step."""
    return (
        ("its own, by the equations", f"{dynamics.outcome} ({dynamics.component})"),
        ("states", str(dynamics.states)),
        ("discrepancy", sci(dynamics.discrepancy)),
        ("uncertainty", sci(dynamics.uncertainty)),
        *((f"{term.name} off", sci(term.discrepancy)) for term in dynamics.terms),
    )


def _one_step(stepping: Stepping) -> tuple[Fact, ...]:
    """Return facts about a single step of the engine."""
    rows = [
        ("engine's rule", stepping.rule),
        ("its next state, by the equations", f"{stepping.outcome} ({stepping.component})"),
        ("discrepancy", sci(stepping.discrepancy)),
        ("uncertainty", sci(stepping.uncertainty)),
        ("last digits of the largest, after 1, 10 and 1000 steps", _digits(stepping)),
    ]
    if stepping.besides:
        rows.append(("also acts", stepping.besides))
    return tuple(rows)


def _reason(case: Case) -> str:
    """Return the reason of its outcome, and whole steps that are unresolved."""
    steps = case.whole_step is not None and case.whole_step.outcome is Outcome.UNRESOLVED
    besides = f"whole steps are {unsettled_steps(case)}" if steps else ""
    return "; ".join(filter(None, (case.reason, besides)))


def _whole_step(steps: WholeStep) -> tuple[Fact, ...]:
    """Return facts about steps with limits, friction, contacts and drives."""
    stated = (f"{steps.stated} attributes",) if steps.stated else ()
    besides = tuple(
        (label, "; ".join(sentences))
        for label, sentences in (
            ("without a law here", steps.uncovered),
            ("read from the text", stated),
            ("compiled otherwise", steps.misread),
            ("not read from the text", steps.unread),
            ("contacts otherwise", steps.contact_faults),
            ("never acted", steps.inactive),
            ("not compared", steps.omitted),
            ("numbers of contacts", steps.contact_counts),
        )
        if sentences
    )
    if steps.outcome is None:
        return besides
    acted = ", ".join(f"{one.name} {one.count}" for one in steps.acted)
    return (
        ("by the engine's law", f"{steps.outcome} ({steps.component})"),
        ("discrepancy", sci(steps.discrepancy)),
        ("uncertainty", sci(steps.uncertainty)),
        ("states", str(steps.states)),
        *((("unresolved states", str(steps.unresolved)),) if steps.unresolved else ()),
        ("acted", acted or NOTHING),
        ("compared", "accelerations, next state" if steps.next_state else "accelerations"),
        ("changed options", ", ".join(steps.edits)),
        *besides,
    )


def _digits(stepping: Stepping) -> str:
    digits = (stepping.digits, stepping.digits_later, stepping.digits_long)
    first, ten, thousand = (NOTHING if one is None else f"{one:.2g}" for one in digits)
    return f"{first}, {ten} and {thousand}"


def _at_shipped_step(full_run: FullRun) -> tuple[Fact, ...]:
    if full_run.time_step is None and full_run.global_error is None:
        return ()
    rows = [
        ("step", quantity(full_run.time_step, "s")),
        ("error at dt", percent(full_run.global_error)),
    ]
    if full_run.velocity_error is not None:
        rows.append(("velocity error at dt", percent(full_run.velocity_error)))
    parts = full_run.decomposition
    if parts is not None:
        rows += [
            ("amplitude, at the end", percent(parts.amplitude)),
            ("phase, at the end", quantity(parts.phase, "rad", 3)),
            ("frequency", percent(parts.frequency)),
            ("damping ratio", quantity(parts.damping, "", 3)),
            ("explained share of the error", percent(parts.explained)),
        ]
    if full_run.energy_error is not None:
        rows.append(("energy balance", percent(full_run.energy_error)))
    if full_run.constraint_drift is not None:
        rows.append(("constraint drift", f"{full_run.constraint_drift:.2g} (engine units)"))
    return tuple(rows)


def _event_facts(full_run: FullRun) -> Iterator[Fact]:
    """Yield the events of the reference, and how much later they are in the run at dt."""
    for event in full_run.events:
        delay = "not seen at dt"
        if event.in_run is not None:
            delay = f"{quantity(event.in_run - event.time, 's', 2)} later at dt"
        yield f"{shown(event.part)}, {event.change}", f"{quantity(event.time, 's', 6)}, {delay}"


def _acting_facts(model: Model) -> Iterator[Fact]:
    """Yield what the numbers of a model act as, if its system declares what they are to act as."""
    for row in model.acting if model.declares else ():
        rule = f" ({shown(row.rule)})" if row.rule else ""
        yield f"{shown(row.subject)}: {row.quantity}", f"{quantity(row.value, row.unit)}{rule}"


def _steps(full_run: FullRun) -> Iterator[Fact]:
    if full_run.order is not None:
        yield "order of full runs", f"{full_run.order:.3f}"
    checked = full_run.checked_step
    if checked is not None:
        yield (
            "checked by a run",
            f"{percent(checked.measured)} at {quantity(checked.step, 's', 3)},"
            f" {100 * checked.target:g}\u00a0% predicted",
        )


def _run(case: Case, scenario: ReferenceMotion | None) -> Iterator[Fact]:
    if scenario is not None:
        yield "scenario", shown(scenario.description)
        for name, text in scenario.inputs.items():
            yield shown(name), shown(text)
    if case.full_run is not None and case.full_run.integrator:
        yield "integrator", shown(case.full_run.integrator)
    if case.verdict is not None:
        steps = f"{case.verdict.steps:,}".replace(",", "\u202f")
        yield "engine steps for the verdict", steps
        if case.verdict.rungs:
            yield "steps a segment", ", ".join(str(rung) for rung in case.verdict.rungs)
    for skipped in case.skipped:
        yield f"skipped: {skipped.check}", skipped.reason
    if case.seconds:
        yield "took", quantity(case.seconds, "s", 2)
