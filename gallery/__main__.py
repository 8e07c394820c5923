"""Run public robots in every installed engine, and write the results as a site.

`python -m gallery` fetches the files of `robots.toml`, runs `crosscheck run` on each, compares the
formats of each robot, and writes the site. Finished robots are kept, with the versions of program
and engines: an interrupted run continues, and other versions run again.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec

from physics_crosscheck.harness.baseline.fingerprint import versions
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.write import encoded, write_whole
from .robots import ROBOTS, SOURCE, RobotFile, robot_files
from .site import COMPARISON, VERSIONS, Done, Entry, open_questions, write_site

PROGRAM = (sys.executable, "-m", "physics_crosscheck")

DONE = "done.json"
"""Written last into the folder of a file."""


def run(file: RobotFile, path: Path, store: Path, jobs: str) -> None:
    """Run a file in every engine."""
    out = store / file.slug
    words = ["run", file.path]
    root = path.parents[len(Path(file.path).parts) - 1]
    subprocess.run(
        [*PROGRAM, *words, "--quiet", "--jobs", jobs, "--out", str(out)], cwd=root, check=False
    )
    try:
        results = read_results(out / "results.json")
    except (ResultsError, OSError) as error:
        print(f"{file.slug}: no results: {error}", flush=True)
        return
    page = out / "index.html"
    page.write_text(page.read_text("utf-8").replace(f" --out {out}", ""), "utf-8")
    command = f"crosscheck {' '.join(words)}"
    done = Done(address=file.address, versions=results.versions, command=command)
    write_whole(out / DONE, encoded(done))


def keep(words: Sequence[str], clones: Path, into: Path) -> None:
    """Keep a command and what it printed, without the lines that name places of this machine."""
    made = subprocess.run(
        [*PROGRAM, *words, "--out", str(into.parent)], cwd=clones, capture_output=True, text=True,
        check=False, errors="replace",
    )  # fmt: skip
    printed = (made.stdout or made.stderr).partition("\nReport: ")[0]
    printed = re.sub(r"(?m)^\S+==.*: its environment is made.*\n(?:  /.*\n)*", "", printed)
    write_whole(into, f"$ crosscheck {' '.join(words)}\n{printed}\n")


def kept(file: RobotFile, store: Path) -> Done | None:
    """Return the finished run of this commit of a file; None without one."""
    try:
        done = msgspec.json.decode((store / file.slug / DONE).read_bytes(), type=Done)
    except (OSError, msgspec.MsgspecError):
        return None
    return done if done.address == file.address else None


def is_current(done: Done | None) -> bool:
    """Return whether a finished run has the installed versions."""
    now = versions()
    return done is not None and all(now.get(name) == one for name, one in done.versions.items())


def main(words: Sequence[str] | None = None) -> None:
    """Run the robots that have no current result, and write the site."""
    parser = argparse.ArgumentParser(prog="python -m gallery", description=__doc__)
    parser.add_argument("name", nargs="*", help="part of a robot's title [all robots]")
    parser.add_argument("--store", type=Path, default=Path("reports/gallery"), help="results")
    parser.add_argument("--site", type=Path, default=Path("reports/gallery-site"), help="pages")
    parser.add_argument("--clones", type=Path, default=Path("reports/clones"), help="model files")
    parser.add_argument("--source", default=SOURCE, help=f"address of repositories [{SOURCE}]")
    parser.add_argument("--robots", type=Path, default=ROBOTS, help="table of robots")
    parser.add_argument(
        "--versions", nargs="+", action="append", default=[], metavar=("ENGINE", "VERSION"),
        help="compare these robots in versions of an engine",
    )  # fmt: skip
    parser.add_argument("--pages-only", action="store_true", help="run nothing")
    jobs = str(os.cpu_count() or 1)
    parser.add_argument("--jobs", default=jobs, help="worker processes [one per processor]")
    options = parser.parse_args(words)
    entries, paths, clones = [], list[str](), options.clones.resolve()
    for files in robot_files(options.name, options.robots):
        first: Path | None = None
        for file in files:
            began, folder = time.perf_counter(), options.store.resolve() / file.slug
            if not options.pages_only:
                try:
                    path = file.fetched(clones, options.source)
                except (subprocess.CalledProcessError, OSError) as error:
                    print(f"{file.slug}: not fetched: {error}", flush=True)
                    continue
                if not is_current(kept(file, options.store)):
                    shutil.rmtree(folder, ignore_errors=True)
                    run(file, path, folder.parent, options.jobs)
                if first is not None and not (folder / COMPARISON).exists():
                    both = (str(one.relative_to(clones)) for one in (first, path))
                    keep(["compare", *both], clones, folder / COMPARISON)
                first = first or path
                paths.append(str(path.relative_to(clones)))
                print(f"{file.slug}: {time.perf_counter() - began:.0f} s", flush=True)
            done = kept(file, options.store)
            if done is not None:
                results = read_results(options.store / file.slug / "results.json")
                entries.append(Entry(file=file, done=done, results=results))
    for engine, *releases in options.versions if paths else ():
        into = options.store.resolve() / VERSIONS / f"{engine}.txt"
        keep(["versions", *paths, "--engine", engine, *releases], clones, into)
    cells = write_site(options.site, options.store, entries)
    print(*open_questions(cells), options.site / "index.html", sep="\n")


if __name__ == "__main__":
    main()
