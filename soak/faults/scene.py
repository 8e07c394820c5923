"""A run in a place of its own, and what must hold whatever happened to it."""

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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.results import Results
from soak.corpus.sound import write_sound_folder

ROOT = Path(__file__).parents[2]
LONGEST = 300.0
"""Seconds after which a run is taken for hung."""

GRACE = 15.0
"""Seconds in which what a run has started must be gone after it."""

_MARK = "SOAK_SCENE"


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a process ended, and what it printed."""

    code: int
    stdout: str
    stderr: str

    @property
    def told(self) -> str:
        """All of it."""
        return self.stdout + self.stderr


@dataclass(frozen=True)
class Scene:
    """A place with sound folders, an out folder and a folder for temporary files.

    Attributes:
        mark: what the environment of every process of this scene holds.
    """

    place: Path
    mark: str = field(default_factory=lambda: uuid.uuid4().hex)

    @property
    def out(self) -> Path:
        """Where results go."""
        return self.place / "out"

    @property
    def temporary(self) -> Path:
        """What the processes take for the folder of temporary files."""
        return self.place / "tmp"

    def folders(self) -> list[str]:
        """The system folders, in order."""
        return [str(path.parent) for path in sorted(self.place.glob("*/system.py"))]

    def command(self, *further: str) -> list[str]:
        """The run of all folders."""
        own = ["run", *self.folders(), "--out", str(self.out), "--jobs", "2"]
        own += ["--baseline", str(self.place / "baseline")]
        return [sys.executable, "-m", "physics_crosscheck", *own, *further]

    def environment(self) -> dict[str, str]:
        """What makes a process one of this scene."""
        kept = {k: v for k, v in os.environ.items() if k not in ("CI", "GITHUB_ACTIONS")}
        return kept | {
            "PYTHONPATH": str(ROOT),
            "TMPDIR": str(self.temporary),
            _MARK: self.mark,
        }

    def start(self, command: Sequence[str] | None = None, **streams: int) -> subprocess.Popen[str]:
        """Start a run, in a session of its own as a terminal would."""
        given: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process: subprocess.Popen[str] = subprocess.Popen(
            list(command or self.command()),
            cwd=self.place,
            env=self.environment(),
            stdin=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
            errors="replace",
            **given | streams,
        )
        return process

    def begun(self, process: subprocess.Popen[str]) -> None:
        """Wait until it hears signals: before, they are the interpreter's, which is starting."""
        caught = 1 << (signal.SIGTERM - 1)
        until = time.monotonic() + GRACE
        while process.poll() is None and time.monotonic() < until:
            with contextlib.suppress(OSError):
                status = Path(f"/proc/{process.pid}/status").read_text("ascii")
                if int(status.partition("SigCgt:")[2].split()[0], 16) & caught:
                    return
            time.sleep(0.02)

    def run(self, *further: str) -> Ended:
        """A run from its beginning to its end."""
        return self.ended(self.start(self.command(*further)))

    def ended(self, process: subprocess.Popen[str], patience: float = LONGEST) -> Ended:
        """Wait for its end.

        Raises:
            TimeoutError: where it does not end; it is killed.
        """
        try:
            stdout, stderr = process.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            self.end()
            process.communicate()
            raise TimeoutError(f"it was not done after {patience:g} s") from None
        return Ended(code=process.returncode, stdout=stdout or "", stderr=stderr or "")

    def processes(self) -> list[int]:
        """Every process of this scene that lives."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != os.getpid():
                with contextlib.suppress(OSError):
                    mine = f"{_MARK}={self.mark}".encode() in (entry / "environ").read_bytes()
                    if mine and "Z (zombie)" not in (entry / "status").read_text("utf-8"):
                        found.append(int(entry.name))
        return sorted(found)

    def end(self) -> None:
        """Kill what lives of this scene."""
        for process in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def results(self) -> Results | None:
        """What was written; None where nothing was.

        Raises:
            ResultsError: where it is there and broken.
        """
        path = self.out / "results.json"
        return read_results(path) if path.exists() else None

    def left_behind(self) -> list[str]:
        """What must not be there after a run: processes, temporary files, half a file."""
        until = time.monotonic() + GRACE
        while (wrong := self._left()) and time.monotonic() < until:
            time.sleep(0.2)
        return wrong

    def _left(self) -> list[str]:
        wrong = [f"process {_called(one)} lives" for one in self.processes()]
        wrong += [f"{path.name} is left in TMPDIR" for path in self.temporary.iterdir()]
        if self.out.is_dir():
            hidden = [path for path in self.out.iterdir() if path.name.startswith(".")]
            wrong += [f"{path.name} is left in the out folder" for path in hidden]
        try:
            self.results()
        except ResultsError as error:
            wrong.append(f"results are broken: {error}")
        return wrong


def _called(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode()[:120]
    return str(process)


@contextlib.contextmanager
def scene(folders: int = 2, models: Sequence[str] = ("mujoco.xml",)) -> Iterator[Scene]:
    """A place with so many sound folders; taken away with all that lives of it."""
    place = Path(tempfile.mkdtemp(prefix="soak-scene-"))
    made = Scene(place)
    try:
        made.temporary.mkdir()
        for number in range(folders):
            write_sound_folder(place / f"sound_{number}", *models)
        yield made
    finally:
        made.end()
        shutil.rmtree(place, ignore_errors=True)


Verdicts = Mapping[tuple[str, str], tuple[Outcome, float | None]]
"""Outcome and discrepancy of each case, by its folder's name and its id."""


def verdicts(results: Results | None) -> Verdicts:
    """Those of some results; none where there are none."""
    return {
        (Path(case.folder).name, str(case.id)): (
            case.outcome,
            None if case.verdict is None else case.verdict.discrepancy,
        )
        for case in (() if results is None else results.cases)
    }


@dataclass(frozen=True, kw_only=True)
class Undisturbed:
    """What a run of the scene's folders comes to when nothing happens to it, and how long it takes.

    Attributes:
        seconds: by the clock: signals come within them.
    """

    verdicts: Verdicts
    seconds: float

    def of(self, folder: str) -> Verdicts:
        """The verdicts of one folder."""
        return {case: value for case, value in self.verdicts.items() if case[0] == folder}


def told_wrong(ended: Ended) -> list[str]:
    """What a person must never see."""
    wrong = []
    if "Traceback (most recent call last)" in ended.told:
        last = [line for line in ended.told.splitlines() if line.strip()][-1]
        wrong.append(f"a traceback is told: {last[:200]}")
    for word in ("leaked", "resource_tracker", "BrokenPipeError", "Exception ignored"):
        if word in ended.told:
            wrong.append(f"{word!r} is told")
    return wrong
