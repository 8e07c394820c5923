"""Compare the records of two versions of an engine, case by case.

A version is compared with the one before it, as the gate compares a run with accepted results: on
the segments of the earlier one, within the uncertainties of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from physics_crosscheck.harness.baseline.changes import Difference, Status, compare
from physics_crosscheck.harness.baseline.entry import entry_of
from physics_crosscheck.harness.baseline.fingerprint import dependencies
from physics_crosscheck.harness.baseline.movement import apart, of_equations, of_model
from physics_crosscheck.harness.extras.versions.models import changed_models
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.versions import (
    CaseChange,
    Measured,
    Upgrade,
    VersionCase,
    VersionRun,
)

_WORST_FIRST: tuple[CaseChange, ...] = (
    "not compared", "fails", "loads", "verdict", "limit", "equations", "discrepancy",
    "step cost", "next state",
)  # fmt: skip


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
        cases=tuple(sorted(cases, key=_worst_first)),
        models=tuple(changed_models(before, after)),
    )


def _worst_first(case: VersionCase) -> tuple[int, float]:
    rank = min((_WORST_FIRST.index(kind) for kind in case.kinds), default=len(_WORST_FIRST))
    return rank, -(case.apart or 0.0)


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


def _case(was: Case | None, now: Case | None, both: _Both) -> VersionCase:
    """Return the change of a case that at least one version has."""
    named = _named(was, now)
    bare = VersionCase(
        system=named.system,
        model=named.model,
        scenario=named.scenario,
        engine=both.engine if named.engine == "-" else named.engine,
        folder=named.folder,
        before=None if was is None else was.outcome,
        after=None if now is None else now.outcome,
        global_error_before=_global_error(was),
        global_error_after=_global_error(now),
    )
    if unrun := _unrun(was, now, both):
        kind, messages = unrun
        return replace(bare, kinds=(kind,), messages=messages)
    assert was is not None
    assert now is not None
    return _compared(bare, was, now, both)


def _named(was: Case | None, now: Case | None) -> Case:
    """Return the case with the more specific name."""
    cases = [case for case in (now, was) if case is not None]
    return next((case for case in cases if case.scenario != "-"), cases[0])


def _global_error(case: Case | None) -> float | None:
    return None if case is None or case.full_run is None else case.full_run.global_error


def _unrun(
    was: Case | None, now: Case | None, both: _Both
) -> tuple[CaseChange, tuple[str, ...]] | None:
    """Return the change if one or both could not run; None if both ran."""
    before, after = both.before.version, both.after.version
    bad = [
        f"under {version} {_why(case)}"
        for case, version in ((was, before), (now, after))
        if case is None or not case.outcome.is_run
    ]
    if not bad:
        return None
    if len(bad) == 2:
        alike = was is not None and now is not None and was.reason == now.reason
        reasons = (f"under both {_why(now)}",) if alike else tuple(bad)
        return "not compared", reasons
    gone = now is None or not now.outcome.is_run
    return ("fails" if gone else "loads"), tuple(bad)


def _why(case: Case | None) -> str:
    return "there is no such case" if case is None else f"it is {case.outcome}: {case.reason}"


@dataclass(frozen=True, kw_only=True)
class _JudgedPair:
    """Two versions of a case that both were judged and measured.

    Attributes:
        then: the earlier one as an entry of a baseline.
        measured: measurement under the earlier one.
        again: measurement under the later one, also on the same segments.
        difference: difference of the two, as the gate computes it.
    """

    then: AcceptedCase
    measured: Measurement
    again: Measurement
    difference: Difference


def _compared(bare: VersionCase, was: Case, now: Case, both: _Both) -> VersionCase:
    result = _judged_pair(was, now, both)
    if isinstance(result, str):
        if was.outcome is not now.outcome:
            change = f"{now.outcome} where it was {was.outcome}"
            return replace(bare, kinds=("verdict",), messages=(change, result))
        return replace(bare, kinds=("not compared",), messages=(result,))
    kinds = list(_kinds(bare, result))
    messages = list(result.difference.messages)
    if change := _next_state(was, now):
        kinds.append("next state")
        messages.append(change)
    if "verdict" in kinds or "step cost" in kinds:
        messages += _reasons(was, now, both)
    here = result.again.on_accepted
    distance = None if here is None else apart(result.then, result.measured.snapshot, here)
    return replace(
        bare,
        kinds=tuple(kinds),
        messages=tuple(messages),
        apart=None if distance is None else distance.size,
        uncertainty=None if distance is None else distance.uncertainty,
    )


def _judged_pair(was: Case, now: Case, both: _Both) -> _JudgedPair | str:
    """Return both versions of a case, or why they can't be compared."""
    measured, other = both.measured(was, now)
    if isinstance(measured, str):
        return measured
    if isinstance(other, str):
        return other
    # The declared scenario is the same. If an engine's compiled values choose the states,
    # their last digits can lead to other states.
    again = replace(other, snapshot=measured.snapshot)
    then = both.entry(was, measured, both.before.version)
    present = both.entry(now, again, both.after.version)
    difference = compare(then, present, measured.snapshot, again)
    return _JudgedPair(then=then, measured=measured, again=again, difference=difference)


def _kinds(bare: VersionCase, pair: _JudgedPair) -> Iterator[CaseChange]:
    """Yield the changes of a case that was judged and measured under both."""
    here, snapshot = pair.again.on_accepted, pair.measured.snapshot
    has_change = False
    if bare.before is not bare.after:
        has_change = True
        yield "verdict"
    if here is not None and of_model(pair.then, snapshot, here):
        has_change = True
        yield "limit"
    if here is None or of_equations(snapshot, here):
        has_change = True
        yield "equations"
    if has_change or pair.difference.status not in (Status.CHANGED, Status.IMPROVED):
        return
    yield "step cost" if "numbers" in pair.difference.kinds else "discrepancy"


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
