"""`crosscheck run`: compare models with their equations, and print the verdict."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL, SIGNALLED
from physics_crosscheck.harness.interfaces.cli.keeping import check_page, keep_history
from physics_crosscheck.harness.interfaces.cli.targets import (
    Targets,
    select_targets,
    warn_unknown,
    with_unknown,
)
from physics_crosscheck.harness.interfaces.cli.watch import Ran, watch
from physics_crosscheck.harness.jobs.stop import asking
from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    builtin,
    check_engines,
    system_folders,
)
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines
from physics_crosscheck.harness.modelfiles.robot_targets import models_below
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.records.journal import Journal, journal
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.results.coverage import left_out, refused
from physics_crosscheck.harness.results.github import (
    commands,
    harmless_json,
    print_commands,
    run_notes,
)
from physics_crosscheck.harness.results.sarif import sarif
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.run import Options, RunControl, run


def main(options: argparse.Namespace) -> int:
    """Run, write results and report, print the verdict."""
    check_engines(options.engine)
    if not (options.folders or options.last_failed):
        options.folders = models_below(Path())
    wanted = select_targets(options)
    if not (wanted.folders or wanted.robots):
        return AGREE
    if not options.watch:
        return _run(options, wanted, lambda results: results).code
    if options.format != "text":
        raise FolderError(f"--watch prints text, not {options.format}; leave one of both out")
    return watch(wanted, partial(_run, options))


def demo(options: argparse.Namespace) -> int:
    """Run all built-in systems."""
    options.folders = [str(folder) for folder in system_folders([str(builtin())])]
    return main(options)


def _run(options: argparse.Namespace, wanted: Targets, among: Callable[[Results], Results]) -> Ran:
    """Run once; `among` merges the results into those that stay, which are written together."""
    check_page(options.out / "index.html")
    warn_unknown(wanted.named)
    cache = None if options.cache is None else Cache(options.cache)
    run_options = Options(
        engines=tuple(options.engine),
        resolution=options.resolution,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        baseline=options.baseline,
        floating=options.floating,
        motion=options.motion,
        smooth=options.smooth,
        model=options.chosen_model,
        choice=wanted.choice,
        scheduler=options.scheduler,
        cache=cache,
        thorough=options.thorough,
    )
    with journal(options.out, resume=options.resume) as done:
        with Progress(every=options.verbose) as progress:
            with asking() as stop:
                control = RunControl(stop, done)
                ran = run(wanted.folders, run_options, progress, control, wanted.robots)
            results = ran.results
            if not (results.cases or stop.requested or run_options.choice.everything):
                done.remove()
                why = "no case has such a name, or its engine is not installed"
                raise FolderError(f"{why}; `crosscheck list` prints those that can be run")
            whole = among(results)
            progress.phase("writing the report")
            write_whole(options.out / "results.json", encoded(whole))
            past = keep_history(options.out, results, begin=options.history)
            write_report(options.out / "index.html", whole, past)
        if not stop.requested:
            done.remove()
    _print(results, options)
    _print_stopped(results, options.out, done)
    if cache is not None and cache.problem:
        print(f"crosscheck: {cache.problem}", file=sys.stderr)
    if options.verbose and run_options.choice.everything:
        _print_absent(absent_engine_lines(wanted.folders))
    if results.untested:
        print(f"crosscheck: {results.untested}", file=sys.stderr)
    code = with_unknown(exit_code(results, options.require_engines), wanted.named)
    if options.strict and (untested_parts := [*left_out(results.models), *refused(results)]):
        print(
            "\n".join(f"crosscheck: --strict: {line}" for line in untested_parts), file=sys.stderr
        )
        code = FAIL
    code = SIGNALLED + stop.number if stop.requested else code
    return Ran(whole, code, bool(stop.requested), ran.reads)


def _print(results: Results, options: argparse.Namespace) -> None:
    """Print results in the selected format."""
    if options.format == "json":
        print(harmless_json(encoded(results)), end="")
        return
    if options.format == "sarif":
        print(harmless_json(sarif(results)))
        return
    if options.format == "github":
        print_commands(note.command(Path.cwd()) for note in run_notes(results))
        return
    print_results(
        terminal(),
        results,
        quiet=options.quiet,
        details=options.details,
        report=options.out / "index.html",
    )
    print_commands(commands(run_notes(results), os.environ))


def _print_absent(lines: Sequence[str]) -> None:
    """Print in one line the named engines that are not installed."""
    if lines:
        names = ", ".join(line.partition(":")[0] for line in lines)
        how = "`crosscheck engines` prints how to install them"
        print(f"crosscheck: not installed: {names}; {how}", file=sys.stderr)


def _print_stopped(results: Results, out: Path, done: Journal) -> None:
    """Print the missing parts of an interrupted run, and how to resume it."""
    if done.problem:
        print(f"crosscheck: {done.problem}; a stopped run can't be resumed here", file=sys.stderr)
    if results.stopped:
        what = f"stopped by {results.stopped}: {counted(len(results.cases), 'case')} done and kept"
        how = f"`crosscheck run --resume --out {out}`, with the same folders, resumes the run"
        print(f"crosscheck: {what}; {how}", file=sys.stderr)


def exit_code(results: Results, require_engines: bool) -> int:
    """Return the exit code of results.

    Results without cases fail; accepted differences pass. An audit, linearization or diagnosis that
    failed counts as a failure. A robot file that one engine rejects does not, if another engine has
    a verdict.
    """
    refused = {(case.folder, case.id) for case in results.refusals}
    counting = [case for case in results.cases if (case.folder, case.id) not in refused]
    outcomes = {case.outcome for case in counting if not case.accepted}
    if outcomes & {Outcome.FAILED, Outcome.REFUSED} or not results.cases or results.untested:
        return FAIL
    if any(model.failures for model in results.models):
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED}:
        return DIFFER
    # An accepted difference includes the audit findings of its model.
    accepted = {(case.folder, case.id.of_model) for case in results.cases if case.accepted}
    models = [model for model in results.models if (model.folder, model.id) not in accepted]
    return AGREE if all(model.passes for model in models) else DIFFER
