"""Entries run through the command line in this process, and held against what must be true.

Folders of `run` go together, many in one run, as a user would have them: what one of them does must
not touch the others. An entry of a run that was not sound as a whole is run again alone.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path

import msgspec

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.results import Results
from soak.corpus.entry import RUN, Entry
from soak.corpus.sound import sound

LONGEST = 1200
"""Characters of a sentence: what a person still reads."""

MEMORY = 12 << 30
"""Bytes of address space for everything that an entry starts: a bomb must not take the machine."""

_ELSEWHERE = "/nowhere"
"""A folder of the Python path that holds nothing."""

_PLUGINS = ("-p", "no:cacheprovider", "-p", "physics_crosscheck.pytest_plugin")
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What became of an entry; `wrong` is empty where all held."""

    name: str
    code: int | None
    printed: str
    seconds: float
    wrong: tuple[str, ...]


def judge(entries: Sequence[Entry], *options: str) -> Iterator[Judged]:
    """Judge some entries, with further options of `run`; those that may share a run do."""
    together = [entry for entry in entries if entry.batched]
    if len(together) > 1:
        yield from _together(together, *options)
    else:
        yield from (alone(entry, *options) for entry in together)
    for entry in entries:
        if not entry.batched:
            yield alone(entry, *options)


def alone(entry: Entry, *options: str) -> Judged:
    """Run one entry's command, as a person would."""
    with _workspace(entry) as place:
        if entry.first is not None:
            entry.first(place)
        for command in entry.before:
            _called(place, command)
        before = _files(place)
        entry.build(place)
        built = _files(place)
        with _without(entry.absent):
            further = options if entry.command[:1] == ("run",) else ()
            code, printed, seconds = _called(place, (*entry.command, *further))
        wrong = [*_always(code, printed), *_strays(place, built | before)]
        if entry.command[:1] == ("run",) and "@sound" in entry.command:
            code, printed, more = _of_run(place, code, printed)
            wrong += more
        wrong += _wanted(entry, code, printed)
    return Judged(name=entry.name, code=code, printed=printed, seconds=seconds, wrong=tuple(wrong))


def _together(entries: Sequence[Entry], *options: str) -> Iterator[Judged]:
    """One run of all their folders; again one by one where it is not sound as a whole."""
    with contextlib.ExitStack() as stack:
        places = [stack.enter_context(_workspace(entry)) for entry in entries]
        for entry, place in zip(entries, places, strict=True):
            entry.build(place)
        built = [_files(place) for place in places]
        folders = [str(place / "hostile") for place in places]
        command = ("run", *folders, *RUN[2:], *options)
        code, printed, seconds = _called(places[0], command)
        try:
            results = read_results(places[0] / "out" / "results.json")
        except ResultsError:
            results = None
        whole = results is not None and _sound(results) and not _dropped(places[0])
        if code is None or results is None or _always(code, printed) or not whole:
            _sweep(places[0])
            yield from (alone(entry, *options) for entry in entries)
            return
        for entry, place, before in zip(entries, places, built, strict=True):
            own, said, wrong = _subset(results, place / "hostile")
            wrong += [*_wanted(entry, own, said), *_strays(place, before)]
            yield Judged(
                name=entry.name,
                code=own,
                printed=said,
                seconds=seconds / len(entries),
                wrong=tuple(wrong),
            )


@contextlib.contextmanager
def _workspace(entry: Entry) -> Iterator[Path]:
    """A folder with `hostile/` and `sound/`, both sound so far; taken away afterwards.

    Raises:
        RuntimeError: in a checkout: what lies in the working folder is taken away.
    """
    if Path(".git").exists():
        raise RuntimeError(f"{Path.cwd()} is a checkout; work in an empty folder")
    place = Path(tempfile.mkdtemp(prefix="soak-"))
    try:
        sound(place / "hostile", entry.model)
        sound(place / "sound", "mujoco.xml")
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _called(place: Path, command: Sequence[str]) -> tuple[int | None, str, float]:
    """Exit code, what was printed, and seconds; no code where something was raised."""
    given = [_path(place, word) for word in command]
    if given[:1] == ["pytest"]:
        return _tested(place, given[1:])
    out, began = io.StringIO(), time.monotonic()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    code: int | None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = main(given)
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException as error:
        code = None
        out.write(f"raised {type(error).__name__}: {error}")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return code, out.getvalue(), time.monotonic() - began


def _tested(place: Path, given: Sequence[str]) -> tuple[int | None, str, float]:
    """The same of pytest, which is a process of its own."""
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *_PLUGINS, *given],
        cwd=place, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
    )  # fmt: skip
    return done.returncode, done.stdout, time.monotonic() - began


