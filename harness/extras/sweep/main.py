"""`crosscheck sweep`: run many cases of drawn constants, steps, integrators and engines."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from physics_crosscheck.harness.extras.sweep.draws import Design
from physics_crosscheck.harness.extras.sweep.factors import SweepError, factors
from physics_crosscheck.harness.extras.sweep.plan import SweepOptions
from physics_crosscheck.harness.extras.sweep.run import (
    Wanted,
    make_executor,
    planned,
    run_single,
    sweep,
)
from physics_crosscheck.harness.extras.sweep.store import RowsError, plan_of, read_rows
from physics_crosscheck.harness.extras.sweep.summary import summary
from physics_crosscheck.harness.extras.sweep.versions import under_versions
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import (
    AGREE,
    DIFFER,
    FAIL,
    SIGNALLED,
    USAGE,
)
from physics_crosscheck.harness.interfaces.cli.keeping import check_page
from physics_crosscheck.harness.interfaces.cli.targets import resolve_targets
from physics_crosscheck.harness.jobs.stop import Stop, asking
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html.sweep import write_sweep
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Counter
from physics_crosscheck.harness.render.terminal.sweep import print_sweep, row_lines

JOBS = 2


def main(options: argparse.Namespace) -> int:
    """Plan, run the cases without a row, and summarize the rows.

    Exit codes: 0 if every case agrees; 1 if one differs or is unresolved; 2 for an invalid sweep; 3
    if a case failed or rows are damaged.
    """
    try:
        if options.summary is not None:
            return _summary(options.summary)
        if options.versions:
            return under_versions(options, _command(options))
        return _sweep(options)
    except SweepError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL if isinstance(error, RowsError) else USAGE


def _sweep(options: argparse.Namespace) -> int:
    check_engines(options.engine)
    if options.only is None:
        check_page(options.out / "index.html")
    wanted = _wanted(options)
    sweep_options = _sweep_options(options)
    with make_executor(sweep_options, wanted) as workers, asking() as stop:
        whole = planned(sweep_options, wanted, workers)
        for line in whole.left_out:
            print(f"crosscheck: skipped: {line}", file=sys.stderr)
        if options.only is not None:
            row = run_single(whole, options.only, workers)
            print("\n".join(row_lines(row)))
            return _code({row.outcome.value: 1})
        with Counter("case", "running") as counter:
            sweep(whole, options.out, workers, counter, stop)
    return _stopped(stop, options.out) or _summary(options.out)


def _stopped(stop: Stop, out: Path) -> int:
    """Return the exit code of an interrupted sweep; 0 if it finished."""
    if not stop.requested:
        return 0
    resume = f"The same command resumes the sweep; it reuses the rows in {out}."
    print(f"crosscheck: stopped by {stop.name}. {resume}", file=sys.stderr)
    return SIGNALLED + stop.number


def _wanted(options: argparse.Namespace) -> Wanted:
    """Return the selected folders, models and robot files."""
    targets = resolve_targets(options.folders, standalone=options.standalone)
    if targets.named.faults:
        raise FolderError("; ".join(targets.named.faults.values()))
    return Wanted(places=[*targets.folders, *targets.robots], models=dict(targets.choice.models))


def _sweep_options(options: argparse.Namespace) -> SweepOptions:
    return SweepOptions(
        factors=factors(options.vary),
        design=Design(options.design),
        count=options.draws,
        seed=options.seed,
        steps=options.step,
        integrators=tuple(options.integrator),
        engines=tuple(options.engine),
        scenarios=tuple(options.scenario),
        resolution=options.resolution,
        jobs=options.jobs or JOBS,
        limits=arguments.limits_of(options),
        scheduler=options.scheduler,
        command=tuple(_command(options)),
    )


def _command(options: argparse.Namespace) -> list[str]:
    """Return the normalized command line, which reproduces single cases."""
    words = ["crosscheck", "sweep", *options.folders]
    words += ["--standalone"] if options.standalone else []
    for name in ("vary", "integrator", "scenario", "engine"):
        for value in getattr(options, name):
            words += [f"--{name}", value]
    if options.draws is not None:
        words += ["--draws", str(options.draws), "--design", options.design]
        words += ["--seed", str(options.seed)]
    if options.step:
        words += ["--step", ",".join(f"{step!r}" for step in options.step)]
    if options.resolution != 1e-9:
        words += ["--resolution", f"{options.resolution!r}"]
    if options.under:
        words += ["--versions", *options.under]
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
