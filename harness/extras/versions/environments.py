"""Environments, one per version of an engine, created once by uv or pip and reused.

An environment holds the engine and those dependencies that are missing here or have an unsuitable
version. A `.pth` file adds all other packages of this program. Two versions therefore run with the
same code of this package, numpy and scipy, and creating an environment takes seconds.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import importlib.util
import json
import os
import re
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
"""Written last: an environment without it is incomplete and is created again."""

_PATH_FILE = "packages-beside.pth"


class EnvironmentError_(RuntimeError):  # noqa: N801, N818  # the plain name is Python's own
    """An error in creating or using an environment; gives version, reason and remedy."""


Execute = Callable[[Sequence[str]], tuple[int, str]]
"""Runs a command; returns its exit code and its output."""

ShowLine = Callable[[str], None]
"""Shows a line to the user."""


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """A version of an engine: its name, the name of its distribution, and the version number."""

    engine: str
    distribution: str
    version: str

    @property
    def pinned(self) -> str:
        """Requirement in pip's syntax."""
        return f"{self.distribution}=={self.version}"

    def __str__(self) -> str:
        return f"{self.engine} {self.version}"


def execute(command: Sequence[str]) -> tuple[int, str]:
    """Run a command without a terminal for prompts."""
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
    """Return the folders of this program's packages."""
    user = [site.getusersitepackages()] if site.ENABLE_USER_SITE else []
    return tuple(path for path in (*site.getsitepackages(), *user) if Path(path).is_dir())


def folder_name(wanted: Requirement) -> str:
    """Return the folder name of an environment, such as `engine-1.2.3-py3.11-0a1b2c3d`.

    The name depends on the interpreter and on every package that the environment shares. It does
    not depend on this package's code.
    """
    text = "\n".join([sys.version, sys.prefix, *site_folders(), *_packages_here()])
    key = hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:8]
    python = f"py{sys.version_info.major}.{sys.version_info.minor}"
    return f"{wanted.distribution}-{wanted.version}-{python}-{key}"


def _packages_here() -> list[str]:
    """Return the packages that every environment shares, pinned."""
    return sorted(
        f"{one.metadata['Name']}=={one.version}" for one in importlib.metadata.distributions()
    )


def interpreter(place: Path) -> Path:
    """Return the path of an environment's interpreter, which may not exist yet."""
    return place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def environment(
    wanted: Requirement, parent: Path, show_line: ShowLine, run: Execute = execute
) -> Path:
    """Return the folder of a version's environment, and create it if it is missing.

    Args:
        wanted: the version.
        parent: folder of all environments.
        show_line: shows each command before it runs.
        run: runs the commands.

    Raises:
        EnvironmentError_: if it can't be created; nothing of it remains.
        OSError: if a file can't be read or written.
    """
    place = parent.absolute() / folder_name(wanted)
    place.parent.mkdir(parents=True, exist_ok=True)
    with _locked(place, show_line):
        if (place / READY).is_file() and interpreter(place).exists():
            show_line(f"{wanted}: in {visible(str(place))}")
            return place
        shutil.rmtree(place, ignore_errors=True)
        try:
            _make(wanted, place, show_line, run)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
    return place


def _make(wanted: Requirement, place: Path, show_line: ShowLine, run: Execute) -> None:
    def command(*words: str) -> None:
        _command(words, wanted, show_line, run)

    show_line(f"{wanted}: its environment is made, once:")
    uv = shutil.which("uv")
    if uv:
        command(uv, "venv", "--python", sys.executable, str(place))
    else:
        # The environment shares this program's pip: a second one takes most of the time.
        bare = ["--without-pip"] if importlib.util.find_spec("pip") else []
        command(sys.executable, "-m", "venv", *bare, str(place))
    lib = Path(sysconfig.get_path("purelib", "venv", {"base": str(place)}))
    lib.mkdir(parents=True, exist_ok=True)
    line = "; ".join(
        ["import site", *(f"site.addsitedir({json.dumps(path)})" for path in site_folders())]
    )
    show_line(f"  echo {shlex.quote(line)} > {shlex.quote(str(lib / _PATH_FILE))}")
    (lib / _PATH_FILE).write_text(f"{line}\n", encoding="utf-8")
    if uv:
        _install_by_uv(uv, wanted, place, command)
    else:
        python = str(interpreter(place))
        command(python, "-m", "pip", "install", "--disable-pip-version-check", wanted.pinned)
    write_whole(place / READY, f"{wanted.pinned}\n")


def _install_by_uv(uv: str, wanted: Requirement, place: Path, command: Callable[..., None]) -> None:
    """Install a version and the dependencies that the shared packages do not satisfy.

    uv does not count packages that a `.pth` file adds, so it resolves first and prefers them. It
    runs in the environment's folder, since the working folder may configure another index.
    """
    requirements, pins = place / "wanted.txt", place / "pins.txt"
    here = [pin for pin in _packages_here() if _PIN.fullmatch(pin)]
    requirements.write_text(f"{wanted.pinned}\n", encoding="utf-8")
    pins.write_text("".join(f"{pin}\n" for pin in here), encoding="utf-8")
    within = uv, "--directory", str(place)
    resolve = "pip", "compile", "--no-header", "--no-annotate", "--python", sys.executable
    command(*within, *resolve, requirements.name, "--output-file", pins.name)
    shared = {_normalized(pin) for pin in here}
    resolved = filter(_PIN.fullmatch, pins.read_text(encoding="utf-8").splitlines())
    missing = [pin for pin in resolved if _normalized(pin) not in shared]
    python = str(interpreter(place))
    command(*within, "pip", "install", "--no-deps", "--python", python, *missing)


_PIN = re.compile(r"[\w.-]+==\d[\w.!+-]*")


def _normalized(pin: str) -> str:
    """Return a pin with the name as PEP 503 compares it."""
    name, _, version = pin.partition("==")
    return f"{re.sub('[-_.]+', '-', name).lower()}=={version}"


def _command(
    command: Sequence[str], wanted: Requirement, show_line: ShowLine, run: Execute
) -> None:
    """Show a command and run it.

    Raises:
        EnvironmentError_: with the end of its output if it fails.
    """
    shown = shlex.join(command)
    show_line(f"  {shown}")
    code, output = run(command)
    if code == 0:
        return
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")]  # pip's
    causes = [line for line in lines if line.startswith(("╰─▶", "error:"))]  # uv's
    last = visible((errors or causes or lines or [f"exit code {code}"])[-1])
    raise EnvironmentError_(
        f"{wanted} can't be installed: {last}; `{sys.executable} -m pip index versions"
        f" {wanted.distribution}` lists what there is for this Python; or name an environment that"
        f" has it, {wanted.version}=path/to/venv"
    )


@contextlib.contextmanager
def _locked(place: Path, show_line: ShowLine) -> Iterator[None]:
    """Lock an environment against other processes within this context."""
    with place.with_name(f"{place.name}.lock").open("a") as file:
        if not hold(file.fileno()):
            show_line(f"{visible(place.name)}: another program is making it; waiting")
            hold(file.fileno(), wait=True)
        yield
