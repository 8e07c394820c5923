"""Changes of one case since it was accepted, from numbers alone.

Limits are compared on the accepted snapshot, within the uncertainties of both: the model's motion
and the equations' motion from the same states under the same inputs. So the gate distinguishes a
changed model, changed equations, and both; the error of the time step is separate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from physics_crosscheck.harness.baseline.fingerprint import changed_names
from physics_crosscheck.harness.baseline.movement import (
    Movement,
    Sized,
    discrepancy_moved,
    in_words,
    of_equations,
    of_model,
)
from physics_crosscheck.harness.baseline.part import Part
from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.baseline import (
    AcceptedCase,
    Identified,
    Measurement,
    Snapshot,
)
from physics_crosscheck.harness.records.outcome import Outcome


class Status(StrEnum):
    """Status of a case in the gate, worst first; the value is what the gate prints."""

    NOT_RUN = "could not run"
    CHANGED = "changed"
    GONE = "gone"
    NEW = "new"
    IMPROVED = "improved"
    WITHIN = "no change in motion"
    KNOWN = "known difference"
    SAME = "as accepted"

    @property
    def passes(self) -> bool:
        """Return whether the gate passes such a case."""
        return self not in (Status.NOT_RUN, Status.CHANGED, Status.GONE, Status.NEW)


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A case compared with its accepted result; see `classify.Change`.

    `causes` are sentences on other changes: the engine's version, this package's numerics.
    """

    status: Status
    kinds: tuple[str, ...]
    messages: tuple[str, ...]
    causes: tuple[str, ...]
    size: float


@dataclass(frozen=True)
class _Motion:
    """Changes of both motions on the accepted snapshot, if that is `comparable`."""

    model: Movement
    equations: Movement
    comparable: bool

    @property
    def settled(self) -> bool:
        """Return whether neither motion changed."""
        return self.comparable and not (self.model or self.equations)


def compare(
    then: AcceptedCase,
    now: AcceptedCase,
    snapshot: Snapshot | None,
    measured: Measurement | None,
) -> Difference:
    """Compare a case that was run and measured with its accepted result.

    Args:
        then: the accepted result.
        now: the result that would be accepted.
        snapshot: the snapshot of `then`; None if the engine refuses the file.
        measured: measurement of the model, on that snapshot too; None likewise.
    """
    causes = _causes(then, now)
    if snapshot is None or measured is None:
        return _refused(then, now, causes)
    motion = _motion(then, snapshot, measured)
    parts = [_model_part(then, now, motion, causes), _equations_part(now, motion)]
    if motion.comparable and not motion.equations and "tool" not in causes:
        parts.append(_scenario_part(snapshot, measured.snapshot))
    kinds_so_far = tuple(kind for part in parts for kind in part.kinds)
    parts.append(_outcome_part(then, now, motion, causes, kinds_so_far))
    parts.append(cost_part(then, now, motion.settled))
    kinds = tuple(dict.fromkeys(kind for part in parts for kind in part.kinds))
    status = _status(parts, then, causes)
    if status in (Status.WITHIN, Status.KNOWN) and not kinds:
        kinds = tuple(dict.fromkeys(_harmless(cause) for cause in causes))
    messages = [f"{now.outcome}, accepted as {then.outcome}"] if now.outcome != then.outcome else []
    messages += [message for part in parts for message in part.messages]
    messages += constants_moved(then.constants, now.constants)
    return Difference(
        status=status,
        kinds=kinds,
        messages=tuple(messages),
        causes=tuple(causes[cause] for cause in ("engine", "tool") if cause in causes),
        size=max(motion.model.size, motion.equations.size),
    )


