"""`crosscheck compare`: two models of one mechanism, without equations."""

from __future__ import annotations

import argparse
import datetime
import json
import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from harness.cli import arguments
from harness.cli.exit_codes import AGREE, DIFFER, FAIL, USAGE
from harness.compare.candidate import CompareError, NotInstalledError, side
from harness.compare.compare import CompareOptions, FailureError, compare
from harness.compare.executor import in_workers
from harness.compare.match import declared
from harness.compare.text import failed_record, print_comparison, record
from harness.files.sidecar import SidecarError
from harness.records.outcome import Outcome
from harness.records.results import write_whole
from harness.schedule.workers import Workers
from harness.text.table import STYLES

JOBS = 2
"""Worker processes: both models are asked in turn, and differences of the files two at a time."""


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
    command.add_argument("--json", type=Path, metavar="FILE", help="write the record to a file")
    arguments.limits(command)


def main(options: argparse.Namespace) -> int:
    """Compare, print what came out, and write the record."""
    created = datetime.datetime.now(datetime.UTC)
    try:
        wish = CompareOptions(
            side("A", options.a, options.engine_a or options.engine),
            side("B", options.b, options.engine_b or options.engine),
            declared(options.joints, options.map),
            tuple(options.start),
            options.resolution,
        )
    except CompareError as error:
        return _stop(str(error), USAGE)
    except (SidecarError, NotInstalledError) as error:
        return _stop(str(error), FAIL)
    console = Console(soft_wrap=False, width=None if sys.stdout.isatty() else 160)
    try:
        with Workers(JOBS, options.time_limit) as workers:
            found = compare(wish, in_workers(workers))
    except CompareError as error:
        return _stop(str(error), USAGE)
    except FailureError as error:
        failure = error.failure
        console.print(f"[{STYLES['FAILED']}]FAILED[/]  {escape(failure.reason)}", soft_wrap=True)
        for line in failure.stdout.splitlines()[-6:]:
            console.print(f"  | {escape(line)}", soft_wrap=True)
        if options.json:
            _write(options.json, failed_record(wish, failure, created))
        return FAIL
    print_comparison(console, found)
    if options.json:
        _write(options.json, record(found, created))
    return AGREE if found.judgement.outcome is Outcome.AGREES else DIFFER


def _stop(message: str, code: int) -> int:
    print(f"crosscheck: {message}", file=sys.stderr)
    return code


def _write(path: Path, found: dict[str, object]) -> None:
    write_whole(path, json.dumps(found, allow_nan=False, indent=1) + "\n")
    print(path)


def _start(text: str) -> dict[str, float]:
    state = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            state[name.strip()] = float(value)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r} is not like theta=1.5") from None
    return state
