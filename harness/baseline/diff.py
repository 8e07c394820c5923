"""Difference between two results of a case: the one comparison of gate, versions and report.

A change is significant if it exceeds the combined uncertainty of both results. Where both motions
were measured from the same states, their ends are compared: those of the model and those of the
equations. So the gate distinguishes a changed model from changed equations. Otherwise the
discrepancies are compared. The error of the time step is separate.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import msgspec

from physics_crosscheck.harness.records.base import Number, Numbers, Rows
from physics_crosscheck.harness.records.baseline import (
    AcceptedCase,
    Identified,
    LawNumber,
    Measurement,
    OnAccepted,
    Snapshot,
    WholeSteps,
)
from physics_crosscheck.harness.records.case import CaseId, starts_at
from physics_crosscheck.harness.records.diff import (
    WORST_FIRST,
    CaseNumbers,
    Changed,
    Diff,
    Status,
    bare_diff,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import percent
from .fingerprint import changed_names

ERROR_SHARE = 0.01
"""Smallest relative change of an error at the time step to report."""

ORDER = 0.5
"""Smallest change of a convergence order to report: half the distance to the next order."""

EQUATIONS = 1e-11
"""Relative movement of a segment's end, by the equations, below which it is unchanged: ten times
the tolerated difference of the two integrations of a reference.
"""

STEPS = 1e-9
"""Smallest relative change of whole steps, and of the compiled numbers of their laws."""

ROUNDING = 1e-15


def has_error_changed(before: Number, after: Number) -> bool:
    """Return whether an error at the time step changed by more than its uncertainty.

    The uncertainty is a share of the smaller error, so a rise and the opposite fall count alike.
    The share is 1 % up to an error of 10 % of the amplitude. Above, it grows with the square of
    the error up to 100 %, because rounding changes errors that are close to the amplitude.

    Args:
        before, after: errors relative to the amplitude; None if not finite.
    """
    if before is None or after is None:
        return before is not after
    smaller = min(before, after)
    share = max(ERROR_SHARE, min(1.0, smaller**2))
    return abs(after - before) > share * smaller + 1e-12


@dataclass(frozen=True, kw_only=True)
class Movement:
    """A change of a segment's end; all zero without one.

    Attributes:
        size, uncertainty: relative to the component's movement over a segment.
        component: the component of the state.
        place: start of the segment: a time, or the number of the state.
    """

    size: float = 0.0
    uncertainty: float = 0.0
    component: str = ""
    place: str = ""

    def __bool__(self) -> bool:
        return self.size > 0.0

    def __str__(self) -> str:
        size = percent(self.size)
        if "%" not in size:  # close to rounding
            size += f" ± {self.uncertainty:.0e}"
        return f"{size} of its displacement, in {self.component} near {self.place}"


@dataclass(frozen=True, kw_only=True)
class MotionChange:
    """Changes of both motions on the same segments.

    Attributes:
        model, equations: changes beyond the uncertainties.
        apart: the largest change of the model's motion, even one that uncertainties cover.
        is_comparable: whether coordinates and inputs are the same.
        scenario: sentence on how the scenario changed; empty if it did not.
    """

    model: Movement = Movement()
    equations: Movement = Movement()
    apart: Movement = Movement()
    is_comparable: bool = True
    scenario: str = ""

    @property
    def is_settled(self) -> bool:
        """Return whether neither motion changed."""
        return self.is_comparable and not (self.model or self.equations)

    @property
    def largest(self) -> Movement:
        """The larger change of both motions, even one that uncertainties cover."""
        return _largest((self.apart, self.equations))


def motion_of(then: AcceptedCase, snapshot: Snapshot, measured: Measurement) -> MotionChange:
    """Compare a measured motion with the accepted one, on the accepted snapshot."""
    now = measured.on_accepted
    if now is None:
        return MotionChange(is_comparable=False)
    was = _Ends(then.end, then.end_uncertainty)
    there = _Ends(now.end, now.uncertainty)
    movements = _movements(was, there, snapshot.t, snapshot.scale, snapshot.components)
    bound = max((movement.uncertainty for movement in movements), default=0.0)
    return MotionChange(
        model=_largest_significant(movements),
        equations=equations_movement(snapshot, now),
        apart=replace(_largest(movements), uncertainty=bound),
        scenario=_scenario(snapshot, measured.snapshot),
    )


def equations_movement(snapshot: Snapshot, now: OnAccepted) -> Movement:
    """Return the largest change of the equations' motion since it was accepted."""
    bound = (tuple(EQUATIONS * s for s in snapshot.scale),) * len(snapshot.end)
    was, present = _Ends(snapshot.end, bound), _Ends(now.equations, bound)
    scales = snapshot.scale
    return _largest_significant(_movements(was, present, snapshot.t, scales, snapshot.components))


