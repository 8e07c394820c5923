"""Jobs of a run: each target yields the jobs of its models in their engines."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.checks.not_run import (
    cannot_run,
    failed_case,
    not_of_a_tree,
    skipped_case,
)
from physics_crosscheck.harness.documents.elements import is_whole
from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.modelfiles.folders import syntax_problem
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import CaseId
from .model_plan import ModelPlan
from .options import Options
from .result_builder import ResultBuilder
from .target_plan import TargetPlan, placeholder_case


class Plan:
    """The plan of a run; values go to `results`.

    Args:
        options: options of the run.
        before: accepted results, if any.
        results: results of the jobs.
    """

    def __init__(self, options: Options, before: Accepted | None, results: ResultBuilder) -> None:
        self._options, self._before, self._results = options, before, results
        self._engines = engines()

    def readable(self, targets: Sequence[Path]) -> list[Path]:
        """Return the folders, and the files that may be XML; files without an end fail before a
        worker process starts for them.
        """
        kept = []
        for target in targets:
            self._results.expect(str(target), [placeholder_case(target)], complete=False)
        for target in targets:
            whole = not target.is_file() or is_whole(target)
            if not whole and (why := syntax_problem(target)):
                failure = Failure(why, "", kind="file")
                self._results.add(failed_case(placeholder_case(target), str(target), failure))
            else:
                kept.append(target)
        return kept

    def target(self, place: Path) -> Iterator[Job[Any]]:
        """Prepare a folder or a robot file, then run its models."""
        self._results.expect(str(place), [placeholder_case(place)], complete=False)
        plan = TargetPlan(place, self._options, self._results, self._before)
        yield from plan.jobs(partial(self._models, plan))

    def _models(self, target: TargetPlan) -> Iterator[Job[Any]]:
        """Yield the jobs of every model in every engine; report those that cannot run at once."""
        record, folder = target.facts.record, str(target.place)
        self._results.systems.append(record)
        files = [target.place] if target.standalone else list(model_files(target.place))
        unread = [
            (CaseId(system=record.name, model=one.model, scenario="-", engine="-"), one.reason)
            for one in files
            if isinstance(one, UnreadModel)
        ]
        bad = [one for one in unread if self._options.choice.includes(folder, one[0])]
        chosen = [
            (file, engine, cases)
            for file in files
            if not isinstance(file, UnreadModel)
            for engine in self._chosen(folder, file)
            if (cases := self._wanted(target, file, engine))
        ]
        awaited = [case for *_, cases in chosen for case in cases]
        self._results.expect(folder, [*(case for case, _ in bad), *awaited])
        for case, reason in bad:
            self._results.add(failed_case(case, folder, Failure(reason, "", kind="sidecar")))
        plans = [
            ModelPlan(target, file, engine, cases)
            for file, engine, cases in chosen
            if self._can_run(target, file, engine, cases)
        ]
        for plan in plans:
            plan.begin()
        # The numbers of a robot file are counted by the equations, once for all engines.
        every = [plan.key for plan in plans]
        for i, plan in enumerate(plans):
            counted = [plan.key] if not target.standalone else [] if i else every
            yield from plan.jobs(counted)

    def _can_run(
        self, target: TargetPlan, file: Sidecar | Path, engine: str, cases: Sequence[CaseId]
    ) -> bool:
        folder = str(target.place)
        if why := cannot_run(self._engines, engine, file):
            for case in cases:
                self._results.add(skipped_case(case, folder, why))
            return False
        bodies = target.facts.declares == "bodies"
        if bodies and isinstance(file, Sidecar) and (reason := not_of_a_tree(file)):
            for case in cases:
                failure = Failure(reason, "", kind="sidecar")
                self._results.add(failed_case(case, folder, failure))
            return False
        return True

    def _wanted(self, target: TargetPlan, file: Sidecar | Path, engine: str) -> list[CaseId]:
        """Return the requested cases of a model in an engine, in the order of the scenarios."""
        record, name = target.facts.record, model_path(file).name
        cases = [
            CaseId(system=record.name, model=name, scenario=one.name, engine=engine)
            for one in record.scenarios
        ]
        choice = self._options.choice
        return [case for case in cases if choice.includes(str(target.place), case)]

    def _chosen(self, folder: str, file: Sidecar | Path) -> list[str]:
        """Return the engines in which a model must run."""
        selection = self._options.selection
        if selection is None:
            return chosen_engines(file, self._options.engines)
        if isinstance(file, Path) and selection.models is not None:
            names = [engine.name for engine in engines_reading(file.suffix)]
        else:
            names = chosen_engines(file, self._options.engines)
        return [name for name in names if selection.includes((folder, model_path(file).name, name))]
