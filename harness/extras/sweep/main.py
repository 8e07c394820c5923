"""`crosscheck sweep`: run many cases of drawn constants, steps, integrators and engines.

Run a sweep: survey the folders, plan the cases, run them and store the rows.
"""

import argparse
import collections
import heapq
import math
import platform
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import scipy

from physics_crosscheck.harness.baseline.fingerprint import folder_files, versions
from physics_crosscheck.harness.interfaces.cli.exit_codes import (
    AGREE,
    DIFFER,
    FAIL,
    SIGNALLED,
    USAGE,
)
from physics_crosscheck.harness.interfaces.cli.report import check_page
from physics_crosscheck.harness.interfaces.cli.targets import resolve_targets, run_options
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, Task, run_jobs
from physics_crosscheck.harness.jobs.stop import Stop, asking
from physics_crosscheck.harness.modelfiles.code_reads import UNKNOWN, digest_of
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.modelfiles.parts import input_files, part_digests
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepGroup, SweepPlan, SweepRow, SweepSummary
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html.sweep import write_sweep
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Counter
from physics_crosscheck.harness.render.terminal.sweep import print_sweep, row_lines
from .case import run_block
from .factors import Design, SweepError, SweepOptions, factors
from .plan import CasePlan, SourceSurvey, plan, survey
from .planned import Block, blank
from .store import RowsError, Store, arrow, begin, done, locked_rows, plan_of, read_rows

TROUBLES, EXTREMES = 10, 3
"""Listed cases: the worst without agreement; those with the fewest digits or largest errors."""

POINTS = 2000
"""Maximum number of points in a plot; more would overlap."""


def _badness(row: SweepRow) -> float | None:
    """Rank a case that does not agree: worse outcomes and larger discrepancies are larger."""
    if row.outcome is Outcome.AGREES:
        return None
    size = row.discrepancy or 0.0
    return row.outcome.severity + size / (1 + size)


def _few_digits(row: SweepRow) -> float | None:
    return -row.digits if row.outcome is Outcome.AGREES and row.digits is not None else None


def _error(row: SweepRow) -> float | None:
    return None if row.outcome is Outcome.FAILED else row.global_error


RANKINGS = ((_badness, TROUBLES), (_few_digits, EXTREMES), (_error, EXTREMES))
"""Sizes by which the listed cases are the largest, and their numbers."""


def summary(plan: SweepPlan, rows: Iterable[SweepRow]) -> SweepSummary:
    """Summarize all rows in one pass."""
    done = steps = 0
    outcomes, digits = collections.Counter[str](), collections.Counter[str]()
    groups: dict[tuple[str, str, str], SweepGroup] = {}
    extremes: list[list[tuple[float, int, SweepRow]]] = [[] for _ in RANKINGS]
    rng = np.random.default_rng(0)
    sampled: list[SweepRow] = []
    seconds = np.zeros(4)
    for row in rows:
        done += 1
        steps += row.steps
        seconds += (row.engine_seconds, row.reference_seconds, row.loading_seconds, row.seconds)
        outcomes[row.outcome.value] += 1
        if row.outcome is Outcome.AGREES and row.digits is not None:
            digits[str(math.floor(row.digits))] += 1
        key = row.system, row.engine, row.integrator
        groups[key] = _with_row(groups.get(key), row)
        for i, (size, count) in enumerate(RANKINGS):
            if (value := size(row)) is not None:
                extremes[i] = heapq.nlargest(count, [*extremes[i], (value, -row.index, row)])
        if len(sampled) < POINTS:
            sampled.append(row)
        elif (place := int(rng.integers(done))) < POINTS:  # reservoir sampling (Vitter 1985)
            sampled[place] = row
    worst = {row.index: row for ranking in extremes for *_, row in ranking}
    engine, reference, loading, every = seconds.tolist()
    return SweepSummary(
        plan=plan,
        done=done,
        outcomes={o.value: outcomes[o.value] for o in reversed(Outcome) if outcomes[o.value]},
        digits={name: digits[name] for name in sorted(digits, key=int)},
        groups=tuple(group for _, group in sorted(groups.items())),
        worst=tuple(worst.values()),
        sampled=tuple(sorted(sampled, key=lambda row: row.index)),
        steps=steps,
        engine_seconds=engine,
        reference_seconds=reference,
        loading_seconds=loading,
        seconds=every,
    )