@dataclass(frozen=True)
class _Ends:
    """Ends of segments and their uncertainty, (K, 2n) each."""

    value: Sequence[Numbers]
    uncertainty: Rows


def _movements(
    was: _Ends, now: _Ends, times: Numbers | Sequence[None], scales: Numbers, names: Sequence[str]
) -> list[Movement]:
    """Return the movement of each end whose numbers are finite, with both uncertainties."""
    movements = []
    rows = zip(was.value, was.uncertainty, now.value, now.uncertainty, times, strict=True)
    for segment, (*ends, time) in enumerate(rows):
        place = starts_at(time, segment)
        for a, ua, b, ub, scale, component in zip(*ends, scales, names, strict=True):
            if a is None or b is None or ua is None or ub is None or not scale:
                continue
            size, bound = abs(b - a), ua + ub + ROUNDING * (abs(a) + abs(b))
            movements.append(
                Movement(
                    size=size / scale, uncertainty=bound / scale, component=component, place=place
                )
            )
    return movements


def _largest_significant(movements: Iterable[Movement]) -> Movement:
    """Return the largest movement beyond its uncertainty; all zero without one."""
    return _largest(one for one in movements if one.size > one.uncertainty)


def _largest(movements: Iterable[Movement]) -> Movement:
    return max(movements, key=lambda movement: movement.size, default=Movement())


def _scenario(was: Snapshot, now: Snapshot) -> str:
    """Return a sentence on how a snapshot's scenario changed; empty if it did not."""
    if msgspec.structs.replace(was, steps=None) == now:
        return ""
    changes = []
    if was.duration != now.duration:
        changes.append(f"duration {was.duration:g} s -> {now.duration:g} s")
    changed = zip(was.inputs, now.inputs, strict=False)
    changes += [f"input {old} -> {new}" for old, new in changed if old != new]
    if was.components != now.components:
        changes.append(f"components {', '.join(was.components)} -> {', '.join(now.components)}")
    changes = changes or ["its initial state, or a motion of the system's other scenarios"]
    return f"the scenario changed: {'; '.join(changes)}"


def diff_accepted(
    then: AcceptedCase, now: AcceptedCase, snapshot: Snapshot | None, measured: Measurement | None
) -> Diff:
    """Compare a case that was run and measured with its accepted result.

    Args:
        then: the accepted result.
        now: the result that would be accepted.
        snapshot: the snapshot of `then`; None if the engine refuses the file.
        measured: measurement of the model, on that snapshot too; None likewise.
    """
    motion = None
    if snapshot is not None and measured is not None:
        motion = motion_of(then, snapshot, measured)
    causes = changed_dependencies(then, now)
    diff = diff_cases(then.id, then.numbers, now.numbers, motion=motion, causes=causes)
    if sentences := _step_changes(then.steps, measured) if measured else []:
        diff = msgspec.structs.replace(
            diff,
            status=Status.CHANGED,
            kinds=tuple(dict.fromkeys((*_blamed(causes), *(k for k in diff.kinds if k != "text")))),
            changed=tuple(one for one in WORST_FIRST if one in (*diff.changed, "steps")),
            messages=(*diff.messages, *sentences),
        )
    moved = constants_moved(then.constants, now.constants)
    return msgspec.structs.replace(diff, messages=(*diff.messages, *moved))


MAX_LAWS = 5
"""Maximum number of reported numbers of a law."""


