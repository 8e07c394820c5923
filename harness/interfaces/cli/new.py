"""`crosscheck new`: create a commented folder that runs, from a model file if one is given."""

import argparse
import sys
from pathlib import Path

from physics_crosscheck.harness.commands.scaffold.folder import (
    NewError,
    check_name,
    example,
    write_folder,
)
from physics_crosscheck.harness.results.visible import visible
from .exit_codes import AGREE, FAIL, USAGE


def main(options: argparse.Namespace) -> int:
    """Write the folder; print its files and the next commands."""
    target = Path(options.name)
    try:
        check_name(target)
    except NewError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return USAGE
    try:
        if options.source is None:
            write_folder(target, example(target.name))
        else:
            # Reading a model needs sympy and engines; the example needs neither.
            from physics_crosscheck.harness.commands.scaffold.from_model import from_model

            remarks = from_model(
                options.source, target, floating=options.floating, chosen=options.model
            )
            for remark in remarks:
                print(f"note: {remark}", file=sys.stderr)
    except NewError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    for path in sorted(target.iterdir()):
        print(visible(str(path)))
    print(f"\nnext: crosscheck run {target}\n      crosscheck derive {target}")
    return AGREE
