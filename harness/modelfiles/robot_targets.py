"""Robot files among the names of a command line, and below a folder."""

import difflib
import os
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from physics_crosscheck.harness.documents.expanded import (
    RENAMED,
    XACRO,
    ExpansionError,
    completed,
    expand,
    expanded_name,
    renamed,
    replaced,
    without_comments,
)
from physics_crosscheck.harness.documents.reading import MAX_MODEL_BYTES, USD_SUFFIXES, read_regular
from physics_crosscheck.harness.documents.sdf.expand import sdf_models
from physics_crosscheck.harness.results.visible import odd_name, visible
from .folders import FORMATS, FolderError, is_robot, is_system, similar_path
from .parts import included

ROBOT = "robot:"
"""Prefix of a robot's name in robot_descriptions."""

_ATTRIBUTES = ("URDF_PATH", "MJCF_PATH", "XACRO_PATH")


def source_file(name: str) -> Path | None:
    """Return the model file that a name stands for; None for a name that is a path itself.

    `robot:panda` is a robot of robot_descriptions, from its cache. A source for xacro is expanded,
    also one of the suffix `.urdf`. A URDF that lacks its `world` or every inertia is copied,
    and so is a file of another suffix for MJCF or SDF.

    Raises:
        FolderError: naming the problem and the remedy.
    """
    if name.startswith(ROBOT):
        file: Path | None = _plain(_known_robot(name))
    elif (path := Path(name)).suffix == ".sdf" and path.is_file():
        return next((one for one in source_files(name, None) if one != path), None)
    else:
        file = _plain(path) if path.is_file() and is_source(path) else None
    return completed(file or Path(name)) or renamed(Path(name)) or file


def source_files(name: str, model: str | None = "") -> list[Path]:
    """Return the model files that a name stands for.

    Args:
        name: as in `source_file`.
        model: the one to read from an SDFormat file of several; empty: each as a file; None: the
            file itself.

    Raises:
        FolderError: naming the problem and the remedy.
    """
    path = Path(name)
    if RENAMED.get(path.suffix) == ".sdf":
        path = renamed(path) or path
    if path.suffix != ".sdf" or not path.is_file():
        return [source_file(name) or path]
    models = sdf_models(path)
    if model is None and len(models) > 1:
        return [path]
    return [file for key, file in models.items() if not model or key == model] or [path]


def is_source(file: Path) -> bool:
    """Return whether a file is a source for xacro, by its suffix or its elements."""
    if file.suffix != ".urdf":
        return file.suffix == XACRO
    try:
        data = read_regular(file, MAX_MODEL_BYTES)
        return bool(re.search(rb"<xacro:|\$\(optenv ", without_comments(data)))
    except OSError:
        return False


def _plain(file: Path) -> Path:
    """Return a file, expanded if it is a source."""
    if not is_source(file):
        return file
    try:
        return expand(file)
    except ImportError:
        target = shlex.quote(expanded_name(file))
        command = f"{shlex.join(['xacro', str(file)])} > {target}"
        raise FolderError(
            f"{file}: it is source for xacro, which no engine reads; expand it with `{command}`,"
            f" and give {target}, or pip install 'physics-crosscheck[ros]'"
        ) from None
    except ExpansionError as error:
        raise FolderError(str(error)) from None


def _known_robot(name: str) -> Path:
    """Return the file of a robot from the cache of robot_descriptions, without network."""
    try:
        from robot_descriptions import _cache
        from robot_descriptions._descriptions import DESCRIPTIONS
        from robot_descriptions._repositories import REPOSITORIES
    except ImportError:
        raise FolderError(
            f"{name}: needs robot_descriptions; pip install 'physics-crosscheck[robots]'"
        ) from None
    module = _module_of(name, list(DESCRIPTIONS))
    root = os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")
    folder = Path(root).expanduser()

    def in_cache(repository: str, commit: str | None = None) -> str:
        place = folder / REPOSITORIES[repository].cache_path
        if not place.is_dir():
            raise FolderError(
                f"{name}: {repository} is not in {folder}; download it once with"
                f" `python -m robot_descriptions pull {module}`"
            )
        return str(place)

    with replaced(_cache, "clone_to_cache", in_cache):
        described = import_module(f"robot_descriptions.{module}")
    paths = (getattr(described, one, None) for one in _ATTRIBUTES)
    path = next((Path(one) for one in paths if one), None)
    if path is None or not path.is_file():
        raise FolderError(f"{name}: {path or 'its model file'} is missing; download it again")
    return path


