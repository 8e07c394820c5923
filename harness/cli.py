"""The command line: `crosscheck run | report | derive | audit | mutate | engines`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from harness.folders import FolderError, system_folders
from harness.results import ResultsError, read_results, write_results
from harness.verdict import Outcome

AGREE, DIFFER, USAGE, FAIL = 0, 1, 2, 3
"""Exit codes: all agree; a difference or nothing certain; wrong usage; something could not run."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    command = {
        "run": _run, "report": _report, "derive": _derive, "audit": _audit, "mutate": _mutate,
        "engines": _engines,
    }  # fmt: skip
    try:
        return command[options.command](options)
    except (FolderError, ResultsError) as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return USAGE
    except OSError as error:
        print(f"crosscheck: {error.filename or ''}: {error.strerror}", file=sys.stderr)
        return FAIL
    except KeyboardInterrupt:
        print("crosscheck: stopped; nothing was written", file=sys.stderr)
        return FAIL


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="crosscheck",
        description="Tells whether a physics model file is right, to nine digits.",
        epilog="Exit codes: 0 every case agrees; 1 a case differs or is unresolved; 2 wrong usage;"
        " 3 a case failed.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run every model of the folders against their equations")
    run.add_argument("folders", nargs="*", metavar="FOLDER", help="system folders; none: built-in")
    run.add_argument(
        "--engine", action="append", default=[], metavar="NAME", help="only this engine; repeatable"
    )
    run.add_argument("--resolution", type=_resolution, default=1e-9, metavar="R",
                     help="relative discrepancy to resolve (1e-9)")  # fmt: skip
    run.add_argument("--jobs", type=_positive, default=0, metavar="N",
                     help="worker processes (one per processor)")  # fmt: skip
    run.add_argument("--time-limit", type=_seconds, default=120.0, metavar="S",
                     help="seconds that one case may take (120)")  # fmt: skip
    run.add_argument("--out", type=Path, default=Path("reports"), metavar="DIR",
                     help="where results.json and index.html go (reports)")  # fmt: skip
    run.add_argument("--require-engines", action="store_true",
                     help="exit 3 where an engine is not installed")  # fmt: skip
    report = commands.add_parser("report", help="HTML from results, without running anything")
    report.add_argument("results", nargs="?", type=Path, default=Path("reports/results.json"),
                        metavar="RESULTS.json")  # fmt: skip
    report.add_argument("--out", type=Path, default=None, metavar="DIR", help="beside the results")
    derive = commands.add_parser("derive", help="equations, linearization, modes and errata")
    derive.add_argument("folders", nargs="+", metavar="FOLDER")
    derive.add_argument("--latex", action="store_true", help="as LaTeX instead of text")
    audit = commands.add_parser("audit", help="no motion: literals, compiled terms, accelerations")
    audit.add_argument("folders", nargs="+", metavar="FOLDER")
    audit.add_argument("--engine", action="append", default=[], metavar="NAME")
    mutate = commands.add_parser(
        "mutate", help="what the check would catch: each literal made wrong"
    )
    mutate.add_argument("folders", nargs="+", metavar="FOLDER")
    mutate.add_argument("--engine", action="append", default=[], metavar="NAME")
    mutate.add_argument("--jobs", type=_positive, default=0, metavar="N")
    commands.add_parser("engines", help="what is installed, versions, capabilities")
    return parser


def _run(options: argparse.Namespace) -> int:
    from harness.report import write_report
    from harness.run import Options, run
    from harness.table import print_results

    _check_engines(options.engine)
    folders = system_folders(options.folders)
    wanted = Options(tuple(options.engine), options.resolution, options.jobs, options.time_limit)
    with _Watcher() as watcher:
        found = run(folders, wanted, watcher)
    write_results(options.out / "results.json", found)
    write_report(options.out / "index.html", found)
    console = Console(soft_wrap=False, width=None if sys.stdout.isatty() else 160)
    print_results(console, found)
    print(f"{options.out / 'results.json'}  {options.out / 'index.html'}")
    return exit_code(found, options.require_engines)