def _with_row(group: SweepGroup | None, row: SweepRow) -> SweepGroup:
    """Return a group with one more row; None stands for an empty one."""
    if group is None:
        group = SweepGroup(
            system=row.system, engine=row.engine, integrator=row.integrator, outcomes={}
        )
    outcomes = {**group.outcomes, row.outcome.value: group.outcomes.get(row.outcome.value, 0) + 1}
    digits = row.digits if row.outcome is Outcome.AGREES else None
    every_digits = [one for one in (group.least_digits, digits) if one is not None]
    errors = [one for one in (group.worst_error, _error(row)) if one is not None]
    return msgspec.structs.replace(
        group,
        outcomes=outcomes,
        least_digits=min(every_digits, default=None),
        worst_error=max(errors, default=None),
    )


BLOCKS_PER_WORKER = 2
"""Blocks in flight per worker: a running one and a waiting one."""

Progress = Callable[[int, int, SweepRow | None], None]
"""Called with the number of finished cases, the total, and one finished case."""


def planned(options: SweepOptions, places: Sequence[Path], workers: Executor) -> CasePlan:
    """Plan a sweep.

    Raises:
        SweepError: giving the problem, the place and the remedy.
    """
    named = [(str(place), content_of(place)) for place in places]
    surveys = list[SourceSurvey]()
    outcomes = workers.outcomes(partial(survey, options=options), named)
    for place, outcome in zip(places, outcomes, strict=True):
        if isinstance(outcome, Failure):
            raise SweepError(outcome.about(place if place.is_file() else place / "system.py"))
        surveys.append(outcome)
    return plan(options, surveys)


def plan_record(whole: CasePlan) -> SweepPlan:
    """Return the stored record of a plan."""
    options = whole.options
    plan_options = {
        "vary": "; ".join(str(one) for one in options.factors),
        "design": options.design.value,
        "draws": str(options.count),
        "seed": str(options.seed),
        "step": ", ".join(f"{step!r}" for step in options.steps),
        "integrator": ", ".join(options.integrators),
        "engine": ", ".join(options.engines),
        "scenario": ", ".join(options.scenarios),
        "resolution": repr(options.resolution),
        "thorough": str(options.thorough),
        "models": "; ".join(
            f"{part.survey.system}/{one.model} [{one.engine}] {one.integrator}"
            for part in whole.parts
            for one in part.survey.pairings
        ),
    }
    library_versions = {
        name: str(version) for name, version in versions().items() if version is not None
    }
    library_versions |= {
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "pyarrow": arrow().__version__,
    }
    library_versions["machine"] = platform.machine()
    return SweepPlan(
        command=shlex.join(options.command),
        options=plan_options,
        folders={part.survey.folder: _content_seen(part.survey) for part in whole.parts},
        versions=library_versions,
        cases=whole.count,
        constants=whole.constants,
    )


def _content_seen(survey: SourceSurvey) -> str:
    """Hash the content of a folder; rows of one whose code reads elsewhere are never of the
    same plan.
    """
    if not survey.reads:
        return survey.content
    once = time.time_ns() if UNKNOWN in survey.reads.values() else 0
    return digest_of(repr((survey.content, sorted(survey.reads.items()), once)).encode())


def content_of(place: Path) -> str:
    """Hash the content of a system folder, or of a robot file with all files that it names.

    Raises:
        SweepError: if a file can't be read.
    """
    try:
        if place.is_file():
            return digest_of(repr(sorted(part_digests(place).items())).encode())
        scan = folder_files(place)
    except OSError as error:
        raise SweepError(f"{error.filename}: can't be read: {error.strerror}") from None
    every = sorted((one.model, sorted(one.hashes.items())) for one in scan.models)
    return digest_of(repr((scan.system, every)).encode())


@dataclass
class _Running:
    """Progress of a sweep, and its next jobs."""

    blocks: Iterator[Block]
    store: Store
    progress: Progress
    done: int
    cases: int

    def next(self) -> Iterator[Job[Any]]:
        """Yield the job of the next block, if there is one."""
        block = next(self.blocks, None)
        if block is not None:
            yield self.job(block)

    def job(self, block: Block) -> Job[tuple[SweepRow, ...]]:
        """Return the job of a block; if a worker dies, its cases run one by one."""
        return Job(
            task=Task(run_block, block), done=self._store_rows, failed=partial(self._lost, block)
        )

    def _store_rows(self, rows: tuple[SweepRow, ...]) -> Iterator[Job[Any]]:
        self.store.add(rows)
        self.done += len(rows)
        self.progress(self.done, self.cases, rows[-1])
        return self.next()

    def _lost(self, block: Block, failure: Failure) -> Iterator[Job[Any]]:
        if len(block.cases) == 1:
            return self._store_rows((blank(block.cases[0], failure),))
        return map(self.job, block.single_blocks())


