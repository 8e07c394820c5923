"""`crosscheck list`: print the cases of a run without running any."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from physics_crosscheck.harness.checks.listed import listed
from physics_crosscheck.harness.interfaces.cli.below import models_below
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, USAGE
from physics_crosscheck.harness.modelfiles.choice import Choice, chosen_models, matching
from physics_crosscheck.harness.modelfiles.folders import check_engines, named_folders
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible


def main(options: argparse.Namespace) -> int:
    """Print a name a line; returns 2 where a folder can't be listed."""
    check_engines(options.engine)
    matching(options.words)
    names, models = chosen_models(options.folders or models_below(Path.cwd()))
    choice = Choice(models=models, words=options.words)
    named = named_folders(names)
    found = listed(named.folders, options.engine)
    cases = [(folder, case) for folder, case in found.cases if choice.includes(folder, case)]
    if options.format == "json":
        rows = [
            {
                "folder": folder,
                "system": case.system,
                "model": case.model,
                "scenario": case.scenario,
                "engine": case.engine,
            }
            for folder, case in cases
        ]
        print(json.dumps(rows, indent=1))
    else:
        for _, case in cases:
            print(visible(str(case)))
        print(counted(len(cases), "case"), file=sys.stderr)
    faults = (*named.faults.values(), *found.faults)
    for fault in faults:
        print(f"crosscheck: {fault}", file=sys.stderr)
    return USAGE if faults or not cases else AGREE