def exit_code(found: dict[str, Any], require_engines: bool) -> int:
    """The exit code of results; nothing run at all is a failure."""
    from harness.table import audit_findings

    outcomes = {case["outcome"] for case in found["cases"]}
    if Outcome.FAILED in outcomes or not outcomes:
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED}:
        return DIFFER
    if any(audit_findings(model) for model in found.get("models", ())):
        return DIFFER
    return AGREE


def _check_engines(names: Sequence[str]) -> None:
    from harness.engines import engines

    for name in names:
        if name not in (known := engines()):
            raise FolderError(f"no engine {name!r} is known; known are {', '.join(sorted(known))}")


def _report(options: argparse.Namespace) -> int:
    from harness.report import write_report

    found = read_results(options.results)
    out = (options.out or options.results.parent) / "index.html"
    write_report(out, found)
    print(out)
    return AGREE


def _derive(options: argparse.Namespace) -> int:
    from harness.describe import describe
    from reference.integrate import ReferenceError
    from reference.load import load_system
    from reference.system import DeclarationError

    try:
        for folder in system_folders(options.folders):
            print(describe(load_system(folder), "latex" if options.latex else "text"))
    except (DeclarationError, ReferenceError) as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    return AGREE


def _audit(options: argparse.Namespace) -> int:
    from harness.audit_text import audit_lines
    from harness.run import Options, audits

    _check_engines(options.engine)
    folders = system_folders(options.folders)
    code = AGREE
    for model in audits(folders, Options(tuple(options.engine))):
        print(f"{model['system']}/{model['model']} [{model['engine']}]")
        if model["failed"]:
            print(f"  failed   {model['failed']}")
            code = FAIL
            continue
        for text in audit_lines(model["audit"]):
            print(f"  {text}")
        if any(record["severity"] == "finding" for record in model["audit"]):
            code = max(code, DIFFER)
    return code


def _mutate(options: argparse.Namespace) -> int:
    from harness.mutate import MutationError, mutate
    from harness.mutate_text import mutation_lines
    from harness.run import Options

    _check_engines(options.engine)
    folders = system_folders(options.folders)
    try:
        with _Watcher() as watcher:
            rows = mutate(folders, Options(tuple(options.engine), jobs=options.jobs), watcher.count)
    except MutationError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    for text in mutation_lines(rows):
        print(text)
    return AGREE if all(row.verdict != "missed" for row in rows) else DIFFER


def _engines(options: argparse.Namespace) -> int:
    from harness.engines import engines

    for name, engine in sorted(engines().items()):
        version = engine.version()
        print(f"{name:<10} {version or 'not installed':<14} reads {', '.join(engine.formats)}")
        for capability in engine.capabilities:
            print(f"{'':<11}- {capability}")
    return AGREE


class _Watcher:
    """Progress: a bar at a terminal, a line a case elsewhere."""

    def __enter__(self) -> _Watcher:
        self._bar: Progress | None = None
        if sys.stderr.isatty() and not os.environ.get("CI"):
            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                TimeElapsedColumn(), console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self._task = self._bar.add_task("cases", total=None)
            self._bar.start()
        return self

    def count(self, done: int, total: int, _: object) -> None:
        """Progress without a case to tell of."""
        self(done, total, None)

    def __call__(self, done: int, total: int, case: dict[str, Any] | None) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total)
        elif case is not None:
            from harness.table import line

            print(line(done, total, case), file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is no positive number")
    return value


def _resolution(text: str) -> float:
    value = float(text)
    if not 1e-13 <= value <= 1e-2:
        raise argparse.ArgumentTypeError(f"{text} is not between 1e-13 and 1e-2")
    return value


def _seconds(text: str) -> float:
    value = float(text)
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} is no time in seconds")
    return value


if __name__ == "__main__":
    sys.exit(main())