def _step_changes(then: WholeSteps | msgspec.UnsetType, measured: Measurement) -> list[str]:
    """Return sentences on the whole steps of a robot file that changed since it was accepted."""
    now = measured.steps
    if isinstance(then, msgspec.UnsetType):
        return []
    if now is None:
        return ["its whole steps can't be compared any more"]
    laws = [
        f"compiled {name} {then.laws.get(name, 'none')} -> {now.laws.get(name, 'none')}"
        for name in dict.fromkeys([*then.laws, *now.laws])
        if not _is_same(then.laws.get(name), now.laws.get(name))
    ]
    more = [f"{len(laws) - MAX_LAWS} more numbers of its laws changed"] if laws[MAX_LAWS:] else []
    ends = None if measured.on_accepted is None else measured.on_accepted.steps
    if ends is None:
        return ["other coordinates or controls", *laws[:MAX_LAWS], *more]
    was, now_ends = (_Ends(one.values, one.uncertainty) for one in (then.ends, ends))
    times = [None] * len(then.states)
    moved = _movements(was, now_ends, times, then.scale, then.components)
    largest = _largest(m for m in moved if m.size > max(m.uncertainty, STEPS))
    sentence = (
        f"with limits, friction, contacts and drives, {largest.component} changed by"
        f" {percent(largest.size)} of its largest value, at {largest.place}"
    )
    return [*([sentence] if largest else []), *laws[:MAX_LAWS], *more]


def _is_same(then: LawNumber | None, now: LawNumber | None) -> bool:
    """Return whether two numbers of laws are the same up to the rounding of a compiler."""
    if isinstance(then, float) and isinstance(now, float):
        return math.isclose(then, now, rel_tol=STEPS, abs_tol=1e-12)
    return then == now


def changed_dependencies(then: AcceptedCase, now: AcceptedCase) -> dict[str, str]:
    """Return the changed dependencies of a case: kind -> sentence."""
    changed = changed_names(then.files, now.files)
    causes = {}
    models = [name for name in changed if name != "system.py"]
    if models:
        causes["model"] = f"changed: {', '.join(models)}"
    if "system.py" in changed:
        causes["declaration"] = "changed: system.py"
    if then.engine_version != now.engine_version:
        causes["engine"] = f"engine version {then.engine_version} -> {now.engine_version}"
    if then.numerics != now.numerics:
        causes["tool"] = f"version of crosscheck's numerics {then.numerics} -> {now.numerics}"
    if then.resolution != now.resolution:
        causes["resolution"] = f"resolution {then.resolution:g} -> {now.resolution:g}"
    return causes


def diff_cases(
    id_: CaseId,
    before: CaseNumbers,
    after: CaseNumbers,
    *,
    motion: MotionChange | None = None,
    causes: Mapping[str, str] | None = None,
) -> Diff:
    """Compare a case in two results.

    Args:
        id_: name of the case.
        before, after: its numbers.
        motion: changes of its motion; None if it was not measured on the same segments.
        causes: changed dependencies, as by `changed_dependencies`; None if unknown.
    """
    bare = bare_diff(id_, Status.SAME, before=before, after=after)
    if not (before.outcome.is_run and after.outcome.is_run):
        return _not_run(bare, before, after, causes)
    builder = _DiffBuilder(before, after, motion, causes)
    builder.compare()
    distance = None if motion is None or not motion.is_comparable else motion.largest
    return msgspec.structs.replace(
        bare,
        status=builder.status,
        kinds=builder.all_kinds,
        changed=builder.all_changed,
        messages=tuple(builder.messages),
        moved=None if distance is None else distance.size,
        uncertainty=None if distance is None else distance.uncertainty,
    )


def _not_run(
    bare: Diff, before: CaseNumbers, after: CaseNumbers, causes: Mapping[str, str] | None
) -> Diff:
    """Compare a case that did not run to its end in both results."""
    if before.outcome is after.outcome:
        is_refused = after.outcome is Outcome.REFUSED
        return msgspec.structs.replace(
            bare, status=Status.EXPECTED if is_refused else Status.NOT_RUN, kinds=_harmless(causes)
        )
    return msgspec.structs.replace(
        bare,
        status=Status.IMPROVED if after.outcome is Outcome.AGREES else Status.CHANGED,
        kinds=_blamed(causes),
        changed=("verdict",),
        messages=tuple(filter(None, (verdict_change(before, after), after.reason))),
    )


