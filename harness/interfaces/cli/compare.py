"""`crosscheck compare`: compare two models of one mechanism, without equations."""

import argparse
import datetime
import sys

from physics_crosscheck.harness.commands.compare.candidate import (
    CompareError,
    FailureError,
    NotInstalledError,
    UnreadableModelError,
    candidates,
)
from physics_crosscheck.harness.commands.compare.compare import (
    CompareOptions,
    compare,
    failed_comparison,
)
from physics_crosscheck.harness.commands.compare.match import declared
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html.comparison import write_comparison
from physics_crosscheck.harness.render.terminal.comparison import print_comparison
from physics_crosscheck.harness.render.terminal.console import print_hint, print_text, terminal
from physics_crosscheck.harness.results.messages import explain_hint
from physics_crosscheck.harness.results.places import shown_path
from . import arguments
from .exit_codes import AGREE, DIFFER, FAIL, USAGE
from .report import check_page

JOBS = 1
"""Worker processes; starting a second one takes longer than running both models in turn."""


def main(options: argparse.Namespace) -> int:
    """Compare, print the result, and write the record."""
    created = datetime.datetime.now(datetime.UTC)
    try:
        check_page(options.out / "compare.html")
        pair = _pair(options)
        with Workers(JOBS, arguments.limits_of(options)) as workers:
            record = compare(pair, workers, created)
    except (SidecarError, NotInstalledError, UnreadableModelError) as error:
        return _stop(str(error), FAIL)
    except CompareError as error:
        return _stop(str(error), USAGE)
    except FailureError as error:
        record = failed_comparison(pair, error.failure, created)
    page = options.out / "compare.html"
    write_comparison(page, record)
    console = terminal()
    print_comparison(console, record, details=options.details)
    print_text(console, f"Report: {shown_path(page)}")
    if options.json:
        write_whole(options.json, encoded(record, indent=1))
        print(options.json)
    print_hint(console, explain_hint([record.code]))
    if record.outcome is Outcome.FAILED:
        return FAIL
    if record.strict and record.compared is not None:
        for line in record.compared.untested:
            print(f"crosscheck: --strict: {line}", file=sys.stderr)
    return AGREE if record.passes else DIFFER


def _pair(options: argparse.Namespace) -> CompareOptions:
    """Return the comparison that the options select.

    Raises:
        CompareError, SidecarError, NotInstalledError, UnreadableModelError: giving the problem.
    """
    requested = options.engine_a or options.engine, options.engine_b or options.engine
    a, b = candidates((options.a, options.b), requested, floating=options.floating)
    return CompareOptions(
        a=a,
        b=b,
        joints=declared(options.joints, options.map),
        starts=tuple(options.start),
        resolution=options.resolution,
        include_constraints=options.include_constraints,
        strict=options.strict,
        pictured=True,
    )


def _stop(message: str, code: int) -> int:
    print(f"crosscheck: {message}", file=sys.stderr)
    return code
