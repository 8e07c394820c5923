"""The judge of entries, which runs their commands in this process and checks the requirements.

Many folders of `run` share one run, as a user would run them. One folder must not affect the
others. If such a run breaks a requirement as a whole, each of its entries runs again separately.
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
from soak.corpus.entry import RUN, CorpusEntry
from soak.corpus.sound import write_sound_folder

MAX_LINE_CHARACTERS = 1200
"""Longest printed line, in characters, that a person still reads."""

MEMORY_BYTES = 12 << 30
"""Limit of the address space of an entry, so that a bomb does not take the whole machine."""

_MISSING_FOLDER = "/nowhere"
"""A folder of the Python path that does not exist."""

_PLUGINS = ("-p", "no:cacheprovider", "-p", "physics_crosscheck.pytest_plugin")
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class EntryResult:
    """The result of an entry. `wrong` is empty if the entry meets all requirements."""

    name: str
    code: int | None
    printed: str
    seconds: float
    wrong: tuple[str, ...]


def judge(entries: Sequence[CorpusEntry], *options: str) -> Iterator[EntryResult]:
    """Judge entries, with further options of `run`. Batched entries share one run."""
    batched = [entry for entry in entries if entry.batched]
    if len(batched) > 1:
        yield from _judge_in_one_run(batched, *options)
    else:
        yield from (judge_separately(entry, *options) for entry in batched)
    for entry in entries:
        if not entry.batched:
            yield judge_separately(entry, *options)


def judge_separately(entry: CorpusEntry, *options: str) -> EntryResult:
    """Run one entry's command as a person would, and judge it."""
    with _workspace(entry) as workspace:
        if entry.setup is not None:
            entry.setup(workspace)
        for command in entry.before:
            _run_command(workspace, command)
        before = _list_files(workspace)
        entry.build(workspace)
        built = _list_files(workspace)
        with _without_packages(entry.absent):
            further = options if entry.command[:1] == ("run",) else ()
            code, printed, seconds = _run_command(workspace, (*entry.command, *further))
        wrong = [*_general_problems(code, printed), *_stray_files(workspace, built | before)]
        if entry.command[:1] == ("run",) and "@sound" in entry.command:
            code, printed, more = _hostile_folder_result(workspace, code, printed)
            wrong += more
        wrong += _entry_problems(entry, code, printed)
    return EntryResult(
        name=entry.name, code=code, printed=printed, seconds=seconds, wrong=tuple(wrong)
    )


def _judge_in_one_run(entries: Sequence[CorpusEntry], *options: str) -> Iterator[EntryResult]:
    """Judge entries in one run of their folders, or separately if that run breaks a requirement."""
    with contextlib.ExitStack() as stack:
        workspaces = [stack.enter_context(_workspace(entry)) for entry in entries]
        for entry, workspace in zip(entries, workspaces, strict=True):
            entry.build(workspace)
        built = [_list_files(workspace) for workspace in workspaces]
        folders = [str(workspace / "hostile") for workspace in workspaces]
        command = ("run", *folders, *RUN[2:], *options)
        code, printed, seconds = _run_command(workspaces[0], command)
        try:
            results = read_results(workspaces[0] / "out" / "results.json")
        except ResultsError:
            results = None
        whole = (
            results is not None
            and _sound_folder_agrees(results)
            and not _files_in_working_folder(workspaces[0])
        )
        if code is None or results is None or _general_problems(code, printed) or not whole:
            _clean_working_folder(workspaces[0])
            yield from (judge_separately(entry, *options) for entry in entries)
            return
        for entry, workspace, before in zip(entries, workspaces, built, strict=True):
            folder_code, sentences, wrong = _folder_result(results, workspace / "hostile")
            wrong += _entry_problems(entry, folder_code, sentences)
            wrong += _stray_files(workspace, before)
            yield EntryResult(
                name=entry.name,
                code=folder_code,
                printed=sentences,
                seconds=seconds / len(entries),
                wrong=tuple(wrong),
            )


@contextlib.contextmanager
def _workspace(entry: CorpusEntry) -> Iterator[Path]:
    """Yield a folder with sound folders `hostile/` and `sound/`, and remove it afterwards.

    Raises:
        RuntimeError: in a checkout, because files in the working folder are removed.
    """
    if Path(".git").exists():
        raise RuntimeError(f"{Path.cwd()} is a checkout; work in an empty folder")
    workspace = Path(tempfile.mkdtemp(prefix="soak-"))
    try:
        write_sound_folder(workspace / "hostile", entry.model)
        write_sound_folder(workspace / "sound", "mujoco.xml")
        yield workspace
    finally:
        shutil.rmtree(workspace, ignore_errors=True)


def _run_command(workspace: Path, command: Sequence[str]) -> tuple[int | None, str, float]:
    """Return exit code, output and seconds. A command that raised has the exit code None."""
    arguments = [_expand_path(workspace, word) for word in command]
    if arguments[:1] == ["pytest"]:
        return _run_pytest(workspace, arguments[1:])
    out, began = io.StringIO(), time.monotonic()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, hard))
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    code: int | None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = main(arguments)
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


def _run_pytest(workspace: Path, arguments: Sequence[str]) -> tuple[int | None, str, float]:
    """Return exit code, output and seconds of pytest, which runs in its own process."""
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *_PLUGINS, *arguments],
        cwd=workspace, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
    )  # fmt: skip
    return done.returncode, done.stdout, time.monotonic() - began


