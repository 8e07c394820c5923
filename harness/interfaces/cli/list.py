"""`crosscheck list`: print the cases of a run without running any."""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

from msgspec.structs import asdict

from physics_crosscheck.harness.checks.declared import listed
from physics_crosscheck.harness.modelfiles.choice import matching
from physics_crosscheck.harness.modelfiles.folders import check_engines
from physics_crosscheck.harness.modelfiles.robot_targets import models_below
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible
from .exit_codes import AGREE, USAGE
from .targets import resolve_targets


def main(options: argparse.Namespace) -> int:
    """Print one name per line; return 2 if a target can't be listed."""
    check_engines(options.engines)
    matching(options.words)
    names = options.folders or models_below(Path())
    targets = resolve_targets(names, standalone=options.standalone, model=options.model)
    choice = replace(targets.choice, words=options.words)
    reading = {"floating": options.floating, "model": options.model}
    every, unlisted = listed(targets.paths, options.engines, **reading)
    cases = [(folder, case) for folder, case in every if choice.includes(folder, case)]
    if options.format == "json":
        rows = [{"folder": folder, **asdict(case)} for folder, case in cases]
        print(json.dumps(rows, indent=1))
    else:
        for _, case in cases:
            print(visible(str(case)))
        print(counted(len(cases), "case"), file=sys.stderr)
    faults = (*targets.named.faults.values(), *unlisted)
    for fault in faults:
        print(f"crosscheck: {fault}", file=sys.stderr)
    return USAGE if faults or not cases else AGREE
