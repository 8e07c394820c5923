"""Plan of a system folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.baseline.inputs import inputs, with_reads_of_system
from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.jobs.graph import Task
from physics_crosscheck.harness.planning.cache import models_inputs, piece_of_folder
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.prepared import FolderFacts, task_function
from physics_crosscheck.harness.planning.result_builder import Collected, stand_in
from physics_crosscheck.harness.planning.target_plan import PlaceWork
from physics_crosscheck.harness.records.case import CaseId, ModelKey


class FolderWork(PlaceWork[FolderFacts]):
    """The plan of a run for one folder.

    Args:
        folder: the system folder.
        options: options of the run.
        before: accepted results, if any.
        results: results of the jobs.
    """

    def __init__(
        self,
        folder: Path,
        options: Options,
        before: Accepted | None,
        results: Collected,
    ) -> None:
        cache = options.cache
        key = (
            piece_of_folder(folder, described=options.described, motion=options.motion)
            if cache
            else None
        )
        super().__init__(folder, options, results, key, before)
        # Hash the folder before running anything, so that later changes do not count.
        wanted = results.keeps or cache
        hashes = inputs(folder, options.resolution, options.baseline) if wanted else {}
        self._known = models_inputs(hashes, options.motion) if wanted else {}

    @property
    def stand_in(self) -> CaseId:
        """Placeholder case of the folder: its `system.py`."""
        return stand_in(self.place)

    @property
    def reads(self) -> Mapping[str, str]:
        """States of the files that `system.py` read."""
        return self.facts.reads

    def _known_facts(self) -> FolderFacts | None:
        """Return the cached facts; those with a derivation also serve if none is needed."""
        facts = super()._known_facts()
        if facts is None and self.options.cache and not self.options.described:
            whole = piece_of_folder(self.place, described=True, motion=self.options.motion)
            facts = self._had(whole)
        return facts

    def _preparing(self) -> Task[Any, Any]:
        options = self.options
        prepare = task_function("folder", described=options.described, motion=options.motion)
        return Task(prepare, self.place)

    def _inputs(self, key: ModelKey) -> str:
        return self._known.get(key, "")

    def _inputs_of_journal(self, key: ModelKey) -> str:
        return with_reads_of_system(self._inputs(key), key, self.facts.reads)