@contextlib.contextmanager
def _without_packages(names: Sequence[str]) -> Iterator[None]:
    """Hide some packages from `importlib` meanwhile."""
    if not names:
        yield
        return
    find = importlib.util.find_spec

    def hide_packages(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name in names else find(name, package)

    importlib.util.find_spec = hide_packages
    # Earlier commands of this process cached package versions for the previous Python path.
    sys.path.append(_MISSING_FOLDER)
    try:
        yield
    finally:
        sys.path.remove(_MISSING_FOLDER)
        importlib.util.find_spec = find


def _expand_path(workspace: Path, word: str) -> str:
    """Replace `@name` at the start of a word or after `=` by its path in the workspace."""
    return re.sub(r"(^|(?<==))@", lambda _: f"{workspace}/", word)


def _general_problems(code: int | None, printed: str) -> list[str]:
    """Return the problems that no command may cause."""
    wrong = []
    if code is None:
        wrong.append(f"raised: {printed[-300:]}")
    if "Traceback (most recent call last)" in printed:
        wrong.append("a traceback is printed")
    if "INTERNALERROR" in printed:
        wrong.append("pytest reports an internal error")
    return wrong


def _entry_problems(entry: CorpusEntry, code: int | None, printed: str) -> list[str]:
    wrong = []
    if code not in entry.codes:
        wrong.append(f"exit code {code}, not {' or '.join(map(str, entry.codes))}")
    if code == 0 and 0 in entry.codes:
        return wrong
    # If a model differs, its id and its diagnosis identify it.
    if entry.match and code != 1 and not re.search(entry.match, printed):
        wrong.append(f"nothing matches {entry.match!r}")
    if "Traceback (most recent call last)" in printed:
        wrong.append("a traceback is printed")
    # A message may repeat a long argument in full.
    has_long_argument = any(len(word) > MAX_LINE_CHARACTERS for word in entry.command)
    lengths = [len(line) for line in printed.splitlines() if len(line) > MAX_LINE_CHARACTERS]
    if lengths and not has_long_argument:
        wrong.append(f"a line of {lengths[0]} characters")
    if "\x1b" in printed:
        wrong.append("terminal escape codes are printed")
    return wrong


def _hostile_folder_result(
    workspace: Path, code: int | None, printed: str
) -> tuple[int | None, str, list[str]]:
    """Return exit code and sentences of the hostile folder, and the problems of the run."""
    try:
        results = read_results(workspace / "out" / "results.json")
    except ResultsError as error:
        return code, printed, [f"no results: {error}"]
    wrong = [] if _sound_folder_agrees(results) else ["the sound folder next to it does not agree"]
    folder_code, sentences, further = _folder_result(results, workspace / "hostile")
    wrong += further
    if code not in (folder_code, max(folder_code, 0)):
        wrong.append(f"the run ends with {code}, the folder's cases with {folder_code}")
    return folder_code, sentences, wrong


def _sound_folder_agrees(results: Results) -> bool:
    cases = [case for case in results.cases if case.folder.endswith("/sound")]
    return bool(cases) and all(case.outcome is Outcome.AGREES for case in cases)


def _folder_result(results: Results, folder: Path) -> tuple[int, str, list[str]]:
    """Return exit code and sentences of one folder's cases and models, and their problems."""
    cases = tuple(case for case in results.cases if case.folder == str(folder))
    models = tuple(model for model in results.models if model.folder == str(folder))
    subset = msgspec.structs.replace(results, cases=cases, models=models)
    reasons = [case.reason for case in cases if case.outcome is not Outcome.AGREES]
    wrong = [
        f"a sentence of several lines: {reason[:99]!r}"
        for reason in reasons
        if "\n" in str(reason).strip()
    ]
    wrong += _missing_coverage(subset)
    findings = [finding.message for model in models for finding in model.audit or ()]
    failures = [why for model in models for _, why in model.failures]
    lines = (*(str(reason) for reason in reasons), *findings, *failures)
    return exit_code(subset, require_engines=False), "\n".join(lines), wrong


def _missing_coverage(results: Results) -> list[str]:
    """Return the models that agree but lack a statement of coverage or poses."""
    agreeing = {c.id.of_model for c in results.cases if c.outcome is Outcome.AGREES}
    wrong = []
    for model in results.models:
        if model.id in agreeing and not model.failures:
            wrong += [f"no coverage of {model.model}"] * (model.coverage is None)
            wrong += [f"no poses of {model.model}"] * (
                model.poses is None or not (model.poses.frames or model.poses.note)
            )
    return wrong


def _list_files(workspace: Path) -> set[str]:
    """Return the relative paths of all files and folders in a workspace except Python's caches."""
    paths = set()
    for here, folders, files in os.walk(workspace):
        folders[:] = [name for name in folders if name != "__pycache__"]
        paths |= {str(Path(here, name).relative_to(workspace)) for name in (*files, *folders)}
    return paths


def _stray_files(workspace: Path, expected: set[str]) -> list[str]:
    """Return unexpected files in the workspace, the working folder or the out folder."""
    allowed = ("out", "baseline", "new", "og")
    new = {p for p in _list_files(workspace) - expected if p.split("/")[0] not in allowed}
    here = {str(p) for p in _files_in_working_folder(workspace)}
    _clean_working_folder(workspace)
    partial = {
        p for p in _list_files(workspace) if Path(p).name.startswith(".") and p.startswith("out")
    }
    return [f"left behind: {name}" for name in sorted(new | here | partial)]


def _files_in_working_folder(workspace: Path) -> list[Path]:
    ours = ("soak-", "pymp-", ".", "hangs")
    return [p for p in Path.cwd().iterdir() if p != workspace and not p.name.startswith(ours)]


def _clean_working_folder(workspace: Path) -> None:
    """Remove the files in the working folder, so that the next entry is not blamed for them."""
    for path in _files_in_working_folder(workspace):
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
