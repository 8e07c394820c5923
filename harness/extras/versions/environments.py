"""Environments, one a version of an engine: made once by `venv` and `pip`, and used again.

An environment holds the engine, and what that needs and is not here or not in a version that fits;
all else is found where this program finds it, by a `.pth` file. So two versions run under the very
same code, of this package, of numpy and of scipy, and an environment takes seconds and not minutes.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
import os
import shlex
import shutil
import site
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.hold import hold
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.results.visible import visible

READY = "made-by-crosscheck.txt"
"""Written last: an environment without it is half made, and is made anew."""

_BESIDE = "packages-beside.pth"


class EnvironmentError_(RuntimeError):  # noqa: N801, N818  # the plain name is Python's own
    """An environment that can't be made or used; the message names version, reason and remedy."""


Execute = Callable[[Sequence[str]], tuple[int, str]]
"""Runs a command; returns its exit code, and what it printed."""

Tell = Callable[[str], None]
"""Shows a line to the user."""


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """A version of an engine: its name, that of its distribution, and the version's number."""

    engine: str
    distribution: str
    version: str

    @property
    def pinned(self) -> str:
        """As pip has it."""
        return f"{self.distribution}=={self.version}"

    def __str__(self) -> str:
        return f"{self.engine} {self.version}"


def execute(command: Sequence[str]) -> tuple[int, str]:
    """Run a command without a terminal to ask at."""
    done = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    return done.returncode, done.stdout


def site_folders() -> tuple[str, ...]:
    """Where this program's packages are installed."""
    user = [site.getusersitepackages()] if site.ENABLE_USER_SITE else []
    return tuple(path for path in (*site.getsitepackages(), *user) if Path(path).is_dir())


def folder_name(wanted: Requirement) -> str:
    """Of an environment, such as `engine-1.2.3-py3.11-0a1b2c3d`.

    What it depends on is in its name: the interpreter, and every package that it is to find beside
    its own. This package's code is not in it.
    """
    packages = sorted(
        f"{one.metadata['Name']}=={one.version}" for one in importlib.metadata.distributions()
    )
    text = "\n".join([sys.version, sys.prefix, *site_folders(), *packages])
    key = hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:8]
    python = f"py{sys.version_info.major}.{sys.version_info.minor}"
    return f"{wanted.distribution}-{wanted.version}-{python}-{key}"


def interpreter(place: Path) -> Path:
    """The interpreter of an environment, made or not."""
    return place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def environment(wanted: Requirement, parent: Path, tell: Tell, run: Execute = execute) -> Path:
    """The environment of a version: the one that is there, or a new one. Returns its folder.

    Args:
        wanted: the version.
        parent: folder of all environments.
        tell: is shown each command before it is run.
        run: runs them.

    Raises:
        EnvironmentError_: where it can't be made; nothing of it is left then.
        OSError: as the file system has it.
    """
    place = parent.absolute() / folder_name(wanted)
    place.parent.mkdir(parents=True, exist_ok=True)
    with _locked(place, tell):
        if (place / READY).is_file() and interpreter(place).exists():
            tell(f"{wanted}: in {visible(str(place))}")
            return place
        shutil.rmtree(place, ignore_errors=True)
        try:
            _make(wanted, place, tell, run)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
    return place


def _make(wanted: Requirement, place: Path, tell: Tell, run: Execute) -> None:
    tell(f"{wanted}: its environment is made, once:")
    python = str(interpreter(place))
    _command([sys.executable, "-m", "venv", str(place)], wanted, tell, run)
    lib = Path(sysconfig.get_path("purelib", "venv", {"base": str(place)}))
    lib.mkdir(parents=True, exist_ok=True)
    line = "; ".join(
        ["import site", *(f"site.addsitedir({json.dumps(path)})" for path in site_folders())]
    )
    tell(f"  echo {shlex.quote(line)} > {shlex.quote(str(lib / _BESIDE))}")
    (lib / _BESIDE).write_text(f"{line}\n", encoding="utf-8")
    pip = [python, "-m", "pip", "install", "--disable-pip-version-check", wanted.pinned]
    _command(pip, wanted, tell, run)
    write_whole(place / READY, f"{wanted.pinned}\n")


def _command(command: Sequence[str], wanted: Requirement, tell: Tell, run: Execute) -> None:
    """Show a command and run it.

    Raises:
        EnvironmentError_: with its last words, where it fails.
    """
    shown = shlex.join(command)
    tell(f"  {shown}")
    code, said = run(command)
    if code == 0:
        return
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")]
    last = visible((errors or lines or [f"exit code {code}"])[-1])
    raise EnvironmentError_(
        f"{wanted} can't be installed: {last}; `{sys.executable} -m pip index versions"
        f" {wanted.distribution}` lists what there is for this Python; or name an environment that"
        f" has it, {wanted.version}=path/to/venv"
    )


@contextlib.contextmanager
def _locked(place: Path, tell: Tell) -> Iterator[None]:
    """Nobody else makes this environment meanwhile."""
    with place.with_name(f"{place.name}.lock").open("a") as file:
        if not hold(file.fileno()):
            tell(f"{visible(place.name)}: another program is making it; waiting")
            hold(file.fileno(), wait=True)
        yield
