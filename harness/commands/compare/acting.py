"""Quantities that the numbers of both files act as, side by side."""

import math
from collections.abc import Iterator, Mapping, Sequence

from physics_crosscheck.harness.checks.acting import (
    DRAG,
    LARGEST,
    acting_quantities,
    merged,
    urdf_quantities,
)
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.records.comparison import ComparedActing
from physics_crosscheck.harness.records.finding import is_near
from physics_crosscheck.harness.records.survey import ActingQuantity
from .candidate import Facts

EQUAL = 1e-9
"""Relative difference below which two values are equal."""

ALIKE = 0.01
"""Relative deviation from a factor that a usual mistake makes."""

FRICTION, FREQUENCY, DAMPING = "friction", "natural frequency", "damping ratio"

BY_SOLVER = (FRICTION, "restitution", "rest depth", "creep", "rebound", "time constant")
"""Quantities that a solver of impulses determines itself."""

_Key = tuple[str, str]


def compare_acting(models: tuple[Facts, Facts]) -> tuple[ComparedActing, ...]:
    """Return the quantities that differ; nothing unless both engines act by a documented law.

    Each joint, body and shape is compared with that of the same name; equal differences then form
    one row.
    """
    by_shape = all(map(_is_compiled, models))
    tables = [_table(facts, by_shape=by_shape) for facts in models]
    if not all(tables):
        return ()
    keys = dict.fromkeys(key for table in tables for key in table)
    return tuple(merged(row for key in keys for row in _compared(key, *tables)))


def _is_compiled(facts: Facts) -> bool:
    suffix = facts.candidate.sidecar.model.suffix
    return facts.compiled is not None and suffix in engines()[facts.candidate.engine].compiles


def _table(facts: Facts, *, by_shape: bool) -> Mapping[_Key, ActingQuantity]:
    candidate = facts.candidate
    if facts.compiled is not None and _is_compiled(facts):
        rows = acting_quantities(facts.compiled, apart=True, by_shape=by_shape)
    else:
        try:
            rows = urdf_quantities(candidate.sidecar.spec(candidate.engine), candidate.engine)
        except EngineError:
            return {}
    return {(row.subject, row.quantity): row for row in rows}


def _compared(
    key: _Key, a: Mapping[_Key, ActingQuantity], b: Mapping[_Key, ActingQuantity]
) -> Iterator[ComparedActing]:
    here, there = a.get(key), b.get(key)
    either = here or there
    assert either is not None
    values = [None if row is None else row.value for row in (here, there)]
    if not is_near(values[0], values[1], EQUAL) or (
        here and there and _clamped_elsewhere(here, there)
    ):
        yield ComparedActing(
            subject=either.subject,
            quantity=either.quantity,
            unit=either.unit,
            a=values[0],
            b=values[1],
            cause=_cause(key, a, b),
        )


def _clamped_elsewhere(a: ActingQuantity, b: ActingQuantity) -> bool:
    """Return whether two drives clamp their forces before and after others add up."""
    return a.quantity == LARGEST and a.rule != b.rule


def _cause(key: _Key, *tables: Mapping[_Key, ActingQuantity]) -> str:
    (subject, quantity), rows = key, [table.get(key) for table in tables]
    here, there = (None if row is None else row.value for row in rows)
    if quantity == DRAG:
        return "; ".join(_labelled_rules(rows))
    if here is None or there is None:
        return ""
    if rows[0] and rows[1] and _clamped_elsewhere(rows[0], rows[1]):
        return "; ".join(_labelled_rules(rows))
    if quantity == FRICTION and (mixing := _mixing(rows[0], rows[1])):
        return mixing
    if quantity in BY_SOLVER and (rule := _by_solver(rows)):
        return rule
    return _drive_cause(quantity, rows, here, there) if subject.startswith("drive of") else ""


def _drive_cause(
    quantity: str, rows: Sequence[ActingQuantity | None], here: float, there: float
) -> str:
    if quantity == FREQUENCY and here and there:
        ratio = math.degrees(1.0)
        for label, factor in (("A", (here / there) ** 2), ("B", (there / here) ** 2)):
            if math.isclose(factor * ratio, 1.0, rel_tol=ALIKE):
                return f"the gain of {label} is per degree, and acts per radian"
    if quantity == DAMPING and not here * there:
        return f"the damping of {'A' if not here else 'B'} is lost"
    return _unresolved(rows) if quantity == DAMPING else ""


def _unresolved(rows: Sequence[ActingQuantity | None]) -> str:
    """Return which drive damps by the number that is the damping ratio of the other, or ""."""
    for label, k in (("A", 0), ("B", 1)):
        mine, other = rows[k], rows[1 - k]
        if mine is None or other is None or not (mine.parts and other.parts):
            continue
        (damping, _), (another, ratio) = mine.parts, other.parts
        alike = [math.isclose(damping, value, rel_tol=ALIKE) for value in (ratio, another)]
        if alike == [True, False]:
            return f"the damping of {label} is the dampratio of the other file, not resolved"
    return ""


def _by_solver(rows: Sequence[ActingQuantity | None]) -> str:
    """Return the rule of an impulse solver in the only file whose engine has one, or ""."""
    words = ("product", "harmonic", "slop", "step", "impulse")
    labelled = [rule for rule in _labelled_rules(rows) if any(word in rule for word in words)]
    return labelled[0] if len(labelled) == 1 else ""


def _labelled_rules(rows: Sequence[ActingQuantity | None]) -> list[str]:
    """Return the rules of the files that have the quantity, each with its letter."""
    pairs = zip("AB", rows, strict=True)
    return [f"in {label}, {row.rule}" for label, row in pairs if row is not None]


def _mixing(a: ActingQuantity | None, b: ActingQuantity | None) -> str:
    """Return the other rule by which the friction of one file follows from the other's shapes."""
    for label, row, other in (("B", a, b), ("A", b, a)):
        if row is None or other is None or other.value is None or len(row.parts) != 2:
            continue
        rules = {
            "product": math.prod(row.parts),
            "mean": sum(row.parts) / 2,
            "smaller": min(row.parts),
        }
        for rule, value in rules.items():
            if is_near(value, other.value, EQUAL) and not is_near(value, row.value, EQUAL):
                return f"the friction of {label} is the {rule} of the two of the other file"
    return ""