def sweep(
    whole: CasePlan, out: Path, workers: Executor, progress: Progress, stop: Stop | None = None
) -> int:
    """Run the planned cases without a row; return the number of rows.

    Finished rows are kept, however it ends; the same call resumes the sweep.

    Raises:
        SweepError: if the folder has rows of another plan.
        OSError: if it can't be written.
    """
    record = plan_record(whole)
    with locked_rows(out):
        begin(out, record)
        before = done(out)
        with closing(Store(out, record)) as store:
            running = _Running(whole.blocks(before), store, progress, sum(before), whole.count)
            first = [
                job for _ in range(BLOCKS_PER_WORKER * whole.options.jobs) for job in running.next()
            ]
            run_jobs(first, workers, stop)
    return running.done


def run_single(whole: CasePlan, index: int, workers: Executor) -> SweepRow:
    """Run one case now and return its row, without storing it.

    Raises:
        SweepError: if there is no such case.
    """
    block = whole.block_of(index)
    outcome = workers.outcome(workers.submit(run_block, block))
    if isinstance(outcome, Failure):
        return blank(block.cases[0], outcome)
    return outcome[0]


def main(options: argparse.Namespace) -> int:
    """Plan, run the cases without a row, and summarize the rows.

    Exit codes: 0 if every case agrees; 1 if one differs or is unresolved; 2 for an invalid sweep; 3
    if a case failed or rows are damaged.
    """
    try:
        if options.summary is not None:
            return _summary(options.summary)
        return _sweep(options)
    except SweepError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL if isinstance(error, RowsError) else USAGE


def _sweep(options: argparse.Namespace) -> int:
    check_engines(options.engines)
    if options.only is None:
        check_page(options.out / "index.html")
    targets = resolve_targets(options.folders, standalone=options.standalone)
    if targets.named.faults:
        raise FolderError("; ".join(targets.named.faults.values()))
    sweep_options = run_options(
        SweepOptions,
        options,
        factors=factors(options.vary),
        design=Design(options.design),
        jobs=options.jobs or 2,
        command=tuple(_command(options)),
        choice=targets.choice,
    )
    executing = executor(
        jobs=sweep_options.jobs,
        limits=sweep_options.limits,
        scheduler=sweep_options.scheduler,
        files=partial(input_files, targets.paths),
        engines=sweep_options.engines,
    )
    with executing as workers, asking() as stop:
        whole = planned(sweep_options, targets.paths, workers)
        for line in whole.left_out:
            print(f"crosscheck: skipped: {line}", file=sys.stderr)
        if options.only is not None:
            row = run_single(whole, options.only, workers)
            print("\n".join(row_lines(row)))
            return _code({row.outcome.value: 1})
        with Counter("case", "running") as counter:
            sweep(whole, options.out, workers, counter, stop)
    if stop.requested:
        resume = f"The same command resumes the sweep; it reuses the rows in {options.out}."
        print(f"crosscheck: stopped by {stop.name}. {resume}", file=sys.stderr)
        return SIGNALLED + stop.number
    return _summary(options.out)


def _command(options: argparse.Namespace) -> list[str]:
    """Return the normalized command line, which reproduces single cases."""
    words = ["crosscheck", "sweep", *options.folders]
    words += ["--standalone"] if options.standalone else []
    repeatable = {
        "vary": options.vary,
        "integrator": options.integrators,
        "scenario": options.scenarios,
        "engine": options.engines,
    }
    for name, given in repeatable.items():
        words += [word for one in given for word in (f"--{name}", one)]
    if options.count is not None:
        words += ["--draws", str(options.count), "--design", options.design]
        words += ["--seed", str(options.seed)]
    if options.steps:
        words += ["--step", ",".join(f"{step!r}" for step in options.steps)]
    if options.resolution != 1e-9:
        words += ["--resolution", f"{options.resolution!r}"]
    words += ["--thorough"] if options.thorough else []
    return words


def _summary(out: Path) -> int:
    check_page(out / "index.html")
    sweep_summary = summary(plan_of(out), read_rows(out))
    write_whole(out / "summary.json", encoded(sweep_summary, indent=1))
    write_sweep(out / "index.html", sweep_summary)
    print_sweep(terminal(), sweep_summary)
    print(f"Rows: {out / 'rows'}. Report: {out / 'index.html'}")
    return _code(sweep_summary.outcomes)


def _code(outcomes: dict[str, int]) -> int:
    if outcomes.get(Outcome.FAILED) or outcomes.get(Outcome.REFUSED) or not outcomes:
        return FAIL
    return DIFFER if outcomes.keys() - {Outcome.AGREES.value} else AGREE
