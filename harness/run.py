"""The way of the data, once through: folders -> reference -> engines -> verdicts -> results.

system.py --prepare--> reference motions --+
                                           +--run_case--> verdicts --> results
model files and sidecars --plan--> tasks --+
"""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.baseline.audits import mark_models
from harness.baseline.known import accepted, changes_since, mark_known
from harness.engines.registry import engines
from harness.plan import Collected, Options, Plan, Progress, Selection
from harness.records.baseline import Measurement
from harness.records.case import Case, CaseId
from harness.records.results import Results
from harness.schedule.jobs import work
from harness.schedule.workers import Failure, Workers

__all__ = ["Options", "Progress", "Run", "Selection", "run"]


@dataclass(frozen=True)
class Run:
    """What a run found.

    Attributes:
        results: all that is written.
        measured: what models do, by folder and case; empty where nothing was to be measured.
    """

    results: Results
    measured: Mapping[tuple[str, CaseId], Measurement | Failure]


def run(folders: Sequence[Path], options: Options, progress: Progress) -> Run:
    """Run every model of every folder in every scenario.

    A folder, model or case that can't be run is FAILED, with its reason; the others go on.

    Raises:
        BaselineError: for a baseline that can't be believed.
    """
    began = time.perf_counter()
    before = None
    if options.selection is None:
        before = accepted(options.baseline, folders, options.resolution, options.engines)
    found = Collected(progress)
    plan = Plan(options, {} if before is None else before.snapshots, found)
    with Workers(options.jobs or os.cpu_count() or 1, options.limit) as workers:
        work((plan.folder(folder) for folder in folders), workers)
    order = {str(folder): i for i, folder in enumerate(folders)}
    cases = mark_known(_sorted_cases(found, order), found.measured, before)
    models = mark_models(found.models.values(), {} if before is None else before.systems)
    results = Results(
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        versions=_versions(),
        resolution=options.resolution,
        seconds=time.perf_counter() - began,
        systems=tuple(sorted(found.systems, key=lambda s: order[s.folder])),
        models=tuple(sorted(models, key=lambda m: (order[m.folder], m.model, m.engine))),
        cases=cases,
        baseline=changes_since(cases, found.measured, before),
    )
    return Run(results, found.measured)


def _sorted_cases(found: Collected, order: Mapping[str, int]) -> list[Case]:
    """By folder as given, model file, engine, and scenario as declared."""
    declared = {
        (system.folder, scenario.name): i
        for system in found.systems
        for i, scenario in enumerate(system.scenarios)
    }

    def key(case: Case) -> tuple[int, str, str, int]:
        place = declared.get((case.folder, case.scenario), 0)
        return order[case.folder], case.model, case.engine, place

    return sorted(found.cases, key=key)


def _versions() -> dict[str, str | None]:
    """Of this package, Python and each engine."""
    try:
        own = importlib.metadata.version("physics-crosscheck")
    except importlib.metadata.PackageNotFoundError:
        own = "not installed"
    known = {name: engine.version() for name, engine in engines().items()}
    return {"physics-crosscheck": own, "python": platform.python_version(), **known}