def verdict_change(before: CaseNumbers, after: CaseNumbers) -> str:
    """Return a sentence on two different outcomes."""
    why = f" ({before.reason})" if before.outcome is Outcome.REFUSED else ""
    return f"the verdict changed from {before.outcome}{why} to {after.outcome}"


def _harmless(causes: Mapping[str, str] | None) -> tuple[str, ...]:
    """Return the kinds of changes that left the motion as it was."""
    kinds = (cause if cause in ("engine", "tool") else "text" for cause in causes or ())
    return tuple(dict.fromkeys(kinds))


def _blamed(causes: Mapping[str, str] | None) -> tuple[str, ...]:
    """Return the changes that may have changed a motion."""
    if causes is None:
        return ()
    if not causes:
        return ("unexplained",)
    blamed = tuple(kind for kind in ("model", "engine", "tool") if kind in causes)
    # The declaration alone can move a model's motion by what it calls its coordinates.
    return blamed or ("equations" if "declaration" in causes else "numbers",)


@dataclass
class _DiffBuilder:
    """Changes of one case that ran to its end in both results."""

    before: CaseNumbers
    after: CaseNumbers
    motion: MotionChange | None
    causes: Mapping[str, str] | None
    changed: list[Changed] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    is_worse: bool = False
    is_better: bool = False

    def add(
        self,
        what: Changed,
        message: str = "",
        kinds: Iterable[str] = (),
        *,
        better: bool | None = None,
    ) -> None:
        """Add a change; without `better` it is neither better nor worse."""
        self.changed.append(what)
        self.kinds += kinds
        self.messages += filter(None, [message])
        self.is_better |= better is True
        self.is_worse |= better is False

    def compare(self) -> None:
        """Collect all changes."""
        if not self._same_outcome:
            self.messages.append(verdict_change(self.before, self.after))
            self.changed.append("verdict")
        if self.motion is not None:
            self._compare_motion(self.motion)
        if self._is_settled:
            self._compare_verdict()
        self._compare_cost()

    @property
    def status(self) -> Status:
        """Status of the case."""
        if self.is_worse:
            return Status.CHANGED
        if self.is_better:
            return Status.IMPROVED
        if self.before.outcome is not Outcome.AGREES:
            return Status.EXPECTED
        return Status.WITHIN if self.causes else Status.SAME

    @property
    def all_kinds(self) -> tuple[str, ...]:
        """Kinds of the changes, each once."""
        if self.status in (Status.WITHIN, Status.EXPECTED) and not self.kinds:
            return _harmless(self.causes)
        return tuple(dict.fromkeys(self.kinds))

    @property
    def all_changed(self) -> tuple[Changed, ...]:
        """Changed quantities, the worst first."""
        return tuple(one for one in WORST_FIRST if one in self.changed)

    @property
    def _same_outcome(self) -> bool:
        return self.before.outcome is self.after.outcome

    @property
    def _is_settled(self) -> bool:
        return self.motion is None or self.motion.is_settled

    def _compare_motion(self, motion: MotionChange) -> None:
        agrees = self.after.outcome is Outcome.AGREES
        if motion.model:
            better = agrees and not self._same_outcome and not motion.equations
            message = f"the model's motion changed by {motion.model}"
            self.add("limit", message, _blamed(self.causes), better=better)
        if not motion.is_comparable:
            message = (
                "the coordinates or inputs of the system changed, so no motion can be compared"
            )
            self.add("equations", message, ("equations",), better=False)
        elif motion.equations:
            message = f"the equations' motion changed by {motion.equations}"
            self.add("equations", message, ("equations",), better=False)
            if motion.model and agrees:
                self.messages.append("model and equations changed alike, and agree")
        elif motion.scenario and "tool" not in (self.causes or ()):
            self.add("scenario", motion.scenario, ("scenario",), better=False)

    def _compare_verdict(self) -> None:
        """Compare outcomes and discrepancies where no motion changed."""
        before, after = self.before, self.after
        agrees = after.outcome is Outcome.AGREES
        if not self._same_outcome:
            blamed = () if other_method(before, after) else _blamed(self.causes)
            unattributed = () if self.kinds or self.causes is None else ("outcome",)
            self.add("verdict", kinds=blamed or unattributed, better=agrees)
        if self.motion is None:
            is_comparable = before.component == after.component
        else:
            is_comparable = self._same_outcome and not agrees
        if is_comparable and has_discrepancy_changed(before, after):
            message = f"the discrepancy changed from {_in_words(before)} to {_in_words(after)}"
            self.add("discrepancy", message, _blamed(self.causes), better=False)

    def _compare_cost(self) -> None:
        """Compare the cost of a time step; judge it only if the limit has not changed."""
        changes = list(_cost_changes(self.before, self.after, self._is_settled))
        # A higher order with a higher error is no improvement, nor is the opposite.
        better = next((better for *_, better in changes if better is not None), None)
        is_unmeasured = self.before.global_error is None and self.after.global_error is None
        if self.before.integrator and is_unmeasured and other_method(self.before, self.after):
            better = False  # no full run judges the method of a robot file
        for what, message, _ in changes:
            kinds = () if self.causes is None else ("numbers",)
            self.add(what, message, kinds, better=better if self._is_settled else None)


