"""Plan of a target, which reuses results of earlier runs with unchanged dependencies.

A folder or a file is prepared before its cases run, and not at all if all its results are known.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import structs

from physics_crosscheck.harness.baseline.fingerprint import model_hashes
from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, Task
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from .cache import (
    CacheKey,
    Reading,
    TaskOutput,
    file_in_engine,
    key_of_file,
    key_of_folder,
    with_environment,
    with_snapshot,
)
from .model_checks import CASE, MEASUREMENT, RESULTS, ModelCheck
from .options import Options
from .prepared import Preparation, TargetFacts, task_function
from .result_builder import Jobs, ResultBuilder

Done = Callable[[Any], Jobs]
Failed = Callable[[Failure], Jobs]


class TargetPlan:
    """The plan of a run for a folder or a robot file.

    Args:
        place: the folder or the file.
        options: options of the run.
        results: results of the jobs.
        before: accepted results, if any; their cases are measured unless a selection decides.

    Attributes:
        place, options, results: as given.
        standalone: whether it is a robot file.
    """

    def __init__(
        self, place: Path, options: Options, results: ResultBuilder, before: Accepted | None = None
    ) -> None:
        self.place, self.options, self.results = place, options, results
        self.standalone = place.is_file()
        self._cache, self._before = options.cache, before
        self._facts: TargetFacts | None = None
        self._solved: bytes | None = None
        self._waiting: list[Callable[[], Job[Any]]] | None = None
        self._key: CacheKey | None = None
        self._hashes: Mapping[ModelKey, str] = {}
        if self.standalone:
            reading = structs.asdict(options.robot(place))
            self._reading = {**reading, "motion": options.motion, "smooth": options.smooth}
        else:
            self._reading = {
                "described": options.described,
                "motion": options.motion,
                **({"ideal": True} if options.ideal else {}),
            }
        if self._cache is None:
            return
        # Hash everything before running anything, so that later changes do not count.
        if self.standalone:
            self._key = key_of_file(place, self._reading)
        else:
            self._key = key_of_folder(place, self._reading)
            self._hashes = model_hashes(place, options.resolution, options.baseline)

    @property
    def facts(self) -> TargetFacts:
        """Facts about the target, once it is prepared or known."""
        assert self._facts is not None
        return self._facts

    def jobs(self, models: Callable[[], Jobs]) -> Iterator[Job[Any]]:
        """Yield the jobs of its models, after its preparation if needed."""
        facts = self._known_facts()
        if facts is None:
            yield self._preparation(models)
            return
        self._know(facts)
        self._waiting = []
        yield from models()  # jobs of the models wait
        if self._waiting:
            yield self._preparation(self._resumed)

    def _know(self, facts: TargetFacts) -> None:
        self._facts = facts
        self.results.reads[str(self.place)] = facts.reads

    def _known_facts(self) -> TargetFacts | None:
        """Return the cached facts; those with a derivation also serve if none is needed."""
        facts: TargetFacts | None = self._lookup(self._key)
        if facts is None and self._cache is not None and self._reading.get("described") is False:
            facts = self._lookup(key_of_folder(self.place, {**self._reading, "described": True}))
        return facts

    def _preparation(self, then: Callable[[], Jobs], no_motion: str = "") -> Job[Any]:
        def done(prepared: Preparation) -> Jobs:
            self._solved = prepared.solved
            if self._facts is None:
                self._know(prepared.facts)
                self._store(self._key, self._facts, {})
            return then()

        def failed(failure: Failure) -> Jobs:
            if not no_motion and (why := self._no_motion(failure)):
                return [self._preparation(then, why)]
            self.results.forget(str(self.place))
            self.results.add(failed_case(placeholder_case(self.place), str(self.place), failure))
            return ()

        reading = {**self._reading, **({"no_motion": no_motion} if no_motion else {})}
        task = Task(task_function("target", **reading), self.place)
        return Job(task=task, done=done, failed=failed)

    def _no_motion(self, failure: Failure) -> str:
        """Return why a task runs again without the motion from rest; empty if it should not."""
        limits = ("time limit", "memory limit")
        return failure.reason if self.options.motion > 0 and failure.kind in limits else ""

    def _resumed(self) -> Jobs:
        waiting, self._waiting = self._waiting or [], None
        return [make() for make in waiting]

    def do(
        self,
        check: ModelCheck,
        key: ModelKey,
        done: Done,
        failed: Failed,
        *,
        sidecar: Sidecar | None = None,
        scenario: str = "",
        snapshot: Snapshot | None = None,
    ) -> Iterator[Job[Any]]:
        """Yield the job of a model's check, unless its value is stored.

        A case that takes too long with a motion from rest runs again without.

        Args:
            check: one of `model_checks.CHECKS`.
            key: key of the model.
            done, failed: follow-up jobs, as in `Job`.
            sidecar: sidecar of a folder's model.
            scenario: scenario of a case or a measurement.
            snapshot: snapshot that a measurement repeats.
        """
        cache_key = self._cache_key(check.kind, key, scenario, snapshot)
        if (value := self._lookup(cache_key)) is not None:
            self.results.cached += check is CASE
            yield from done(value)
            return

        def job(no_motion: str = "") -> Job[Any]:
            # The checks of a robot file in an engine share a loaded model and its steps.
            subject = "" if sidecar else str(key)
            function = check.task(
                self.facts,
                engine=key[-1],
                resolution=self.options.resolution,
                sidecar=sidecar,
                scenario=scenario,
                snapshot=snapshot,
                thorough=self.options.thorough,
                no_motion=no_motion,
            )
            task = Task(function, self._solved, subject)
            # The files that a model in code reads are not known in advance.
            if cache_key is not None and Path(cache_key.model).suffix == ".py":
                task = Task(Reading(task, self.place), task.argument, subject)

            def ended(outcome: Any) -> Jobs:
                is_read = isinstance(outcome, TaskOutput)
                value, reads = (outcome.value, outcome.reads) if is_read else (outcome, {})
                seen = self.results.reads[str(self.place)]
                self.results.reads[str(self.place)] = {**seen, **reads}
                self._store(cache_key, value, reads)
                return done(value)

            def again(failure: Failure) -> Jobs:
                why = self._no_motion(failure) if check is CASE and not no_motion else ""
                return [job(why)] if why else failed(failure)

            return Job(task=task, done=ended, failed=again)

        if self._waiting is None:
            yield job()
        else:
            self._waiting.append(job)

    def measure(self, case: CaseId, sidecar: Sidecar | None) -> Jobs:
        """Measure a case, if a snapshot was accepted, or may be."""
        source = self.options.selection or self._before
        folder = str(self.place)
        snapshot = None if source is None else source.snapshot(folder, case)
        if self.options.selection is None and snapshot is None:
            return ()

        def done(value: Measurement | Failure) -> Jobs:
            self.results.measured[folder, case] = value
            return ()

        return self.do(
            MEASUREMENT,
            (folder, case.model, case.engine),
            done,
            done,
            sidecar=sidecar,
            scenario=case.scenario,
            snapshot=snapshot,
        )

    def _lookup(self, key: CacheKey | None) -> Any | None:
        if key is None or self._cache is None:
            return None
        value = self._cache.find(key, RESULTS[key.kind])
        # Ignore a case that contradicts its own numbers.
        if isinstance(value, Case) and value.contradiction(self.options.resolution):
            return None
        return value

    def _store(self, key: CacheKey | None, value: Any, reads: Mapping[str, str]) -> None:
        """Store a value, with the files that it read in addition to those of `system.py`."""
        if key is not None and self._cache is not None:
            self._cache.store(key, value, {**self.facts.reads, **reads})

    def _cache_key(
        self, kind: str, key: ModelKey, scenario: str, snapshot: Snapshot | None
    ) -> CacheKey | None:
        if self._cache is None:
            return None
        (folder, model, engine), options = key, self.options
        if self._key is not None and self.standalone:
            inputs = file_in_engine(self._key, engine, options.resolution, options.thorough)
        else:
            hashed = self._hashes.get(key, "")
            inputs = with_environment(hashed, engine, options.motion, options.thorough)
        if snapshot is not None:
            inputs = with_snapshot(inputs, snapshot)
        return CacheKey(
            kind=kind, folder=folder, model=model, engine=engine, scenario=scenario, inputs=inputs
        )


def placeholder_case(place: Path) -> CaseId:
    """Return the placeholder for all cases of a folder or robot file while they are unknown."""
    if place.is_dir():
        return CaseId(system=place.name, model="system.py", scenario="-", engine="-")
    return CaseId(system=place.stem, model=place.name, scenario="-", engine="-")
