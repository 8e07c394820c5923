"""Checks of every robot file in folders: `python -m campaigns.real_models FOLDER...`.

The campaign prints a line per case at once, and tables of all results; see the README.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import time
from pathlib import Path

from campaigns.real_models.check import FileCheck, digest_of
from campaigns.real_models.entry import FileEntry, append_entry, read_entries
from campaigns.real_models.files import included_paths, robot_files
from campaigns.real_models.packages import FOLDERS, folder_of
from campaigns.real_models.summary import case_lines, summary
from physics_crosscheck.harness.jobs.graph import run_jobs
from physics_crosscheck.harness.jobs.workers import Limits, Workers


def folders_of(names: list[str]) -> list[Path]:
    """Return folders and files from paths and names of packages.

    Raises:
        SystemExit: if a name is not a path or an installed package.
    """
    folders = []
    for name in names or sorted(FOLDERS):
        folder = Path(name) if Path(name).exists() else folder_of(name)
        if folder is None and names:
            sys.exit(f"{name}: no such file, folder or installed package with models")
        if folder is None:
            print(f"{name}: not installed; skipped its models", flush=True)
            continue
        folders.append(folder)
    return folders


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.real_models", description=__doc__)
    parser.add_argument(
        "folder", nargs="*", help=f"folder, file or package: {', '.join(FOLDERS)} [all packages]"
    )
    parser.add_argument("--jobs", type=int, default=0, help="workers [one per processor]")
    parser.add_argument("--resolution", type=float, default=1e-9)
    parser.add_argument(
        "--limit",
        type=float,
        default=Limits.seconds,
        help=f"processor seconds per task [{Limits.seconds:g}]",
    )
    parser.add_argument("--floating", action="store_true", help="free the root links of URDFs")
    parser.add_argument(
        "--kept", type=Path, default=Path("real_models.jsonl"),
        help="file of results, to resume [real_models.jsonl]",
    )  # fmt: skip
    parser.add_argument("--again", metavar="PATTERN", help="run matching lines again; '' for all")
    parser.add_argument(
        "--no-causes", action="store_true", help="skip the diagnosis of differences"
    )
    parser.add_argument(
        "--tables", action="store_true", help="print only the tables of stored results"
    )
    return parser.parse_args()


def is_done(file: Path, entry: FileEntry | None, again: str | None) -> bool:
    """Return whether a file has a stored result and need not run again."""
    if entry is None or entry.digest != digest_of(file):
        return False
    return again is None or not re.search(again, "\n".join(case_lines(entry)))


def main() -> None:
    """Print a line per case, and the tables."""
    options = arguments()
    files = [file for folder in folders_of(options.folder) for file in robot_files(folder)]
    files = list(dict.fromkeys(files))
    done = dict(read_entries(options.kept))
    pending = [file for file in files if not is_done(file, done.get(str(file)), options.again)]
    pending = [] if options.tables else pending
    began, count = time.perf_counter(), 0

    def report(entry: FileEntry) -> None:
        nonlocal count
        count += 1
        done[entry.file] = entry
        append_entry(options.kept, entry)
        progress = f"{count}/{len(pending)}, {time.perf_counter() - began:.0f} s"
        for line in case_lines(entry):
            print(f"[{progress}] {line}", flush=True)

    for stop in (signal.SIGTERM, signal.SIGINT):  # background jobs of a shell ignore SIGINT
        signal.signal(stop, signal.default_int_handler)
    try:
        with Workers(options.jobs or os.cpu_count() or 1, Limits(seconds=options.limit)) as workers:
            settings = options.resolution, options.floating, report
            checks = [FileCheck(f, *settings, causes=not options.no_causes) for f in pending]
            run_jobs([check.job for check in checks], workers)
    except KeyboardInterrupt:
        print(f"interrupted; {options.kept} has the results so far", flush=True)
    entries = [done[str(file)] for file in files if str(file) in done]
    print(f"\n{summary(entries, included_paths(files))}")


if __name__ == "__main__":
    main()
