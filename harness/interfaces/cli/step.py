"""`crosscheck step`: the error of the time step by engine, and the step for a requested error."""

import argparse
from functools import partial
from pathlib import Path

import msgspec

from physics_crosscheck.harness.checks.time_step import choose_step
from physics_crosscheck.harness.documents.expanded import with_sources
from physics_crosscheck.harness.engines.registry import engines, engines_to_run, missing
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.records.case import StepChoice
from physics_crosscheck.harness.render.terminal.console import terminal, wrapped
from physics_crosscheck.harness.results.places import shown_path
from physics_crosscheck.harness.results.status import duration, percent
from . import arguments
from .exit_codes import AGREE, DIFFER, FAIL
from .targets import resolve_targets, warn_unknown, with_unknown


def main(options: argparse.Namespace) -> int:
    """Print a table of time steps for each robot file, by engine."""
    check_engines(options.engines)
    targets = resolve_targets(options.folders, standalone=options.standalone, model=options.model)
    warn_unknown(targets.named)
    if targets.folders:
        raise FolderError(
            f"{targets.folders[0]} is a system folder, and steps are chosen for robot files; "
            "`crosscheck run FOLDER --details` prints the steps of its motions"
        )
    choices = list[StepChoice]()
    with Workers(1, arguments.limits_of(options)) as workers:
        for file in targets.paths:
            names = options.engines or [one.name for one in engines_to_run(file.suffix)]
            choices += [_choice(workers, file, name, options) for name in names]
    if options.format == "json":
        print(msgspec.json.format(msgspec.json.encode({"rows": choices}), indent=1).decode())
    else:
        for file in targets.paths:
            _print_table(file, [one for one in choices if one.file == str(file)], options.error)
    if all(one.step is None for one in choices):
        return FAIL
    unstable = any(one.unstable for one in choices)
    return with_unknown(DIFFER if unstable else AGREE, targets.named)


def _choice(workers: Workers, file: Path, name: str, options: argparse.Namespace) -> StepChoice:
    """Return the steps in one engine, in a worker, or why it has no numbers."""
    problem = missing(engines()[name]) if engines()[name].version() is None else ""
    if not problem:
        reading = {"floating": options.floating, "model": options.model}
        task = partial(choose_step, engine=name, target=options.error, **reading)
        outcome = workers.outcome(workers.submit(task, file))
        if not isinstance(outcome, Failure):
            return outcome
        problem = with_sources(outcome.about(file))
    return StepChoice(file=str(file), engine=name, target=options.error, problem=problem)


def _print_table(file: Path, choices: list[StepChoice], target: float) -> None:
    """Print a row per engine with numbers, then what is wrong, within 80 columns."""
    rows = [("engine", "dt", "error at dt", "largest stable dt", f"dt for {100 * target:g} %")]
    for choice in choices:
        error = "unknown" if choice.problem else "unstable"
        if choice.step is not None:
            rows.append((
                choice.engine,
                duration(choice.step),
                error if choice.error is None else percent(choice.error),
                "above 0.1 s" if choice.largest_stable is None else duration(choice.largest_stable),
                "unknown" if choice.step_for is None else duration(choice.step_for),
            ))  # fmt: skip
    print(f"{shown_path(str(file))}  smooth motion from rest, 1 s")
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows if len(rows) > 1 else ():
        cells = (row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:]))
        print(f"  {'  '.join(cells)}".rstrip())
    for choice in choices:
        for text in filter(None, (choice.unstable, choice.problem)):
            print("\n".join(wrapped(f"  {choice.engine}: {text}", terminal().width)))
