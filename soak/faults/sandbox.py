"""A run in its own folder, and the requirements that it must meet after every fault."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.results import Results
from soak.corpus.sound import write_sound_folder

ROOT = Path(__file__).parents[2]
TIMEOUT_SECONDS = 300.0
"""Time after which a run counts as hung."""

GRACE_SECONDS = 15.0
"""Time within which every process and file of a run must be gone after its end."""

_MARK = "SOAK_SANDBOX"


@dataclass(frozen=True, kw_only=True)
class ProcessResult:
    """The exit code and the output of a process."""

    code: int
    stdout: str
    stderr: str

    @property
    def output(self) -> str:
        """The text of both streams."""
        return self.stdout + self.stderr


@dataclass(frozen=True)
class Sandbox:
    """A folder with sound folders, an out folder and a folder for temporary files.

    Attributes:
        folder: the parent of these folders.
        mark: value in the environment of every process of this sandbox.
    """

    folder: Path
    mark: str = field(default_factory=lambda: uuid.uuid4().hex)

    @property
    def out(self) -> Path:
        """The folder for results."""
        return self.folder / "out"

    @property
    def temporary(self) -> Path:
        """The folder that the processes use for temporary files."""
        return self.folder / "tmp"

    def folders(self) -> list[str]:
        """Return the system folders, sorted by path."""
        return [str(path.parent) for path in sorted(self.folder.glob("*/system.py"))]

    def command(self, *further: str) -> list[str]:
        """Return the command that runs all folders."""
        arguments = ["run", *self.folders(), "--out", str(self.out), "--jobs", "2"]
        arguments += ["--baseline", str(self.folder / "baseline")]
        arguments += ["--cache", str(self.folder / "cache")]
        return [sys.executable, "-m", "physics_crosscheck", *arguments, *further]

    def environment(self) -> dict[str, str]:
        """Return the environment that marks a process as part of this sandbox."""
        kept = {k: v for k, v in os.environ.items() if k not in ("CI", "GITHUB_ACTIONS")}
        return kept | {"PYTHONPATH": str(ROOT), "TMPDIR": str(self.temporary), _MARK: self.mark}

    def start(self, command: Sequence[str] | None = None, **streams: int) -> subprocess.Popen[str]:
        """Start a run in its own session, as a terminal would."""
        given: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process: subprocess.Popen[str] = subprocess.Popen(
            list(command or self.command()),
            cwd=self.folder,
            env=self.environment(),
            stdin=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
            errors="replace",
            **given | streams,
        )
        return process

    def wait_until_ready(self, process: subprocess.Popen[str]) -> None:
        """Wait until the run handles signals. Until then, the starting interpreter handles them."""
        caught = 1 << (signal.SIGTERM - 1)
        until = time.monotonic() + GRACE_SECONDS
        while process.poll() is None and time.monotonic() < until:
            with contextlib.suppress(OSError):
                status = Path(f"/proc/{process.pid}/status").read_text("ascii")
                if int(status.partition("SigCgt:")[2].split()[0], 16) & caught:
                    return
            time.sleep(0.02)

    def run(self, *further: str) -> ProcessResult:
        """Run all folders to the end."""
        return self.wait(self.start(self.command(*further)))

    def wait(
        self, process: subprocess.Popen[str], timeout: float = TIMEOUT_SECONDS
    ) -> ProcessResult:
        """Wait for the end of a process.

        Raises:
            TimeoutError: if it does not end in time. All processes are killed then.
        """
        try:
            stdout, stderr = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            self.kill_all()
            process.communicate()
            raise TimeoutError(f"it did not finish within {timeout:g} s") from None
        return ProcessResult(code=process.returncode, stdout=stdout or "", stderr=stderr or "")

    def processes(self) -> list[int]:
        """Return the ids of all living processes of this sandbox."""
        numbers = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != os.getpid():
                with contextlib.suppress(OSError):
                    mine = f"{_MARK}={self.mark}".encode() in (entry / "environ").read_bytes()
                    if mine and "Z (zombie)" not in (entry / "status").read_text("utf-8"):
                        numbers.append(int(entry.name))
        return sorted(numbers)

    def kill_all(self) -> None:
        """Kill all living processes of this sandbox."""
        for process in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def results(self) -> Results | None:
        """Return the results that the run wrote, or None if it wrote none.

        Raises:
            ResultsError: if the file is broken.
        """
        path = self.out / "results.json"
        return read_results(path) if path.exists() else None

    def leftovers(self) -> list[str]:
        """Return what a run must not leave behind: processes, temporary files, partial files."""
        until = time.monotonic() + GRACE_SECONDS
        while (wrong := self._find_leftovers()) and time.monotonic() < until:
            time.sleep(0.2)
        return wrong

    def _find_leftovers(self) -> list[str]:
        wrong = [f"process {_command_line(process)} lives" for process in self.processes()]
        wrong += [f"{path.name} is left in TMPDIR" for path in self.temporary.iterdir()]
        if self.out.is_dir():
            hidden = [path for path in self.out.iterdir() if path.name.startswith(".")]
            wrong += [f"{path.name} is left in the out folder" for path in hidden]
        try:
            self.results()
        except ResultsError as error:
            wrong.append(f"results are broken: {error}")
        return wrong


def _command_line(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode()[:120]
    return str(process)


@contextlib.contextmanager
def sandbox(folders: int = 2, models: Sequence[str] = ("mujoco.xml",)) -> Iterator[Sandbox]:
    """Yield a sandbox with some sound folders, then kill its processes and remove it."""
    folder = Path(tempfile.mkdtemp(prefix="soak-sandbox-"))
    box = Sandbox(folder)
    try:
        box.temporary.mkdir()
        for number in range(folders):
            write_sound_folder(folder / f"sound_{number}", *models)
        yield box
    finally:
        box.kill_all()
        shutil.rmtree(folder, ignore_errors=True)


Verdicts = Mapping[tuple[str, str], tuple[Outcome, float | None]]
"""Outcome and discrepancy of each case, by the name of its folder and its id."""


def verdicts_by_case(results: Results | None) -> Verdicts:
    """Return the verdicts in some results. Without results the mapping is empty."""
    return {
        (Path(case.folder).name, str(case.id)): (
            case.outcome,
            None if case.verdict is None else case.verdict.discrepancy,
        )
        for case in (() if results is None else results.cases)
    }


@dataclass(frozen=True, kw_only=True)
class UndisturbedRun:
    """Verdicts and duration of a run of the same folders without a fault.

    Attributes:
        seconds: elapsed time of the run. Signals are sent within this time.
    """

    verdicts: Verdicts
    seconds: float

    def verdicts_of(self, folder: str) -> Verdicts:
        """Return the verdicts of one folder."""
        return {case: value for case, value in self.verdicts.items() if case[0] == folder}


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault during a run.

    Attributes:
        check: given an undisturbed run of the same folders, returns what is wrong.
    """

    name: str
    check: Callable[[UndisturbedRun], list[str]]


def output_problems(result: ProcessResult) -> list[str]:
    """Return the parts of the output that a user must never see."""
    wrong = []
    if "Traceback (most recent call last)" in result.output:
        last = [line for line in result.output.splitlines() if line.strip()][-1]
        wrong.append(f"a traceback is printed: {last[:200]}")
    for word in ("leaked", "resource_tracker", "BrokenPipeError", "Exception ignored"):
        if word in result.output:
            wrong.append(f"{word!r} is printed")
    return wrong
