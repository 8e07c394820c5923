"""Every robot of some folders, read and checked: `python -m campaigns.real_models FOLDER...`.

Prints a line a case as it comes, and tables of what became of all; see the README.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import time
from pathlib import Path

from campaigns.real_models.check import Check, digest_of
from campaigns.real_models.entry import Entry, keep, kept
from campaigns.real_models.files import included, robot_files
from campaigns.real_models.packages import FOLDERS, folder_of
from campaigns.real_models.summary import line, summary
from physics_crosscheck.harness.jobs.graph import run_jobs
from physics_crosscheck.harness.jobs.workers import Limits, Workers


def folders_of(names: list[str]) -> list[Path]:
    """Folders and files as they are given, and those of packages by their names.

    Raises:
        SystemExit: for what is neither.
    """
    found = []
    for name in names or sorted(FOLDERS):
        folder = Path(name) if Path(name).exists() else folder_of(name)
        if folder is None and names:
            sys.exit(f"{name}: no file or folder, and no package with models that is installed")
        if folder is None:
            print(f"{name}: not installed; its models are left out", flush=True)
            continue
        found.append(folder)
    return found


def arguments() -> argparse.Namespace:
    """Of the command line."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.real_models", description=__doc__)
    parser.add_argument(
        "folder", nargs="*", help=f"or a package: {', '.join(FOLDERS)}; none: all of these"
    )
    parser.add_argument("--jobs", type=int, default=0, help="workers; 0: as many as processors")
    parser.add_argument("--resolution", type=float, default=1e-9)
    parser.add_argument("--limit", type=float, default=Limits.seconds, help="seconds a task")
    parser.add_argument("--floating", action="store_true", help="the roots of URDFs move freely")
    parser.add_argument(
        "--kept", type=Path, default=Path("real_models.jsonl"),
        help="what is done is written there, and is not done again",
    )  # fmt: skip
    parser.add_argument(
        "--again", metavar="PATTERN", help="do those again whose line has this; '' for all"
    )
    parser.add_argument(
        "--no-causes", action="store_true", help="do not look for what explains a difference"
    )
    parser.add_argument("--told", action="store_true", help="the tables alone, of what is done")
    return parser.parse_args()


def is_done(file: Path, entry: Entry | None, again: str | None) -> bool:
    """Whether nothing is left to be done of a file."""
    if entry is None or entry.digest != digest_of(file):
        return False
    return again is None or not re.search(again, "\n".join(line(entry)))


def main() -> None:
    """Print a line a case, and the tables."""
    options = arguments()
    files = [file for folder in folders_of(options.folder) for file in robot_files(folder)]
    files = list(dict.fromkeys(files))
    done = dict(kept(options.kept))
    left = [one for one in files if not is_done(one, done.get(str(one)), options.again)]
    left = [] if options.told else left
    began, count = time.perf_counter(), 0

    def told(entry: Entry) -> None:
        nonlocal count
        count += 1
        done[entry.file] = entry
        keep(options.kept, entry)
        for one in line(entry):
            print(f"[{count}/{len(left)}, {time.perf_counter() - began:.0f} s] {one}", flush=True)

    for end in (signal.SIGTERM, signal.SIGINT):  # a shell's job in the background ignores the last
        signal.signal(end, signal.default_int_handler)
    try:
        with Workers(options.jobs or os.cpu_count() or 1, Limits(seconds=options.limit)) as workers:
            how = options.resolution, options.floating, told
            jobs = [Check(one, *how, causes=not options.no_causes).job for one in left]
            run_jobs(jobs, workers)
    except KeyboardInterrupt:
        print(f"stopped; {options.kept} has what is done", flush=True)
    entries = [done[str(file)] for file in files if str(file) in done]
    print(f"\n{summary(entries, included(files))}")


if __name__ == "__main__":
    main()
