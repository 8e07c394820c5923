"""Changes of models beyond their cases: linearizations, remarks and failures."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.records.base import Rows
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.versions import ModelChange, VersionModel, VersionRun

_ALIKE = 1e-9
"""Relative tolerance for equal numbers in remarks."""

ROUNDING = 1e-14
"""Rounding of an entry of a linearization, relative to the largest entry."""

ModelChanges = Iterator[tuple[ModelChange, str]]


def changed_models(before: VersionRun, after: VersionRun) -> Iterator[VersionModel]:
    """Yield the common models that change."""
    there = {model.key: model for model in after.models}
    for was in before.models:
        now = there.get(was.key)
        if now is None:
            continue  # its cases report it
        changes = [
            *_failures(was, now, before.version, after.version),
            *_linearizations(was, now),
            *_remarks(was, now),
        ]
        if changes:
            yield VersionModel(
                system=was.system,
                model=was.model,
                engine=was.engine,
                folder=was.folder,
                kinds=tuple(dict.fromkeys(kind for kind, _ in changes)),
                messages=tuple(message for _, message in changes),
            )


def _failures(was: Model, now: Model, before: str, after: str) -> ModelChanges:
    """Return the parts of a model's check that ran under one version only."""
    then, present = dict(was.failures), dict(now.failures)
    for what, why in present.items():
        if what not in then:
            yield "fails", f"its {what} FAILED under {after}: {why}"
    for what, why in then.items():
        if what not in present:
            yield "loads", f"its {what} FAILED under {before}: {why}"


def _linearizations(was: Model, now: Model) -> ModelChanges:
    """Return linearizations that changed by more than both uncertainties."""
    there = {earlier.equilibrium: earlier for earlier in now.linearizations}
    for earlier in was.linearizations:
        other = there.get(earlier.equilibrium)
        if other is None:
            continue  # the failure is reported
        moved = [
            f"{name} by {size:.1e} ± {bound:.0e} of its largest entry"
            for name, size, bound in _moved(earlier, other)
            if size > bound
        ]
        if moved:
            message = f"its linearization about {earlier.equilibrium!r} moved: {', '.join(moved)}"
            yield "linearization", message
        elif earlier.differs != other.differs:
            verb = "is not Taylor's any more" if other.differs else "is Taylor's now"
            yield "linearization", f"its linearization about {earlier.equilibrium!r} {verb}"


def _moved(
    earlier: EngineLinearization, other: EngineLinearization
) -> Iterator[tuple[str, float, float]]:
    """Yield the change of each matrix and its uncertainty, if known."""
    for name, then, now, bounds in (
        ("A", earlier.a, other.a, (earlier.a_bound, other.a_bound)),
        ("B", earlier.b, other.b, (earlier.b_bound, other.b_bound)),
    ):
        if (size := _distance(then, now)) is None or None in bounds:
            continue
        yield name, size, sum(bound or 0.0 for bound in bounds) + ROUNDING


def _distance(then: Rows, now: Rows) -> float | None:
    """Return the largest difference of two matrices, relative to the largest entry of both."""
    was = [value for row in then for value in row]
    present = [value for row in now for value in row]
    if len(was) != len(present):
        return None
    both = [(a, b) for a, b in zip(was, present, strict=True) if a is not None and b is not None]
    largest = max((max(abs(a), abs(b)) for a, b in both), default=0.0)
    return max(abs(a - b) for a, b in both) / largest if largest else 0.0


def _remarks(was: Model, now: Model) -> ModelChanges:
    """Return remarks of one version only, and those whose numbers differ."""
    if was.audit is None or now.audit is None:
        return
    then, present = list(was.audit), list(now.audit)
    for finding in was.audit:
        same = next((other for other in present if finding.is_like(other, _ALIKE)), None)
        if same is not None:
            then.remove(finding)
            present.remove(same)
    yield from (("remark gained", _sentence(finding)) for finding in present)
    yield from (("remark lost", _sentence(finding)) for finding in then)


def _sentence(finding: AuditFinding) -> str:
    where = "" if finding.location is None else f"{finding.location}: "
    return f"{where}{finding.message}"
