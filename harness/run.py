"""One pass of the data: folders -> reference -> engines -> verdicts -> results.

system.py --prepare--> reference motions --+
                                           +--run_case--> verdicts --> results
model files and sidecars --plan--> tasks --+
"""

import datetime
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

from msgspec.structs import replace

from physics_crosscheck.harness.baseline.fingerprint import versions
from physics_crosscheck.harness.baseline.known import (
    Accepted,
    accepted,
    changes_since,
    mark_known,
    mark_models,
)
from physics_crosscheck.harness.documents.expanded import relocated
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import run_jobs
from physics_crosscheck.harness.jobs.stop import Stop
from physics_crosscheck.harness.modelfiles.parts import input_files
from physics_crosscheck.harness.planning.options import Options, Selection
from physics_crosscheck.harness.planning.plan import Plan
from physics_crosscheck.harness.planning.result_builder import Progress, ResultBuilder
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.baseline import Measurement, RobotOptions
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results

__all__ = ["Options", "Progress", "Run", "Selection", "run"]


@dataclass(frozen=True)
class Run:
    """The result of a run.

    Attributes:
        results: all results to write.
        measured: measurements by folder and case; empty if none was requested.
        reads: states of the files that each folder's code read, by name relative to it.
    """

    results: Results
    measured: Mapping[tuple[str, CaseId], Measurement | Failure]
    reads: Mapping[str, Mapping[str, str]]


def run(
    folders: Sequence[Path],
    options: Options,
    progress: Progress,
    stop: Stop | None = None,
    robots: Sequence[Path] = (),
) -> Run:
    """Run every model of every folder in every scenario, and robot files at sampled states.

    A folder, model or case that cannot run is FAILED with its reason; the others continue. After a
    request to stop, return the finished and the remaining cases.

    Raises:
        BaselineError: for an invalid baseline.
        ClusterError: for a cluster that cannot be used.
    """
    began = time.perf_counter()
    before = None
    if options.selection is None:
        before = accepted(
            options.baseline,
            (*folders, *robots),
            options.resolution,
            options.engines,
            RobotOptions(floating=options.floating, model=options.model),
        )
    stop = stop or Stop()
    builder = ResultBuilder(progress)
    plan = Plan(options, before, builder)
    readable = plan.readable((*folders, *robots))
    with executor(
        jobs=options.jobs,
        limits=options.limits,
        scheduler=options.scheduler,
        files=partial(input_files, (*folders, *robots)),
        engines=options.engines,
        prestart=options.cache is None and bool(readable or not robots),
        derives=bool(folders),
    ) as workers:
        run_jobs(chain.from_iterable(map(plan.target, readable)), workers, stop)
    places = (*folders, *robots)
    order = {str(place): i for i, place in enumerate(places)}
    sorted_cases = _sorted_cases(builder, order)
    if len(places) > 1:
        sorted_cases = list(map(_props_skipped, sorted_cases))
    if any(case.whole_step and case.whole_step.touches for case in sorted_cases):
        # The import takes the equations with it.
        from physics_crosscheck.harness.checks.shared_contacts import with_shared_contacts

        sorted_cases = with_shared_contacts(sorted_cases)
    cases = mark_known(sorted_cases, builder.measured, before)
    models = mark_models(builder.models.values(), before)
    results = Results(
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        versions=versions(),
        resolution=options.resolution,
        seconds=time.perf_counter() - began,
        systems=tuple(sorted(builder.systems, key=lambda s: order[s.folder])),
        models=tuple(sorted(models, key=lambda m: (order[m.folder], m.model, m.engine))),
        cases=cases,
        baseline=None if stop.requested else _changes(cases, builder.measured, before, options),
        stopped=stop.name if stop.requested else "",
        not_run=tuple(case for _, case in builder.remaining),
        cached=builder.cached,
        optional=tuple(name for name, engine in engines().items() if engine.extra),
    )
    return Run(relocated(results, SourceLine), builder.measured, builder.reads)


def _props_skipped(case: Case) -> Case:
    """Return a case as it is, but skipped if it stands for a scene in which nothing moves."""
    if case.kind != "no joint":
        return case
    return replace(case, outcome=Outcome.ABSENT, reason="no joint moves, and no mass is free")


def _changes(
    cases: tuple[Case, ...],
    measured: Mapping[tuple[str, CaseId], Measurement | Failure],
    before: Accepted | None,
    options: Options,
) -> BaselineChanges | None:
    """Return the changes since the baseline; cases outside of the selection are not gone."""
    builder = changes_since(cases, measured, before)
    if builder is None or options.choice.everything:
        return builder
    kept = tuple(change for change in builder.changes if change.status is not Status.GONE)
    return replace(builder, changes=kept)


def _sorted_cases(builder: ResultBuilder, order: Mapping[str, int]) -> list[Case]:
    """Sort cases by folder as given, model file, engine, and scenario as declared."""
    declared = {
        (system.folder, scenario.name): i
        for system in builder.systems
        for i, scenario in enumerate(system.scenarios)
    }

    def key(case: Case) -> tuple[int, str, str, int]:
        place = declared.get((case.folder, case.scenario), 0)
        return order[case.folder], case.model, case.engine, place

    return sorted(builder.cases, key=key)
