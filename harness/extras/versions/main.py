"""`crosscheck versions`: the same models under several versions of an engine.

versions --uv, or a virtual environment--> a process each --accept, gate--> what changes

The results of the first version are accepted in a temporary baseline. Each next version runs as
`crosscheck gate` does, on the same segments, and its results are accepted for the one after it.
"""

import argparse
import importlib
import importlib.metadata
import importlib.util
import os
import re
import shlex
import shutil
import site
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.text import gate_lines
from physics_crosscheck.harness.engines.registry import distribution, engines, engines_reading
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.interfaces.cli.gate import LateProgress
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.modelfiles.folders import FolderError, system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.paths import IMPORT_ROOT
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.hold import hold
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.terminal.console import print_status_lines, terminal
from physics_crosscheck.harness.results.visible import visible

READY = "made-by-crosscheck.txt"
"""Written last: an environment without it is incomplete and is created again."""

SHARED = ("numpy", "scipy", "sympy", "mpmath")
"""Packages that affect numbers, of which every version gets the one installed here."""

_VERSION = re.compile(r"\d[\w.!+-]*")
"""A version number (loosely PEP 440) that an installer can't mistake for an option or a path."""


class VersionError(RuntimeError):
    """A version that can't be installed or run; gives version, reason and remedy."""


class VersionTask(Record, frozen=True, kw_only=True):
    """The work for one version, done in a process of its own.

    Attributes:
        engine: Name of the engine.
        version: Version that must be installed.
        before: Version of the accepted results; empty for the first one.
        targets: System folders and robot files.
        baseline: Folder of the accepted results.
        out: Folder for gate.json.
        resolution: Requested resolution.
        jobs: Number of worker processes; 0 for one per processor.
        limits: Limits of a task.
        floating: Whether the root link of a URDF moves freely.
        diagnose: Whether to diagnose models that differ.
    """

    engine: str
    version: str
    before: str
    targets: tuple[str, ...]
    baseline: str
    out: str
    resolution: float
    jobs: int
    limits: Limits
    floating: bool | None
    diagnose: bool


def main(options: argparse.Namespace) -> int:
    """Run the models under each version, and print the changes."""
    if len(options.engine) > 1:
        raise FolderError("--engine is given twice: one engine at a time")
    engine, versions = requested_versions(options.engine[0])
    targets, left_out = requested_targets(engine, options.folders)
    for line in left_out:
        print(f"crosscheck: {line}", file=sys.stderr, flush=True)
    codes, before = [AGREE], ""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as scratch:
        try:
            pythons = [
                interpreter(engine, version, place, options.environments)
                for version, place in versions.items()
            ]
            for version, python in zip(versions, pythons, strict=True):
                task = VersionTask(
                    engine=engine,
                    version=version,
                    before=before,
                    targets=tuple(map(str, targets)),
                    baseline=str(Path(scratch) / "baseline"),
                    out=str(options.out / f"{engine}-{version}"),
                    resolution=options.resolution,
                    jobs=options.jobs,
                    limits=arguments.limits_of(options),
                    floating=options.floating,
                    diagnose=options.diagnose,
                )
                codes.append(launch(task, python, Path(scratch) / "task.json"))
                if codes[-1] == FAIL and not before:
                    return FAIL  # nothing can be compared with it
                before = version
        except VersionError as error:
            print(f"crosscheck: {error}", file=sys.stderr)
            return FAIL
    return max(codes)


def requested_versions(words: Sequence[str]) -> tuple[str, dict[str, Path | None]]:
    """Return an engine's name and its versions, as in `NAME 1.2.3 1.3=path/to/venv`.

    Each version has the environment that the user names, or None.

    Raises:
        FolderError: giving the problem and the remedy.
    """
    name, *given = words
    if name not in engines():
        known_names = ", ".join(sorted(engines()))
        raise FolderError(f"no engine {name!r} is known; known are {known_names}")
    versions: dict[str, Path | None] = {}
    for word in given:
        number, equals, place = word.partition("=")
        if not _VERSION.fullmatch(number):
            raise FolderError(
                f"--engine: {visible(word)} is not a version; folders and files come before"
                " --engine"
            )
        if equals and not Path(place).is_dir():
            raise FolderError(f"--engine: {visible(place)}: there is no such environment")
        if number in versions:
            raise FolderError(f"--engine {name}: {number} is asked for twice; name two versions")
        versions[number] = Path(place) if equals else None
    if len(versions) < 2:
        raise FolderError(
            f"--engine {name}: name two versions of it or more, the older first, as in"
            f" `--engine {name} 1.2.3 1.3.0`"
        )
    return name, versions