def _module_of(name: str, modules: list[str]) -> str:
    """Return the module of a robot: `panda` is `panda_description`."""
    robot = name.removeprefix(ROBOT)
    for module in (robot, f"{robot}_description", f"{robot}_mj_description"):
        if module in modules:
            return module
    short = {one.removesuffix("_description"): one for one in modules}
    close = difflib.get_close_matches(robot, short)
    hint = f"; similar: {', '.join(ROBOT + one for one in close)}" if close else ""
    raise FolderError(f"{name}: robot_descriptions has no such robot{hint}")


MAX_DEPTH = 4
"""Folders below a folder that are searched."""

SKIPPED = frozenset({"__pycache__", "build", "dist", "node_modules", "site-packages", "venv"})
"""Names of folders that hold no models of the user; hidden ones are skipped too."""

_FORMAT_LIST = f"{', '.join([*FORMATS][:-1])} and {[*FORMATS][-1]}"


@dataclass(frozen=True)
class NamedRobots:
    """The meaning of the names of a command line.

    Attributes:
        files: robot files, each once.
        others: names of other targets.
        faults: message about each file that is missing or can't be checked alone, by its name.
    """

    files: list[Path]
    others: list[str]
    faults: Mapping[str, str]


def robot_files(names: Sequence[str], model: str | None = "") -> NamedRobots:
    """Separate robot files, also missing ones, from the other names.

    Args:
        names: of a command line.
        model: as in `source_files`.
    """
    files, others, faults = list[Path](), list[str](), dict[str, str]()
    for name in names:
        try:
            paths = source_files(name, model)
        except FolderError as error:
            faults[name] = visible(str(error))
            continue
        path = paths[0]
        if path.suffix in FORMATS and not path.exists():
            faults[name] = f"{visible(name)}: there is no such file{similar_path(path)}"
            continue
        if not path.is_file():
            others.append(name)
            continue
        if path.suffix not in FORMATS:
            formats = (
                f"only {_FORMAT_LIST} run without a folder; name one of these, or a system folder"
            )
            faults[name] = f"{visible(name)}: {formats}"
        elif (why := odd_name(name)) is not None:
            faults[name] = f"{visible(name)}: its name has {why}; rename it"
        else:
            files += [one for one in paths if one not in files]
    return NamedRobots(files, others, faults)


def models_below(here: Path) -> list[str]:
    """Return the system folders below a folder; without any, its model files.

    Raises:
        FolderError: for a folder with neither.
    """
    folders, files = _below(here)
    if not (folders or files):
        raise FolderError(
            "no models below this directory; name a file such as robot.urdf or a system folder,"
            " set folders in [tool.crosscheck] of pyproject.toml, or try `crosscheck demo`"
        )
    return sorted(map(str, folders or files))


def robots_below(folder: Path) -> list[Path]:
    """Return the robot files below a folder, sorted; none where a system folder is below it."""
    folders, files = _below(folder)
    return [] if folders else sorted(files)


def expand_folders(names: Sequence[str]) -> list[str]:
    """Return the names, each folder of robot files replaced by these files."""
    return [
        file
        for name in names
        for file in ([str(one) for one in robots_below(Path(name))] if name else []) or [name]
    ]


def _below(here: Path) -> tuple[list[Path], list[Path]]:
    """Return the system folders and the robot files below a folder."""
    folders, files = list[Path](), list[Path]()
    for base, names in _walk(here):
        if is_system(base):
            folders.append(base)
        files += [base / name for name in names if is_robot(base / name)]
    stages = [one for one in files if one.suffix in USD_SUFFIXES]
    layers = {os.path.normpath(part) for one in stages for part in included(one)}
    return folders, [one for one in files if os.path.normpath(one) not in layers]


def _walk(here: Path) -> Iterator[tuple[Path, list[str]]]:
    """Yield folders and the names of their files, none below a system folder."""
    for base, folders, names in os.walk(here):
        depth = len(Path(base).relative_to(here).parts)
        deeper = depth < MAX_DEPTH and not is_system(Path(base))
        folders[:] = sorted(
            name for name in folders if deeper and not name.startswith(".") and name not in SKIPPED
        )
        yield Path(base), names
