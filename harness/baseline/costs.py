"""Changes of the cost of a time step and of identified constants since they were accepted."""

from __future__ import annotations

import math
from collections.abc import Mapping

from physics_crosscheck.harness.baseline.part import Part
from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.baseline import AcceptedCase, Identified

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
