"""Jobs of a run's system folders, their follow-up jobs, and their combined results.

A folder yields the jobs of its models. The last case of a model yields its diagnosis, if a case
differs.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.bodies_plan import BodiesModel
from physics_crosscheck.harness.planning.energies_plan import EnergiesModel
from physics_crosscheck.harness.planning.folder_plan import FolderWork
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.result_builder import Collected, stand_in
from physics_crosscheck.harness.records.case import CaseId


class Plan:
    """The plan of a run; values go to `results`.

    Args:
        options: options of the run.
        before: accepted results, if any.
        results: results of the jobs.
    """

    def __init__(self, options: Options, before: Accepted | None, results: Collected) -> None:
        self._options, self._before, self._found = options, before, results
        self._engines = engines()

    def folder(self, folder: Path) -> Iterator[Job[Any]]:
        """Prepare a folder, then run its models."""
        self._found.expect(str(folder), [stand_in(folder)])
        folder_plan = FolderWork(folder, self._options, self._before, self._found)
        yield from folder_plan.begun(partial(self._models, folder_plan))

    def _models(self, folder_plan: FolderWork) -> Iterator[Job[Any]]:
        """Yield the jobs of every model in every engine; report those that cannot run at once."""
        self._found.systems.append(folder_plan.facts.record)
        name, folder = folder_plan.facts.record.name, str(folder_plan.place)
        files = list(model_files(folder_plan.place))
        unread = [
            (CaseId(system=name, model=one.model, scenario="-", engine="-"), one.reason)
            for one in files
            if isinstance(one, UnreadModel)
        ]
        bad = [one for one in unread if self._options.choice.includes(folder, one[0])]
        chosen = [
            (sidecar, engine, cases)
            for sidecar in files
            if isinstance(sidecar, Sidecar)
            for engine in self._chosen(folder, sidecar)
            if (cases := self._wanted(folder_plan, sidecar, engine))
        ]
        awaited = [case for *_, cases in chosen for case in cases]
        self._found.expect(folder, [*(case for case, _ in bad), *awaited])
        for case, reason in bad:
            self._found.add(failed_case(case, folder, Failure(reason, "", kind="sidecar")))
        model = BodiesModel if folder_plan.facts.bodies else EnergiesModel
        for sidecar, engine, cases in chosen:
            yield from model(folder_plan, self._engines, sidecar, engine, cases).jobs()

    def _wanted(self, folder_plan: FolderWork, sidecar: Sidecar, engine: str) -> list[CaseId]:
        """Return the requested cases of a model in an engine, in the order of the declared
        scenarios.
        """
        record = folder_plan.facts.record
        cases = [
            CaseId(system=record.name, model=sidecar.model.name, scenario=one.name, engine=engine)
            for one in record.scenarios
        ]
        choice = self._options.choice
        return [case for case in cases if choice.includes(str(folder_plan.place), case)]

    def _chosen(self, folder: str, sidecar: Sidecar) -> list[str]:
        """Return the engines in which a model must run."""
        selection = self._options.selection
        return [
            engine
            for engine in chosen_engines(sidecar, self._options.engines)
            if selection is None or selection.includes((folder, sidecar.model.name, engine))
        ]