def requested_targets(engine: str, names: list[str]) -> tuple[list[Path], list[str]]:
    """Return the folders and files that an engine runs, and a sentence for each other one.

    Raises:
        FolderError: if a name is unknown, or none of its models runs in the engine.
    """
    robots = robot_files(names)
    if robots.faults:
        raise FolderError("; ".join(robots.faults.values()))
    folders = system_folders(robots.others) if robots.others or not names else []
    left_out = {
        folder: f"{folder}: no model of it names {engine}; left out"
        for folder in folders
        if all(
            isinstance(one, Sidecar) and engine not in (*one.engines, *one.absent)
            for one in model_files(folder)
        )
    }
    left_out |= {
        file: f"{file}: {engine} reads no {file.suffix} files; left out"
        for file in robots.files
        if all(reader.name != engine for reader in engines_reading(file.suffix))
    }
    targets = [target for target in (*folders, *robots.files) if target not in left_out]
    if not targets:
        raise FolderError("; ".join(left_out.values()))
    return targets, list(left_out.values())


def interpreter(engine: str, version: str, place: Path | None, parent: Path | None) -> list[str]:
    """Return the command of an interpreter that has a version, and create what it needs.

    Args:
        engine: its name.
        version: the version.
        place: the user's environment; None: uv or a virtual environment gets the version.
        parent: folder of virtual environments; None: in the user's cache.

    Raises:
        VersionError: if the version is not available.
        OSError: if a file can't be read or written.
    """
    engine_class = engines()[engine]
    pinned = f"{distribution(engine_class)}=={version}"
    if place is not None:
        if not _python(place).exists():
            raise VersionError(
                f"{engine} {version}: {visible(str(place))} is not an environment: it has no"
                f" {_python(Path())}; `python -m venv` makes one"
            )
        return [str(_python(place).absolute())]
    if engine_class.version() == version:
        return [sys.executable]
    if uv := shutil.which("uv"):
        pins = [f"{name}=={importlib.metadata.version(name)}" for name in SHARED]
        words = [word for pin in (pinned, *pins) for word in ("--with", pin)]
        command = [uv, "run", "--no-project", "--isolated", "--python", sys.executable, *words]
        _run([*command, "python", "-c", ""], pinned)
        return [*command, "python"]
    python = f"py{sys.version_info.major}.{sys.version_info.minor}"
    folder = (parent or default_environments()).absolute() / f"{pinned.replace('==', '-')}-{python}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    with folder.with_name(f"{folder.name}.lock").open("a") as lock:
        hold(lock.fileno(), wait=True)
        if not (folder / READY).is_file():
            shutil.rmtree(folder, ignore_errors=True)
            try:
                _create(folder, pinned)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
    return [str(_python(folder))]


def _create(folder: Path, pinned: str) -> None:
    """Create an environment with an engine; all other packages are those of this program."""
    print(f"{pinned}: its environment is made, once:", flush=True)
    bare = ["--without-pip"] if importlib.util.find_spec("pip") else []  # it shares this pip
    _run([sys.executable, "-m", "venv", *bare, str(folder)], pinned)
    packages = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder)}))
    packages.mkdir(parents=True, exist_ok=True)
    lines = "; ".join(f"site.addsitedir({place!r})" for place in site_folders())
    (packages / "packages-beside.pth").write_text(f"import site; {lines}\n", encoding="utf-8")
    pip = [str(_python(folder)), "-m", "pip", "install", "--disable-pip-version-check"]
    _run([*pip, pinned], pinned)
    write_whole(folder / READY, f"{pinned}\n")


def _run(command: Sequence[str], pinned: str) -> None:
    """Show a command and run it without a terminal for prompts.

    Raises:
        VersionError: with the end of its output if it fails.
    """
    print(f"  {shlex.join(command)}", flush=True)
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace"
    )
    if done.returncode:
        lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith(("ERROR:", "╰─▶", "error:"))]
        last = visible((errors or lines or [f"exit code {done.returncode}"])[-1])
        name, _, version = pinned.partition("==")
        raise VersionError(
            f"{name} {version} can't be installed: {last}; `{sys.executable} -m pip index versions"
            f" {name}` lists what there is for this Python; or name an environment that has it,"
            f" {version}=path/to/venv"
        )


