"""`crosscheck compare`: two models of one mechanism, without equations."""

from __future__ import annotations

import argparse
import datetime
import math
import sys
from pathlib import Path

from harness.cli import arguments
from harness.cli.exit_codes import AGREE, DIFFER, FAIL, USAGE
from harness.compare.candidate import CompareError, NotInstalledError, candidate
from harness.compare.compare import CompareOptions, compare
from harness.compare.execute import FailureError
from harness.compare.executor import in_workers
from harness.compare.match import declared
from harness.compare.record import comparison_record, failed_record
from harness.files.sidecar import SidecarError
from harness.records.outcome import Outcome
from harness.records.write import encoded, write_whole
from harness.schedule.workers import Workers
from harness.text.comparison import print_comparison
from harness.text.terminal import terminal

JOBS = 1
"""Worker processes: to start a second one takes longer than to ask both models in turn."""


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("a", type=Path, metavar="A", help="a model file")
    command.add_argument("b", type=Path, metavar="B", help="another, or the same before an edit")
    command.add_argument("--engine", metavar="NAME", help="engine of both")
    command.add_argument("--engine-a", metavar="NAME", help="engine of A")
    command.add_argument("--engine-b", metavar="NAME", help="engine of B")
    command.add_argument(
        "--joints",
        default="",
        metavar="a=b,...",
        help="joints of A by those of B, as hip=j1,knee=-j2",
    )
    command.add_argument(
        "--map", type=Path, metavar="FILE", help="TOML, [joints]: those of B as expressions of A's"
    )
    command.add_argument(
        "--start",
        action="append",
        default=[],
        type=_start,
        metavar="j=1,...",
        help="a state to start from, j=1,j_dot=0; repeatable",
    )
    command.add_argument(
        "--as-shipped",
        action="store_true",
        help="with contacts, limits, dry friction and couplings, which are left out otherwise",
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the record to a file")
    arguments.resolution_of(command)
    arguments.limits(command)


def main(options: argparse.Namespace) -> int:
    """Compare, print what came out, and write the record."""
    created = datetime.datetime.now(datetime.UTC)
    try:
        pair = _pair(options)
        with Workers(JOBS, arguments.limits_of(options)) as workers:
            found = comparison_record(compare(pair, in_workers(workers)), created)
    except CompareError as error:
        return _stop(str(error), USAGE)
    except (SidecarError, NotInstalledError) as error:
        return _stop(str(error), FAIL)
    except FailureError as error:
        found = failed_record(pair, error.failure, created)
    print_comparison(terminal(), found)
    if options.json:
        write_whole(options.json, encoded(found, indent=1))
        print(options.json)
    if found.outcome is Outcome.FAILED:
        return FAIL
    return AGREE if found.outcome is Outcome.AGREES else DIFFER


def _pair(options: argparse.Namespace) -> CompareOptions:
    """What is to be compared.

    Raises:
        CompareError, SidecarError, NotInstalledError: naming what is wrong.
    """
    return CompareOptions(
        a=candidate("A", options.a, options.engine_a or options.engine),
        b=candidate("B", options.b, options.engine_b or options.engine),
        joints=declared(options.joints, options.map),
        starts=tuple(options.start),
        resolution=options.resolution,
        as_shipped=options.as_shipped,
    )


def _stop(message: str, code: int) -> int:
    print(f"crosscheck: {message}", file=sys.stderr)
    return code


def _start(text: str) -> dict[str, float]:
    state = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r} is not like theta=1.5") from None
        if not math.isfinite(number):
            raise argparse.ArgumentTypeError(f"{part!r} is no state to start from")
        state[name.strip()] = number
    return state
