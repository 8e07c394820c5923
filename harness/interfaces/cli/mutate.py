"""`crosscheck mutate`: plant faults in models, and report which ones the check detects."""

import argparse
import sys

from physics_crosscheck.harness.commands.mutation.mutate import mutate
from physics_crosscheck.harness.commands.mutation.survey import MutationError
from physics_crosscheck.harness.commands.mutation.text import mutation_lines, summary
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutations
from physics_crosscheck.harness.records.results import nothing_tested
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Counter
from .exit_codes import AGREE, DIFFER, FAIL
from .targets import resolve_targets, run_options


def main(options: argparse.Namespace) -> int:
    """Plant every known fault in each model of the targets, and print the results.

    Exit codes: 0; 1 if a fault that affects motions was missed, or another time step was reported
    as a fault; 3 if an unmodified model fails, or no fault could be tested.
    """
    check_engines(options.engines)
    targets = resolve_targets(options.folders, standalone=options.standalone, model=options.model)
    if targets.named.faults:
        raise FolderError("; ".join(targets.named.faults.values()))
    missing = [
        name
        for name, engine in engines().items()
        if engine.version() is None and (not options.engines or name in options.engines)
    ]
    for name in missing:
        print(f"crosscheck: {name} is not installed, so its models are skipped", file=sys.stderr)
    skipped: list[str] = []
    try:
        with Counter("fault", "planting") as counter:
            chosen = run_options(Options, options, choice=targets.choice, jobs=options.jobs or 2)
            rows = mutate(targets.paths, chosen, counter, skipped.append)
    except MutationError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    for sentence in skipped:
        print(f"crosscheck: skipped an engine: {sentence}", file=sys.stderr)
    if not rows:
        nothing = "no fault was tried: none of these models runs in a chosen engine"
        print(f"crosscheck: {nothing_tested(missing) if missing else nothing}", file=sys.stderr)
        return FAIL
    for text in mutation_lines(rows, terminal().width):
        print(text)
    if options.json is not None:
        mutations = Mutations(summary=summary(rows), rows=tuple(rows))
        write_whole(options.json, encoded(mutations, indent=1))
    missed = any(row.verdict is FaultVerdict.MISSED for row in rows)
    alarmed = any(
        row.kind is FaultKind.NONE and row.verdict is not FaultVerdict.AGREES for row in rows
    )
    return DIFFER if missed or alarmed else AGREE