def _python(place: Path) -> Path:
    return place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def site_folders() -> tuple[str, ...]:
    """Return the folders of this program's packages."""
    user = [site.getusersitepackages()] if site.ENABLE_USER_SITE else []
    return tuple(path for path in (*site.getsitepackages(), *user) if Path(path).is_dir())


def default_environments() -> Path:
    """Return the default folder of environments, in the user's cache."""
    if os.name == "nt":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "physics-crosscheck" / "environments"


_CHILD = """
import os, pathlib, site, sys
task, here, places, package = sys.argv[1:]
def end(why):
    print(f"crosscheck: {sys.executable}: {why}", file=sys.stderr)
    sys.exit(3)
own = f"{sys.version_info.major}.{sys.version_info.minor}"
if own != here:
    end(f"it is Python {own}, and this program's packages are for {here}")
for place in filter(None, places.split(os.pathsep)):
    if place not in sys.path:
        site.addsitedir(place)
try:
    from physics_crosscheck.harness.extras.versions.main import run_task
except ImportError as error:
    end(f"{type(error).__name__}: {error}")
sys.exit(run_task(pathlib.Path(task), package))
"""
"""Code of the environment's interpreter: this program's packages follow its own."""


def launch(task: VersionTask, python: Sequence[str], file: Path) -> int:
    """Run a task in an environment, in its own process; return its exit code.

    Raises:
        VersionError: if the process ends by anything else than its answer.
    """
    write_whole(file, encoded(task))
    environment = dict(os.environ)
    # An installed package is found with its dependencies, after the environment's own packages.
    # Before them, the engine installed here would run instead.
    if str(IMPORT_ROOT) not in {str(Path(place).resolve()) for place in site_folders()}:
        paths = filter(None, [str(IMPORT_ROOT), environment.get("PYTHONPATH", "")])
        environment["PYTHONPATH"] = os.pathsep.join(paths)
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    given = str(file), here, os.pathsep.join(site_folders()), str(IMPORT_ROOT)
    command = [*python, "-P", "-c", _CHILD, *given]
    code = subprocess.run(command, stdin=subprocess.DEVNULL, env=environment).returncode
    if code not in (AGREE, DIFFER, FAIL):
        raise VersionError(f"{task.engine} {task.version}: its process ended with code {code}")
    return code


def run_task(file: Path, package: str) -> int:
    """Run a task in this process: compare with the version before, accept the results.

    Args:
        file: the task.
        package: folder of the package that started this process.
    """
    task = decoded(file.read_bytes(), VersionTask)
    if problem := _unusable(task, package):
        print(f"crosscheck: {task.engine} {task.version}: {problem}", file=sys.stderr)
        return FAIL
    baseline = Path(task.baseline)
    options = Options(
        baseline=baseline,
        engines=(task.engine,),
        every=True,
        diagnose=task.diagnose,
        resolution=task.resolution,
        jobs=task.jobs,
        limits=task.limits,
        floating=task.floating,
    )
    with LateProgress() as progress:
        result = gate(list(map(Path, task.targets)), options, progress)
    console = terminal()
    if task.before:
        print(f"{task.engine} {task.before} -> {task.version}")
        print_status_lines(console, gate_lines(result, console.width, None))
        write_whole(Path(task.out) / "gate.json", encoded(result.record(), indent=1))
    elif result.is_incomplete:
        print_status_lines(console, gate_lines(result, console.width, None))
    if not result.changes:
        return FAIL
    try:
        accept(result, [], f"{task.engine} {task.version}", baseline, untested=True)
    except AcceptError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    if result.is_incomplete:
        return FAIL
    is_changed = any(change.diff.is_change for change in result.changes)
    return DIFFER if task.before and (is_changed or not result.passes) else AGREE


def _unusable(task: VersionTask, package: str) -> str:
    """Return why this process has not the requested version or code; empty if it has."""
    if str(IMPORT_ROOT) != package:
        return (
            f"it has a physics-crosscheck of its own in {IMPORT_ROOT}, which would be run instead"
            f" of this one; `{sys.executable} -m pip uninstall physics-crosscheck` takes it out"
        )
    engine_class = engines().get(task.engine)
    version = engine_class.version() if engine_class else None
    if version is None:
        return f"it has no {task.engine}; {sys.executable} -m pip can install it"
    try:
        importlib.import_module(task.engine)
    except ModuleNotFoundError:
        pass  # its module has another name
    except ImportError as error:  # such as a package that was built for an older numpy
        return f"it can't be imported with the packages here: {error}"
    return "" if version == task.version else f"it has {task.engine} {version}"
