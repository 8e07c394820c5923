"""Judge the corpus: `python -m soak.corpus [--only PATTERN] [--jobs 2]`; exit code 1 on any fault.

`PATTERN` is an entry's name, or what `fnmatch` takes for one: `--only 'sidecar/*'`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from soak.corpus.entries import ENTRIES
from soak.corpus.entry import Entry
from soak.corpus.judge import Judged

ROOT = Path(__file__).parents[2]
CHUNK = 24
"""Entries of one process, and folders of one run at most."""

PATIENCE = 600.0
"""Seconds after which a process that judges a chunk is taken for hung."""


def main() -> int:
    """Judge, print a line a format, and each fault with what reproduces it."""
    options = _options()
    chosen = [entry for entry in ENTRIES.values() if _meant(entry.name, options.only)]
    if not chosen:
        print(f"no entry is called like {options.only}", file=sys.stderr)
        return 2
    began, judged = time.monotonic(), list[Judged]()
    with ThreadPoolExecutor(options.jobs) as threads:
        judge_some = judge_in_both_modes if options.modes else judge_chunk
        for found in threads.map(judge_some, chunks(chosen, options.chunk)):
            for one in found:
                judged.append(one)
                if one.wrong or options.verbose:
                    print(_line(one), flush=True)
            print(f"{len(judged)} of {len(chosen)}", file=sys.stderr, flush=True)
    print(table(judged))
    bad = sum(bool(one.wrong) for one in judged)
    print(f"{len(judged)} entries, {bad} wrong, {time.monotonic() - began:.0f} s")
    return 1 if bad else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m soak.corpus", description=__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="PATTERN")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--chunk", type=int, default=CHUNK, help=f"entries a process ({CHUNK})")
    parser.add_argument("--verbose", action="store_true", help="print what is right too")
    parser.add_argument("--modes", action="store_true", help="compare with `run --thorough`")
    return parser.parse_args()


def _meant(name: str, patterns: Sequence[str]) -> bool:
    return not patterns or name in patterns or any(fnmatchcase(name, p) for p in patterns)


def chunks(entries: Iterable[Entry], size: int) -> list[list[Entry]]:
    """Entries that may share a run together, slow ones each in a process of its own."""
    found: list[list[Entry]] = []
    for alike, group in itertools.groupby(
        sorted(entries, key=lambda one: (one.slow, one.batched)),
        lambda one: (one.slow, one.batched),
    ):
        some = list(group)
        each = 1 if alike[0] else size
        found += [some[i : i + each] for i in range(0, len(some), each)]
    return found


def judge_in_both_modes(entries: Sequence[Entry]) -> list[Judged]:
    """Judge entries with and without `--thorough`; another exit code is wrong."""
    thorough = {one.name: one.code for one in judge_chunk(entries, "--thorough")}
    return [
        one if one.code == (code := thorough[one.name]) else replace(
            one, wrong=(*one.wrong, f"exit code {one.code}, thorough {code}")
        )
        for one in judge_chunk(entries)
    ]  # fmt: skip


def judge_chunk(entries: Sequence[Entry], *options: str) -> list[Judged]:
    """Judge entries in a process of their own; what it does not come to, in others."""
    left, done = list(entries), list[Judged]()
    while left:
        found, ended = _process(left, *options)
        done += found
        names = {one.name for one in found}
        left = [entry for entry in left if entry.name not in names]
        if left and ended is None:
            ended = "it was not judged"
        if left and len(left) == len(entries) - len(done) and (not found or ended):
            # The first that is left is the one that ended or held up the process, if it is alone.
            if len(left) == 1 or not left[0].batched:
                done.append(_lost(left.pop(0), ended or ""))
            else:
                for entry in left:
                    done += judge_chunk([entry], *options)
                left = []
    return done


def _lost(entry: Entry, why: str) -> Judged:
    return Judged(name=entry.name, code=None, printed="", seconds=0.0, wrong=(why,))


def _process(entries: Sequence[Entry], *options: str) -> tuple[list[Judged], str | None]:
    """What one process has judged, and how it ended where that was not the end of its work."""
    with tempfile.TemporaryDirectory(prefix="soak-chunk-", ignore_cleanup_errors=True) as place:
        environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": place, "PYTHONSAFEPATH": "1"}
        process = subprocess.Popen(
            [sys.executable, "-m", "soak.corpus.chunk", *options], cwd=place, env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        ended = None
        try:
            text, _ = process.communicate("\n".join(e.name for e in entries), timeout=PATIENCE)
            if process.returncode:
                ended = f"the process that ran it ended with {process.returncode}"
        except subprocess.TimeoutExpired:
            _end(process)
            text, _ = process.communicate()
            ended = f"it was not done after {PATIENCE:g} s"
        finally:
            _end(process)
    judged = []
    for line in text.splitlines():
        fields = json.loads(line)
        judged.append(Judged(**fields | {"wrong": tuple(fields["wrong"])}))
    return judged, ended


def _end(process: subprocess.Popen[str]) -> None:
    """End what is left of a process's session."""
    import contextlib
    import signal

    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _line(one: Judged) -> str:
    mark = "WRONG" if one.wrong else "right"
    lines = [f"{mark} {one.name}  (exit {one.code}, {one.seconds:.1f} s)"]
    lines += [f"    {sentence}" for sentence in one.wrong]
    if one.printed:
        printed = " | ".join(one.printed.splitlines())
        lines.append(f"    printed: {printed[:400]!r}")
    if one.wrong:
        lines.append(f"    python -m soak.corpus --only {shlex.quote(one.name)}")
    return "\n".join(lines)


def table(judged: Sequence[Judged]) -> str:
    """A line a format or command: how many, and how many of them are wrong."""
    count = Counter(one.name.split("/")[0] for one in judged)
    wrong = Counter(one.name.split("/")[0] for one in judged if one.wrong)
    lines = [f"{'format or command':<20} {'entries':>8} {'wrong':>6}"]
    lines += [f"{name:<20} {count[name]:>8} {wrong[name]:>6}" for name in sorted(count)]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