@contextlib.contextmanager
def _without(names: Sequence[str]) -> Iterator[None]:
    """Some packages are not to be found meanwhile."""
    if not names:
        yield
        return
    find = importlib.util.find_spec

    def found(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name in names else find(name, package)

    importlib.util.find_spec = found
    # Versions are kept for each Python path: earlier commands of this process have read them.
    sys.path.append(_ELSEWHERE)
    try:
        yield
    finally:
        sys.path.remove(_ELSEWHERE)
        importlib.util.find_spec = find


def _path(place: Path, word: str) -> str:
    """`@name/x` is a path of the workspace; `@` may follow a `=` too."""
    return re.sub(r"(^|(?<==))@", lambda _: f"{place}/", word)


def _always(code: int | None, printed: str) -> list[str]:
    """What is wrong whatever the command was."""
    wrong = []
    if code is None:
        wrong.append(f"raised: {printed[-300:]}")
    if "Traceback (most recent call last)" in printed:
        wrong.append("a traceback is printed")
    if "INTERNALERROR" in printed:
        wrong.append("pytest tells an internal error")
    return wrong


def _wanted(entry: Entry, code: int | None, printed: str) -> list[str]:
    """What is wrong with an exit code, and with what was said for it."""
    wrong = []
    if code not in entry.codes:
        wrong.append(f"exit code {code}, not {' or '.join(map(str, entry.codes))}")
    if code == 0 and 0 in entry.codes:
        return wrong
    # Where a model was judged and differs, its id and its diagnosis say which it is.
    if entry.says and code != 1 and not re.search(entry.says, printed):
        wrong.append(f"nothing matches {entry.says!r}")
    if "Traceback (most recent call last)" in printed:
        wrong.append("a traceback is printed")
    # What the command line itself was given may be repeated in full.
    given = any(len(word) > LONGEST for word in entry.command)
    long = [line for line in printed.splitlines() if len(line) > LONGEST and not given]
    if long:
        wrong.append(f"a line of {len(long[0])} characters")
    if "\x1b" in printed:
        wrong.append("codes for the terminal are passed on")
    return wrong


def _of_run(place: Path, code: int | None, printed: str) -> tuple[int | None, str, list[str]]:
    """The hostile folder's own exit code and sentences, and what is wrong with the run."""
    try:
        results = read_results(place / "out" / "results.json")
    except ResultsError as error:
        return code, printed, [f"no results: {error}"]
    wrong = [] if _sound(results) else ["the sound folder beside it does not agree"]
    own, said, further = _subset(results, place / "hostile")
    wrong += further
    if code not in (own, max(own, 0)):
        wrong.append(f"the run ends with {code}, the folder's cases with {own}")
    return own, said, wrong


def _sound(results: Results) -> bool:
    """Whether the folder beside the hostile ones agrees."""
    cases = [case for case in results.cases if case.folder.endswith("/sound")]
    return bool(cases) and all(case.outcome is Outcome.AGREES for case in cases)


def _subset(results: Results, folder: Path) -> tuple[int, str, list[str]]:
    """Exit code and sentences of one folder's cases and models, and what is wrong with these."""
    cases = tuple(case for case in results.cases if case.folder == str(folder))
    models = tuple(model for model in results.models if model.folder == str(folder))
    own = msgspec.structs.replace(results, cases=cases, models=models)
    reasons = [case.reason for case in cases if case.outcome is not Outcome.AGREES]
    wrong = [
        f"a sentence of several lines: {one[:99]!r}" for one in reasons if "\n" in str(one).strip()
    ]
    wrong += _unsaid(own)
    findings = [finding.message for model in models for finding in model.audit or ()]
    failures = [why for model in models for _, why in model.failures]
    lines = (*(str(reason) for reason in reasons), *findings, *failures)
    return exit_code(own, require_engines=False), "\n".join(lines), wrong


def _unsaid(results: Results) -> list[str]:
    """Models that agree without a word of what that covers."""
    agreeing = {c.id.of_model for c in results.cases if c.outcome is Outcome.AGREES}
    wrong = []
    for model in results.models:
        if model.id in agreeing and not model.failures:
            wrong += [f"no coverage of {model.model}"] * (model.coverage is None)
            wrong += [f"nothing of the poses of {model.model}"] * (
                model.poses is None or not (model.poses.frames or model.poses.note)
            )
    return wrong


def _files(place: Path) -> set[str]:
    """Everything below a workspace but what Python caches, by its path."""
    found = set()
    for here, folders, files in os.walk(place):
        folders[:] = [name for name in folders if name != "__pycache__"]
        found |= {str(Path(here, name).relative_to(place)) for name in (*files, *folders)}
    return found


def _strays(place: Path, known: set[str]) -> list[str]:
    """Files where none belong: beside the out folder, in the working folder, in the hostile one."""
    allowed = ("out", "baseline", "new", "og")
    new = {p for p in _files(place) - known if p.split("/")[0] not in allowed}
    here = {str(p) for p in _dropped(place)}
    _sweep(place)
    half = {p for p in _files(place) if Path(p).name.startswith(".") and p.startswith("out")}
    return [f"left behind: {name}" for name in sorted(new | here | half)]


def _dropped(place: Path) -> list[Path]:
    """What an entry has left in the working folder."""
    ours = ("soak-", "pymp-", ".", "hangs")
    return [p for p in Path.cwd().iterdir() if p != place and not p.name.startswith(ours)]


def _sweep(place: Path) -> None:
    """Take that away, so that no other entry is blamed for it."""
    for path in _dropped(place):
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
