"""Judge the corpus of hostile inputs, and exit with 1 if an entry is wrong.

    python -m soak.corpus --jobs 2
    python -m soak.corpus --only 'sidecar/*'

`--only` selects entries by name or by `fnmatch` pattern.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from soak import argument_parser, is_selected
from soak.corpus.entries import ENTRIES
from soak.corpus.entry import CorpusEntry
from soak.corpus.judge import EntryResult

ROOT = Path(__file__).parents[2]
TIMEOUT_SECONDS = 600.0
"""Time after which a process that judges a chunk counts as hung."""


def main() -> int:
    """Judge the selected entries, and print the wrong ones with commands that repeat them."""
    options = _options()
    chosen = [entry for entry in ENTRIES.values() if is_selected(entry.name, options.only)]
    if not chosen:
        print(f"no entry matches {options.only}", file=sys.stderr)
        return 2
    began, judged = time.monotonic(), list[EntryResult]()
    with ThreadPoolExecutor(options.jobs) as threads:
        judge_some = judge_in_both_modes if options.modes else judge_chunk
        for results in threads.map(judge_some, chunks(chosen, options.chunk)):
            for result in results:
                judged.append(result)
                if result.wrong or options.verbose:
                    print(_format_result(result), flush=True)
            print(f"{len(judged)} of {len(chosen)}", file=sys.stderr, flush=True)
    print(table(judged))
    bad = sum(bool(one.wrong) for one in judged)
    print(f"{len(judged)} entries, {bad} wrong, {time.monotonic() - began:.0f} s")
    return 1 if bad else 0


def _options() -> argparse.Namespace:
    parser = argument_parser("soak.corpus", __doc__)
    parser.add_argument(
        "--only", action="append", default=[], metavar="PATTERN", help="select entries by name"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (2)")
    parser.add_argument("--chunk", type=int, default=24, help="entries in one process (24)")
    parser.add_argument("--verbose", action="store_true", help="also print right entries")
    parser.add_argument(
        "--modes", action="store_true", help="compare exit codes with `run --thorough`"
    )
    return parser.parse_args()


def chunks(entries: Iterable[CorpusEntry], size: int) -> list[list[CorpusEntry]]:
    """Group entries that may share a run, and put each slow entry into its own process."""
    groups: list[list[CorpusEntry]] = []
    for (slow, _), group in itertools.groupby(
        sorted(entries, key=lambda one: (one.slow, one.batched)),
        lambda one: (one.slow, one.batched),
    ):
        some = list(group)
        each = 1 if slow else size
        groups += [some[i : i + each] for i in range(0, len(some), each)]
    return groups


def judge_in_both_modes(entries: Sequence[CorpusEntry]) -> list[EntryResult]:
    """Judge entries with and without `--thorough`. Different exit codes are wrong."""
    thorough = {one.name: one.code for one in judge_chunk(entries, "--thorough")}
    return [
        one if one.code == (code := thorough[one.name]) else replace(
            one, wrong=(*one.wrong, f"exit code {one.code}, thorough {code}")
        )
        for one in judge_chunk(entries)
    ]  # fmt: skip


def judge_chunk(entries: Sequence[CorpusEntry], *options: str) -> list[EntryResult]:
    """Judge entries in a separate process, and those that it does not reach in other processes."""
    remaining, done = list(entries), list[EntryResult]()
    while remaining:
        results, ended = _run_chunk(remaining, *options)
        done += results
        names = {result.name for result in results}
        remaining = [entry for entry in remaining if entry.name not in names]
        if remaining and ended is None:
            ended = "it was not judged"
        if remaining and len(remaining) == len(entries) - len(done) and (not results or ended):
            # If the first remaining entry ran separately, it ended or blocked the process.
            if len(remaining) == 1 or not remaining[0].batched:
                name, wrong = remaining.pop(0).name, (ended or "",)
                done.append(EntryResult(name=name, code=None, printed="", seconds=0.0, wrong=wrong))
            else:
                for entry in remaining:
                    done += judge_chunk([entry], *options)
                remaining = []
    return done


def _run_chunk(
    entries: Sequence[CorpusEntry], *options: str
) -> tuple[list[EntryResult], str | None]:
    """Return the results of one process, and the reason if it ended early."""
    with tempfile.TemporaryDirectory(prefix="soak-chunk-", ignore_cleanup_errors=True) as folder:
        environment = os.environ | {
            "PYTHONPATH": str(ROOT),
            "TMPDIR": folder,
            "PYTHONSAFEPATH": "1",
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "soak.corpus.chunk", *options], cwd=folder, env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        ended = None
        try:
            text, _ = process.communicate(
                "\n".join(e.name for e in entries), timeout=TIMEOUT_SECONDS
            )
            if process.returncode:
                ended = f"the process that ran it ended with {process.returncode}"
        except subprocess.TimeoutExpired:
            _kill_session(process)
            text, _ = process.communicate()
            ended = f"it did not finish within {TIMEOUT_SECONDS:g} s"
        finally:
            _kill_session(process)
    judged = []
    for line in text.splitlines():
        fields = json.loads(line)
        judged.append(EntryResult(**fields | {"wrong": tuple(fields["wrong"])}))
    return judged, ended


def _kill_session(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _format_result(result: EntryResult) -> str:
    mark = "WRONG" if result.wrong else "right"
    lines = [f"{mark} {result.name}  (exit {result.code}, {result.seconds:.1f} s)"]
    lines += [f"    {sentence}" for sentence in result.wrong]
    if result.printed:
        printed = " | ".join(result.printed.splitlines())
        lines.append(f"    printed: {printed[:400]!r}")
    if result.wrong:
        lines.append(f"    python -m soak.corpus --only {shlex.quote(result.name)}")
    return "\n".join(lines)


def table(judged: Sequence[EntryResult]) -> str:
    """Return a table with the number of entries and of wrong entries for each format or command."""
    count = Counter(one.name.split("/")[0] for one in judged)
    wrong = Counter(one.name.split("/")[0] for one in judged if one.wrong)
    lines = [f"{'format or command':<20} {'entries':>8} {'wrong':>6}"]
    lines += [f"{name:<20} {count[name]:>8} {wrong[name]:>6}" for name in sorted(count)]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
