"""Compare the records of two versions of an engine, case by case.

A version is compared with the one before it, as the gate compares a run with accepted results: on
the segments of the earlier one, within the uncertainties of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from physics_crosscheck.harness.baseline.classify import entry_of
from physics_crosscheck.harness.baseline.diff import diff_accepted, diff_cases
from physics_crosscheck.harness.baseline.fingerprint import dependencies
from physics_crosscheck.harness.extras.versions.models import changed_models
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.diff import Changed, Diff, Status, numbers_of
from physics_crosscheck.harness.records.versions import Measured, Upgrade, VersionRun


def upgrade(before: VersionRun, after: VersionRun, engine: str, resolution: float) -> Upgrade:
    """Return the changes from one version to another.

    Args:
        before: results of the earlier version.
        after: results of the later version, also measured on the same segments.
        engine: engine of both.
        resolution: resolution of both runs.
    """
    both = _Both(before, after, engine, resolution)
    cases = [_case(was, now, both) for was, now in pairs(before.cases, after.cases)]
    return Upgrade(
        before=before.version,
        after=after.version,
        cases=tuple(sorted(cases, key=lambda case: case.rank)),
        models=tuple(changed_models(before, after)),
    )


_EXPLAINED: frozenset[Changed] = frozenset(("verdict", "error at dt", "order", "integrator", "dt"))
"""Changes after which the reasons of both verdicts are listed."""

_Key = tuple[str, CaseId]


class _Both:
    """Two versions' runs, and the measurements of each."""

    def __init__(
        self, before: VersionRun, after: VersionRun, engine: str, resolution: float
    ) -> None:
        self.before, self.after = before, after
        self.engine, self.resolution = engine, resolution
        self._was, self._now = _by_case(before), _by_case(after)

    def measured(self, was: Case, now: Case) -> tuple[Measurement | str, Measurement | str]:
        """Return the measurement of a case under each version, or why it is missing."""
        return _measurement(self.before, self._was, was), _measurement(self.after, self._now, now)

    def entry(self, case: Case, measurement: Measurement, version: str) -> AcceptedCase:
        """Return a case as the baseline would store it."""
        depends = dependencies({}, self.engine, {self.engine: version}, self.resolution)
        return entry_of(case.id, case, measurement, depends)


def _measurement(
    run: VersionRun, measurements: Mapping[_Key, Measured], case: Case
) -> Measurement | str:
    measured = measurements.get((case.folder, case.id))
    if measured is not None and measured.measurement is not None and case.verdict is not None:
        return measured.measurement
    why = "" if measured is None or not measured.failure else f": {measured.failure}"
    return f"its motion under {run.version} could not be measured{why}"


def _by_case(run: VersionRun) -> Mapping[_Key, Measured]:
    return {(one.folder, one.case): one for one in run.measured}


def pairs(
    before: tuple[Case, ...], after: tuple[Case, ...]
) -> Iterator[tuple[Case | None, Case | None]]:
    """Yield the pairs of equal cases of two runs.

    A failure of a whole model or folder is paired with each of its cases.
    """
    there = {(case.folder, case.id): case for case in after}
    paired = set()
    unpaired = []
    for case in before:
        now = there.get((case.folder, case.id))
        if now is None:
            unpaired.append(case)
        else:
            paired.add((now.folder, now.id))
            yield case, now
    new = [case for case in after if (case.folder, case.id) not in paired]
    reported = set()
    for case in unpaired:
        failure = next((one for one in new if _stands_for(one, case)), None)
        others = [one for one in new if _stands_for(case, one)]
        if failure is None and others:
            continue  # reported with each of its cases
        if failure is not None:
            reported.add((failure.folder, failure.id))
        yield case, failure
    for case in new:
        failure = next((one for one in unpaired if _stands_for(one, case)), None)
        if failure is not None or (case.folder, case.id) not in reported:
            yield failure, case


def _stands_for(failure: Case, case: Case) -> bool:
    """Return whether a failure of a whole model or folder covers a case."""
    whole = failure.model in (case.model, "system.py")
    return failure.scenario == "-" and failure.folder == case.folder and whole


def _case(was: Case | None, now: Case | None, both: _Both) -> Diff:
    """Return the change of a case that at least one version has."""
    named = _named(was, now)
    bare = diff_cases(
        replace(named.id, engine=both.engine if named.engine == "-" else named.engine),
        None if was is None else numbers_of(was),
        None if now is None else numbers_of(now),
        folder=named.folder,
    )
    sides = (was, both.before.version), (now, both.after.version)
    bad = [(case, version) for case, version in sides if case is None or not case.outcome.is_run]
    messages = tuple(f"under {version} {_why(case)}" for case, version in bad)
    if len(bad) == 2:
        alike = was is not None and now is not None and was.reason == now.reason
        messages = (f"under both {_why(now)}",) if alike else messages
        return replace(bare, status=Status.NOT_RUN, messages=messages)
    if bad:
        return replace(bare, messages=messages)
    assert was is not None
    assert now is not None
    return _compared(bare, was, now, both)


def _named(was: Case | None, now: Case | None) -> Case:
    """Return the case with the more specific name."""
    cases = [case for case in (now, was) if case is not None]
    return next((case for case in cases if case.scenario != "-"), cases[0])


def _why(case: Case | None) -> str:
    return "there is no such case" if case is None else f"it is {case.outcome}: {case.reason}"


def _compared(bare: Diff, was: Case, now: Case, both: _Both) -> Diff:
    """Return the change of a case that ran under both versions."""
    measured, other = both.measured(was, now)
    if isinstance(measured, str) or isinstance(other, str):
        why = measured if isinstance(measured, str) else str(other)
        status = Status.NOT_RUN if was.outcome is now.outcome else bare.status
        changed = bare.messages[:1] if "verdict" in bare.changed else ()
        return replace(bare, status=status, messages=(*changed, why))
    # The declared scenario is the same. If an engine's compiled values choose the states,
    # their last digits can lead to other states.
    again = replace(other, snapshot=measured.snapshot)
    diff = diff_accepted(
        both.entry(was, measured, both.before.version),
        both.entry(now, again, both.after.version),
        measured.snapshot,
        again,
    )
    messages = list(diff.messages)
    next_state = _next_state(was, now)
    messages += filter(None, [next_state])
    if _EXPLAINED.intersection(diff.changed):
        messages += _reasons(was, now, both)
    return replace(
        diff,
        folder=bare.folder,
        changed=(*diff.changed, *(("next state",) if next_state else ())),
        messages=tuple(messages),
    )


def _reasons(was: Case, now: Case, both: _Both) -> Iterator[str]:
    """Yield the reason of each version's verdict if they differ."""
    if was.reason != now.reason:
        for case, version in ((was, both.before.version), (now, both.after.version)):
            if case.reason:
                yield f"under {version}: {case.reason}"


def _next_state(was: Case, now: Case) -> str:
    """Return the change of the outcome of a single step; empty without one."""
    earlier, other = was.stepping, now.stepping
    then, present = (None if s is None else s.outcome for s in (earlier, other))
    if then is present:
        return ""
    outcomes = [o or "unknown" for o in (then, present)]
    change = " -> ".join(outcomes)
    return f"the very next state, by the engine's own rule on the equations: {change}"
