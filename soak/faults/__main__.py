"""Disturb runs with faults, and exit with 1 if a run handles one wrongly.

    python -m soak.faults --jobs 2
    python -m soak.faults --only 'signals/*' --seeds 1

`--only` selects faults by `fnmatch` pattern.
"""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor

from soak import argument_parser, is_selected
from soak.faults.models import model_faults
from soak.faults.resources import resource_faults
from soak.faults.sandbox import Fault, UndisturbedRun, sandbox, verdicts_by_case
from soak.faults.signals import signal_faults


def main() -> int:
    """Cause each selected fault, and print the results."""
    options = _options()
    # A shell starts background jobs with Ctrl-C ignored, and the runs would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    faults = [fault for fault in all_faults(options.seeds) if is_selected(fault.name, options.only)]
    began = time.monotonic()
    expected = run_undisturbed()
    with ThreadPoolExecutor(options.jobs) as threads:
        problems = list(threads.map(lambda fault: _check_fault(fault, expected), faults))
    bad = sum(map(bool, problems))
    print(f"{len(faults)} faults, {bad} wrong, {time.monotonic() - began:.0f} s")
    return 1 if bad else 0


def _options() -> argparse.Namespace:
    parser = argument_parser("soak.faults", __doc__)
    parser.add_argument(
        "--only", action="append", default=[], metavar="PATTERN", help="select faults by name"
    )
    parser.add_argument("--seeds", type=int, default=5, help="random times of each signal (5)")
    parser.add_argument("--jobs", type=int, default=1, help="faults at a time (1)")
    return parser.parse_args()


def all_faults(seeds: int) -> list[Fault]:
    """Return all faults, with each signal at `seeds` random times."""
    return [*signal_faults(seeds), *resource_faults(), *model_faults()]


def run_undisturbed() -> UndisturbedRun:
    """Return verdicts and duration of a run without a fault.

    Raises:
        RuntimeError: if the run does not agree, because no fault can be judged then.
    """
    with sandbox() as box:
        began = time.monotonic()
        result = box.run()
        seconds = time.monotonic() - began
        wrong = box.leftovers()
        if result.code or wrong:
            raise RuntimeError(
                f"the undisturbed run ends with {result.code}: {wrong} {result.output}"
            )
        return UndisturbedRun(verdicts=verdicts_by_case(box.results()), seconds=seconds)


def _check_fault(fault: Fault, expected: UndisturbedRun) -> list[str]:
    """Cause a fault, print what is wrong, and return it."""
    began = time.monotonic()
    try:
        wrong = fault.check(expected)
    except (TimeoutError, ValueError) as error:
        wrong = [str(error)]
    mark = "WRONG" if wrong else "right"
    print(f"{mark} {fault.name} ({time.monotonic() - began:.1f} s)", flush=True)
    for sentence in wrong:
        print(f"    {sentence}", flush=True)
    if wrong:
        print(f"    python -m soak.faults --only {shlex.quote(fault.name)}", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