def _refused(then: AcceptedCase, now: AcceptedCase, causes: Mapping[str, str]) -> Difference:
    """Compare a case that the engine refuses, or refused, with its accepted result."""
    status, kinds = Status.KNOWN, tuple(dict.fromkeys(map(_harmless, causes)))
    messages: tuple[str, ...] = ()
    if now.outcome != then.outcome:
        status = Status.IMPROVED if now.outcome is Outcome.AGREES else Status.CHANGED
        kinds = _blamed(causes)
        messages = (f"{now.outcome}, accepted as {then.outcome}", now.outcome_reason)
    return Difference(
        status=status,
        kinds=kinds,
        messages=tuple(filter(None, messages)),
        causes=tuple(causes[cause] for cause in ("engine", "tool") if cause in causes),
        size=0.0,
    )


def why_not_known(
    then: AcceptedCase, size: Sized, snapshot: Snapshot, measured: Measurement
) -> str:
    """Return how a case of the same outcome differs from the accepted one; "" if it does not."""
    motion = _motion(then, snapshot, measured)
    if not motion.comparable:
        return "the coordinates or inputs of the system changed"
    if motion.model:
        return f"the model's motion changed by {motion.model}"
    if motion.equations:
        return f"the equations' motion changed by {motion.equations}"
    if discrepancy_moved(then, size):
        return f"its discrepancy was {in_words(then)} then"
    return ""


def _causes(then: AcceptedCase, now: AcceptedCase) -> dict[str, str]:
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


def _harmless(cause: str) -> str:
    """Return the kind of a change that left the motion as it was."""
    return cause if cause in ("engine", "tool") else "text"


def _blamed(causes: Mapping[str, str]) -> tuple[str, ...]:
    """Return the changes that may have changed a motion."""
    if not causes:
        return ("unexplained",)
    blamed = tuple(kind for kind in ("model", "engine", "tool") if kind in causes)
    # The declaration alone can move a model's motion by what it calls its coordinates.
    return blamed or ("equations" if "declaration" in causes else "numbers",)


def _motion(then: AcceptedCase, snapshot: Snapshot, measured: Measurement) -> _Motion:
    now = measured.on_accepted
    if now is None:
        return _Motion(Movement(), Movement(), False)
    return _Motion(of_model(then, snapshot, now), of_equations(snapshot, now), True)


def _model_part(
    then: AcceptedCase, now: AcceptedCase, motion: _Motion, causes: Mapping[str, str]
) -> Part:
    """Return the change of the model's motion."""
    if not motion.model:
        return Part()
    mended = then.outcome is not Outcome.AGREES and now.outcome is Outcome.AGREES
    better = mended and not motion.equations
    message = f"the model's motion changed by {motion.model}"
    return Part(kinds=_blamed(causes), messages=(message,), worse=not better, better=better)


def _equations_part(now: AcceptedCase, motion: _Motion) -> Part:
    """Return the change of the equations' motion."""
    if not motion.comparable:
        message = "the coordinates or inputs of the system changed, so no motion can be compared"
        return Part(kinds=("equations",), messages=(message,), worse=True)
    if not motion.equations:
        return Part()
    messages = [f"the equations' motion changed by {motion.equations}"]
    if motion.model and now.outcome is Outcome.AGREES:
        messages.append("model and equations changed alike, and agree")
    return Part(kinds=("equations",), messages=tuple(messages), worse=True)


def _scenario_part(was: Snapshot, now: Snapshot) -> Part:
    """Return how the present snapshot's scenario differs from the accepted one."""
    if was == now:
        return Part()
    changes = []
    if was.duration != now.duration:
        changes.append(f"duration {was.duration:g} s -> {now.duration:g} s")
    changed = zip(was.inputs, now.inputs, strict=False)
    changes += [f"input {old} -> {new}" for old, new in changed if old != new]
    if was.components != now.components:
        changes.append(f"components {', '.join(was.components)} -> {', '.join(now.components)}")
    changes = changes or ["its initial state, or a motion of the system's other scenarios"]
    message = f"the scenario changed: {'; '.join(changes)}"
    return Part(kinds=("scenario",), messages=(message,), worse=True)


