"""The view of one case in the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import (
    Case,
    ForwardDynamics,
    FullRun,
    Stepping,
    TimeStep,
    Verdict,
    WholeStep,
)
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.system import ReferenceMotion
from physics_crosscheck.harness.results.status import step_words, unsettled_steps
from ..terminal.models_table import CHAOTIC, is_chaotic
from .scenes import SceneView
from .text import NOTHING, percent, quantity, sci

SYMBOLS: Mapping[str, str] = {
    "AUDIT": "!",
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
    """A case on the page, with the records that it shows.

    Attributes:
        id: its permalink.
        case: its record.
        pack: id of its numbers and plots; empty without series.
        scene: its bodies; None for declared energies.
        scenario: the system's record of its scenario; None if the system could not be read.
        model: the record of its model in its engine; None if it did not run.
    """

    id: str
    case: Case
    pack: str
    scene: SceneView | None
    scenario: ReferenceMotion | None
    model: Model | None

    @property
    def name(self) -> str:
        """Name of the case without its engine."""
        return f"{self.case.system}/{self.case.model}/{self.case.scenario}"

    @property
    def packs(self) -> tuple[str, ...]:
        """Ids of its packs."""
        states = "" if self.scene is None else self.scene.states
        return tuple(filter(None, (self.pack, states)))

    @property
    def judged(self) -> bool:
        """True if it finished with a discrepancy."""
        verdict, outcome = self.case.verdict, self.case.outcome
        return bool(verdict and verdict.discrepancy is not None and outcome is not Outcome.FAILED)

    @property
    def chaotic(self) -> bool:
        """True if it agrees but no time step can follow its whole motion.

        Small initial differences grow large, which is not a fault.
        """
        return is_chaotic(self.case)

    @property
    def digits(self) -> str:
        """Number of digits that agree in every component; none for a case that was not judged."""
        return digits_of(self.case) if self.judged else NOTHING

    @property
    def sizes(self) -> tuple[Number, Number]:
        """Discrepancy and uncertainty of the component that decides."""
        verdict = self.case.verdict
        return (None, None) if verdict is None else (verdict.discrepancy, verdict.uncertainty)

    @property
    def global_error(self) -> str:
        """Error of the whole motion at the model's time step."""
        return CHAOTIC if self.chaotic else percent(self._at_step[0])

    @property
    def _at_step(self) -> tuple[Number, Number]:
        """Error at the model's time step, and that step: of the full run, or of the time step."""
        run, step = self.case.full_run, self.case.time_step
        if run is not None:
            return run.global_error, run.time_step
        is_known = step is not None and step.order and step.finding is None
        return (step.error, step.step) if step is not None and is_known else (None, None)

    @property
    def step(self) -> str:
        """Time step of the model."""
        return quantity(self._at_step[1], "s", 3)

    @property
    def reason(self) -> str:
        """Reason of its outcome, and whole steps that are unresolved."""
        steps = self.case.whole_step
        unresolved = steps is not None and steps.outcome is Outcome.UNRESOLVED
        besides = f"whole steps are {unsettled_steps(self.case)}" if unresolved else ""
        return "; ".join(filter(None, (self.case.reason, besides)))

    @property
    def facts(self) -> tuple[tuple[str, tuple[Fact, ...]], ...]:
        """Titled lists of all other facts, (title, ((label, value), ...))."""
        case, full_run = self.case, self.case.full_run
        facts = (
            ("Verdict", _verdict(case.verdict, self.digits) if case.verdict else ()),
            ("At dt", _at_shipped_step(full_run) if full_run else _of_step(case.time_step)),
            (
                "Accelerations",
                _dynamics_facts(case.forward_dynamics) if case.forward_dynamics else (),
            ),
            ("One step", _one_step(case.stepping) if case.stepping else ()),
            ("Whole steps", _whole_step(case.whole_step) if case.whole_step else ()),
            ("Events", _event_facts(full_run) if full_run else ()),
            ("Acts as", _acting_facts(self.model) if self.model else ()),
            ("Other steps", _steps(full_run) if full_run else ()),
            ("Run", _run(case, self.scenario)),
        )
        listed = ((title, tuple(rows)) for title, rows in facts)
        return tuple((title, rows) for title, rows in listed if rows)

    @property
    def cost(self) -> str:
        """Cost of its time step, in one sentence."""
        run = self.case.full_run
        return _cost(run, self.case.outcome, self.chaotic) if run and self.judged else ""

    @property
    def steps(self) -> tuple[Fact, ...]:
        """Errors, each with the time step for it."""
        run = self.case.full_run
        return tuple(
            (f"{100 * entry.target:g}\u00a0%", quantity(entry.step, "s", 3))
            for entry in ((run and run.steps_for) or ())
            if entry.step is not None
        )

    @property
    def sorts(self) -> tuple[Number, ...]:
        """Sort keys of digits, E, U, global error and step; missing values sort as worst."""
        verdict, worst = self.case.verdict, None
        if verdict and self.judged and verdict.largest_uncertainty is not None:
            worst = max(verdict.largest_discrepancy or 0.0, verdict.largest_uncertainty)
        return worst, *self.sizes, *self._at_step


def severity(case: Case) -> tuple[int, float]:
    """Return a sort key that puts the worst cases first; what is accepted counts as agreeing."""
    discrepancy = case.verdict.discrepancy if case.verdict else None
    outcome = Outcome.AGREES if case.accepted else case.outcome
    return -outcome.severity, -(discrepancy or 0.0)


def digits_of(case: Case) -> str:
    """Return how many digits agree in every component, rounded down to make no false claim."""
    verdict = case.verdict
    if verdict is None or case.digits is None:
        return NOTHING
    exact = verdict.largest_discrepancy == verdict.largest_uncertainty == 0
    return "all" if exact else f"{case.digits:.1f}"


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


def _verdict(verdict: Verdict, digits: str) -> tuple[Fact, ...]:
    if verdict.discrepancy is None and verdict.uncertainty is None:
        return ()
    order, by_steps = quantity(verdict.order, "", 4), verdict.decided_by == "single steps"
    return (
        ("decided by", verdict.decided_by),
        ("agreeing digits", digits),
        ("worst component", verdict.component),
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
            ("between engines", steps.between),
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


def _of_step(step: TimeStep | None) -> tuple[Fact, ...]:
    return () if step is None else (("time step", step_words(step)),)


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
        yield f"{event.part}, {event.change}", f"{quantity(event.time, 's', 6)}, {delay}"


def _acting_facts(model: Model) -> Iterator[Fact]:
    """Yield what the numbers of a model act as, if its system declares what they are to act as."""
    for row in model.acting if model.declares else ():
        rule = f" ({row.rule})" if row.rule else ""
        yield f"{row.subject}: {row.quantity}", f"{quantity(row.value, row.unit)}{rule}"


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
        yield "scenario", scenario.description
        yield from scenario.inputs.items()
    if case.full_run is not None and case.full_run.integrator:
        yield "integrator", case.full_run.integrator
    if case.verdict is not None:
        steps = f"{case.verdict.steps:,}".replace(",", "\u202f")
        yield "engine steps for the verdict", steps
        if case.verdict.rungs:
            yield "steps a segment", ", ".join(str(rung) for rung in case.verdict.rungs)
    for skipped in case.skipped:
        yield f"skipped: {skipped.check}", skipped.reason
    if case.seconds:
        yield "took", quantity(case.seconds, "s", 2)
