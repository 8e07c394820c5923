"""Faults while running: `python -m soak.faults [--only PATTERN] [--seeds 5]`; exit 1 on any."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatchcase

from soak.faults.fault import Fault
from soak.faults.models import models
from soak.faults.resources import resources
from soak.faults.scene import Undisturbed, scene, verdicts
from soak.faults.signals import signals


def main() -> int:
    """Bring every fault about and print what was wrong then."""
    options = _options()
    # A shell's background job ignores Ctrl-C, and so would the runs.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    faults = [fault for fault in every(options.seeds) if _meant(fault.name, options.only)]
    began = time.monotonic()
    expected = undisturbed()
    with ThreadPoolExecutor(options.jobs) as threads:
        found = list(threads.map(lambda fault: _told(fault, expected), faults))
    bad = sum(map(bool, found))
    print(f"{len(faults)} faults, {bad} wrong, {time.monotonic() - began:.0f} s")
    return 1 if bad else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m soak.faults", description=__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="PATTERN")
    parser.add_argument("--seeds", type=int, default=5, help="random times of each signal (5)")
    parser.add_argument("--jobs", type=int, default=1, help="faults at once (1)")
    return parser.parse_args()


def _meant(name: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(name, p) for p in patterns)


def every(seeds: int) -> list[Fault]:
    """All faults, signals at so many random times each."""
    return [*signals(seeds), *resources(), *models()]


def undisturbed() -> Undisturbed:
    """What a run of the scene's folders comes to.

    Raises:
        RuntimeError: where it does not agree: nothing can be judged then.
    """
    with scene() as one:
        began = time.monotonic()
        ended = one.run()
        seconds = time.monotonic() - began
        wrong = one.left_behind()
        if ended.code or wrong:
            raise RuntimeError(f"the undisturbed run ends with {ended.code}: {wrong} {ended.told}")
        return Undisturbed(verdicts=verdicts(one.results()), seconds=seconds)


def _told(fault: Fault, expected: Undisturbed) -> list[str]:
    """Bring a fault about; what is wrong, printed."""
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