def _outcome_part(
    then: AcceptedCase,
    now: AcceptedCase,
    motion: _Motion,
    causes: Mapping[str, str],
    kinds: tuple[str, ...],
) -> Part:
    """Return a change of the outcome or of a known difference where no motion changed."""
    if not motion.settled:
        return Part()
    if now.outcome != then.outcome:
        blamed = () if other_method(then, now) else _blamed(causes)
        agrees = now.outcome is Outcome.AGREES
        return Part(
            kinds=blamed if blamed or kinds else ("outcome",), better=agrees, worse=not agrees
        )
    if now.outcome is Outcome.AGREES or not discrepancy_moved(then, now):
        return Part()
    message = f"the discrepancy is {in_words(now)}, accepted as {in_words(then)}"
    return Part(kinds=_blamed(causes), messages=(message,), worse=True)


def _status(parts: list[Part], then: AcceptedCase, causes: Mapping[str, str]) -> Status:
    if any(part.worse for part in parts):
        return Status.CHANGED
    if any(part.better for part in parts):
        return Status.IMPROVED
    if then.outcome is not Outcome.AGREES:
        return Status.KNOWN
    return Status.WITHIN if causes else Status.SAME


GLOBAL = 0.01
"""Smallest relative change of a global error to report. A global error e is a leading term with a
relative error e, so the larger of the two counts.
"""

ORDER = 0.5
"""Smallest change of a convergence order to report: half the distance to the next order."""


def other_method(then: AcceptedCase, now: AcceptedCase) -> bool:
    """Return whether the time-stepping method changed."""
    return (then.time_step, then.integrator, then.claimed_order) != (
        now.time_step,
        now.integrator,
        now.claimed_order,
    )


def cost_part(then: AcceptedCase, now: AcceptedCase, settled: bool) -> Part:
    """Report the cost of a time step; it is judged only if the limit has not changed
    (`settled`).
    """
    part = _method(then, now)
    part = _orders(then, now, _error(then, now, part, settled))
    worse, better = (part.worse, part.better) if settled else (False, False)
    kinds = ("numbers",) if part.messages else ()
    return Part(kinds=kinds, messages=part.messages, worse=worse, better=better and not worse)


def _method(then: AcceptedCase, now: AcceptedCase) -> Part:
    messages = []
    if then.time_step != now.time_step:
        messages.append(f"step {_seconds(then.time_step)} -> {_seconds(now.time_step)}")
    if then.integrator != now.integrator:
        messages.append(f"integrator {then.integrator} -> {now.integrator}")
    return Part(messages=tuple(messages))


def _error(then: AcceptedCase, now: AcceptedCase, part: Part, settled: bool) -> Part:
    """Add changes of the global error at the file's own time step."""
    a, b = then.global_error, now.global_error
    if a is None or b is None:
        if a == b:
            return part
        finite = "the error at dt is finite now" if a is None else "the error at dt is not finite"
        return Part(messages=(*part.messages, finite), worse=b is None, better=a is None)
    tolerance = max(GLOBAL, min(1.0, a)) * a + 1e-12
    if abs(b - a) <= tolerance or not (settled or part.messages):
        return part
    message = f"error at dt {_percent(a)} -> {_percent(b)}"
    return Part(messages=(*part.messages, message), worse=b > a, better=b < a)


def _orders(then: AcceptedCase, now: AcceptedCase, part: Part) -> Part:
    """Add changes of the convergence orders."""
    messages, worse, better = list(part.messages), part.worse, part.better
    pairs = (
        ("claimed order", then.claimed_order, now.claimed_order),
        ("order on the segments", then.order, now.order),
    )
    for what, a, b in pairs:
        if a is None or b is None or abs(b - a) <= ORDER:
            continue
        messages.append(f"{what} {a:.2g} -> {b:.2g}")
        # A higher order with a higher error is no improvement, nor is the opposite.
        worse = worse or (b < a and not better)
        better = better or (b > a and not worse)
    return Part(messages=tuple(messages), worse=worse, better=better)


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
