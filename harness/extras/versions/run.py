"""Run models under several versions of an engine, each in its environment, and compare.

versions --environments--> interpreters --a process each--> runs --upgrade--> what changes

Compare the records of two versions of an engine, case by case.

A version is compared with the one before it, as the gate compares a run with accepted results: on
the segments of the earlier one, within the uncertainties of both.

Changes of models beyond their cases: linearizations, remarks and failures.
"""

from __future__ import annotations

import datetime
import os
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from msgspec.structs import replace

from physics_crosscheck.harness.baseline.classify import entry_of
from physics_crosscheck.harness.baseline.diff import diff_accepted, diff_cases
from physics_crosscheck.harness.baseline.fingerprint import dependencies
from physics_crosscheck.harness.engines.registry import distribution, engines
from physics_crosscheck.harness.extras.versions.asked import AskedVersion
from physics_crosscheck.harness.extras.versions.environments import (
    EnvironmentError_,
    Requirement,
    ShowLine,
    environment,
    interpreter,
)
from physics_crosscheck.harness.extras.versions.launch import launch
from physics_crosscheck.harness.records.base import Rows
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.diff import Changed, Diff, Status, numbers_of
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.versions import (
    EngineVersion,
    Measured,
    ModelChange,
    Repeated,
    Upgrade,
    VersionModel,
    VersionRun,
    Versions,
    VersionTask,
)
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.visible import visible

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


_CHILD = """
from physics_crosscheck.harness.extras.versions.child import main
main(*map(pathlib.Path, rest))
"""


def run_versions(
    task: VersionTask,
    versions: Sequence[AskedVersion],
    environments: Path | None,
    show_line: ShowLine,
) -> Versions:
    """Run the models under each version, and compare each version with the one before it.

    All environments are created before the first run.

    Args:
        task: the work for each version; `out` gets a folder for each.
        versions: the versions.
        environments: folder of all environments; None: the user's cache.
        show_line: shows progress to the user.

    Raises:
        EnvironmentError_: if a version is not available, or its run ended early.
        OSError: if a file can't be read or written.
    """
    began = time.perf_counter()
    created = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    engine = task.engine
    pythons = [interpreter_of(engine, version, environments, show_line) for version in versions]
    runs: list[VersionRun] = []
    interpreters = [
        EngineVersion(
            version=version.version,
            python=python,
            report=str(Path(task.out) / f"{engine}-{version.version}"),
        )
        for version, python in zip(versions, pythons, strict=True)
    ]
    for version in interpreters:
        show_line(f"{engine} {version.version} runs")
        repeated = _repeated(runs[-1:])
        this = replace(task, version=version.version, repeated=repeated, out=version.report)
        runs.append(_run(version, this))
    return Versions(
        created=created,
        engine=engine,
        resolution=task.resolution,
        seconds=time.perf_counter() - began,
        versions=tuple(interpreters),
        upgrades=tuple(upgrade(a, b, engine, task.resolution) for a, b in pairwise(runs)),
    )


def interpreter_of(
    engine: str, requested: AskedVersion, environments: Path | None, show_line: ShowLine
) -> str:
    """Return the interpreter with a version; create an environment if none exists.

    Args:
        engine: its name.
        requested: the version.
        environments: folder of all environments; None: the user's cache.
        show_line: shows each command before it runs.

    Raises:
        EnvironmentError_: if a version is not available.
        OSError: if a file can't be read or written.
    """
    if requested.place is not None:
        python = interpreter(requested.place).absolute()
        if not python.exists():
            raise EnvironmentError_(
                f"{engine} {requested.version}: {visible(str(requested.place))} is not an"
                f" environment: it has no {python.relative_to(requested.place.absolute())};"
                " `python -m venv` makes one"
            )
        return str(python)
    engine_class = engines()[engine]
    if engine_class.version() == requested.version:
        show_line(f"{engine} {requested.version}: the one that is installed here")
        return sys.executable
    wanted = Requirement(
        engine=engine, distribution=distribution(engine_class), version=requested.version
    )
    return str(interpreter(environment(wanted, environments or default_cache(), show_line)))


def _repeated(runs: Iterable[VersionRun]) -> tuple[Repeated, ...]:
    """Return the segments of the last version that the next one must repeat."""
    return tuple(
        Repeated(folder=one.folder, case=one.case, snapshot=one.measurement.snapshot)
        for run in runs
        for one in run.measured
        if one.measurement is not None
    )


def _run(version: EngineVersion, task: VersionTask) -> VersionRun:
    """Run a task in an environment, in its own process.

    Raises:
        EnvironmentError_: if it can't run, with the reason.
    """
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as scratch:
        task_file, result_file = Path(scratch) / "task.json", Path(scratch) / "found.json"
        write_whole(task_file, encoded(task))
        launch(
            task.engine, version.version, version.python, _CHILD, (str(task_file), str(result_file))
        )
        return decoded(result_file.read_bytes(), VersionRun)


def default_cache() -> Path:
    """Return the default folder of environments, in the user's cache."""
    if os.name == "nt":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "physics-crosscheck" / "environments"