def has_discrepancy_changed(was: CaseNumbers, now: CaseNumbers) -> bool:
    """Return whether a discrepancy changed by more than both uncertainties."""
    bounds = was.uncertainty, now.uncertainty
    if None in bounds:
        # A case with infinite uncertainty claims no digit, before and now.
        return bounds != (None, None)
    a, b, ua, ub = was.discrepancy, now.discrepancy, *bounds
    if a is None or b is None or ua is None or ub is None:
        return False
    return abs(a - b) > ua + ub + ROUNDING


def _in_words(numbers: CaseNumbers) -> str:
    """Format a discrepancy with its uncertainty; either may have no finite value."""
    sizes = numbers.discrepancy, numbers.uncertainty
    return " ± ".join("unknown" if one is None else f"{one:.3e}" for one in sizes)


def other_method(before: CaseNumbers, after: CaseNumbers) -> bool:
    """Return whether the time-stepping method changed."""
    then = before.time_step, before.integrator, before.claimed_order
    return then != (after.time_step, after.integrator, after.claimed_order)


def _cost_changes(
    before: CaseNumbers, after: CaseNumbers, is_settled: bool
) -> Iterator[tuple[Changed, str, bool | None]]:
    """Yield changes of the method, of the error at the time step and of the orders.

    Yields:
        What changed, a message, and whether it is better; None if neither.
    """
    is_method = False
    if before.time_step != after.time_step:
        is_method = True
        yield "dt", f"step {_seconds(before.time_step)} -> {_seconds(after.time_step)}", None
    if before.integrator != after.integrator:
        is_method = True
        yield "integrator", f"integrator {before.integrator} -> {after.integrator}", None
    a, b = before.global_error, after.global_error
    is_finite = a is not None and b is not None
    if has_error_changed(a, b) and (is_settled or is_method or not is_finite):
        yield "error at dt", _error_message(a, b), b is not None and (a is None or b < a)
    for what, then, now in (
        ("claimed order", before.claimed_order, after.claimed_order),
        ("order on the segments", before.order, after.order),
    ):
        if then is not None and now is not None and abs(now - then) > ORDER:
            yield "order", f"{what} {then:.2g} -> {now:.2g}", now > then


def _error_message(then: Number, now: Number) -> str:
    if then is None:
        return "the error at dt is finite now"
    if now is None:
        return "the error at dt is not finite"
    return f"error at dt {_percent(then)} -> {_percent(now)}"


def _seconds(value: Number) -> str:
    return "unknown" if value is None else f"{value:g} s"


def _percent(value: float) -> str:
    return f"{value * 100:.3g} %"


def constants_moved(was: Mapping[str, Identified], now: Mapping[str, Identified]) -> list[str]:
    """Describe the constants identified from the motion whose values changed."""
    moved = []
    for name in (name for name in now if name in was):
        old, new = was[name], now[name]
        errors = old.standard_error + new.standard_error
        if abs(new.value - old.value) > 3 * errors + 1e-12 * abs(old.value):
            share = max(new.standard_error, 1e-300) / max(abs(new.value), 1e-300)
            digits = min(max(2 - math.floor(math.log10(share)), 3), 10)
            moved.append(
                f"the motion implies {name} {old.value:.{digits}g} -> {new.value:.{digits}g}"
            )
    return moved
