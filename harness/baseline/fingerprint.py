"""Dependencies of a case's outcome, as hashes: files, engine version, numerics.

They are read without running anything, so unchanged results are recognized at once.
"""

import dataclasses
import importlib.metadata
import os
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from physics_crosscheck.harness.engines.registry import engines, model_formats
from physics_crosscheck.harness.modelfiles.code_reads import (
    UNKNOWN,
    digest,
    digest_of,
    is_content,
    states_now,
)
from physics_crosscheck.harness.modelfiles.parts import included, named_files, parts
from physics_crosscheck.harness.modelfiles.sidecar import (
    SidecarError,
    drop_absent_models,
    read_sidecar,
)
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.records.baseline import RobotOptions
from physics_crosscheck.harness.records.case import ModelKey

OTHER_FILES = "(beside)"
"""Name of the common hash of all files of a folder that no model file names; code may read any."""


@dataclass(frozen=True)
class ModelFiles:
    """A model file of a folder, with all the files that it includes.

    Attributes:
        folder: the system folder.
        model: name of the file.
        engines: engines that run the file.
        hashes: hash of each file's content, by name relative to the folder.
        copies: files whose differences are worth showing.
        covered: names of the files covered by these hashes, alone or together.
    """

    folder: Path
    model: str
    engines: tuple[str, ...]
    hashes: dict[str, str]
    copies: tuple[str, ...]
    covered: frozenset[str] = frozenset()


@dataclass(frozen=True)
class FolderFiles:
    """A system folder or a robot file: its models, and the problems that prevent running some of
    them.

    Attributes:
        folder: the folder, or the robot file.
        system: hash of `system.py` and of the files that it may read; empty for a robot file.
        broken: sentences on unreadable sidecars and on model files without one.
        robot: options for reading a robot file; None for a system folder.
    """

    folder: Path
    system: str
    models: tuple[ModelFiles, ...]
    broken: tuple[str, ...]
    robot: RobotOptions | None = None

    @property
    def base(self) -> Path:
        """Folder that the names of files are relative to."""
        return self.folder if self.robot is None else self.folder.parent


@dataclass(frozen=True, kw_only=True)
class Dependencies:
    """All dependencies of a case's outcome.

    Attributes:
        files: hashes by name, as in `ModelFiles`.
        engine_version: engine with its version, such as `engine 4.0.0`.
        resolution: of the run.
        numerics: version of this package's numerics.
    """

    files: Mapping[str, str]
    engine_version: str
    resolution: float
    numerics: int


def dependencies(
    files: Mapping[str, str], engine: str, versions: Mapping[str, str | None], resolution: float
) -> Dependencies:
    """Return the present dependencies of a case; only this function knows the numerics' version."""
    return Dependencies(
        files=files,
        engine_version=f"{engine} {versions.get(engine)}",
        resolution=resolution,
        numerics=VERSION,
    )


def folder_files(folder: Path, apart: Path | None = None) -> FolderFiles:
    """Hash a system folder; `apart` is an inner folder to ignore, the baseline.

    Raises:
        OSError: for an unreadable file, since it cannot count as unchanged.
    """
    sidecars, broken, model_names = {}, [], {"system.py"}
    for path in sorted(folder.glob("*.toml")):
        model_names |= {path.name, path.with_suffix("").name}
        try:
            sidecars[path.with_suffix("").name] = read_sidecar(path)
        except SidecarError as error:
            broken.append(str(error))
    formats = model_formats()
    models = [p.name for p in sorted(folder.iterdir()) if p.suffix in formats]
    within = {path for name in sidecars for path in included(folder / name)}
    broken += [
        f"{folder / name}: has no sidecar"
        for name in models
        if name not in sidecars and folder / name not in within
    ]
    others = {
        name: digest(folder / name) for name in _inside(folder, apart) if name not in model_names
    }
    system = digest(folder / "system.py")
    model_files = []
    for name, sidecar in zip(sidecars, drop_absent_models(sidecars.values()), strict=True):
        copies = (name, f"{name}.toml", "system.py")
        hashes = {copy: digest(folder / copy) for copy in copies}
        named = {}
        for path in named_files(sidecar.model):
            where = Path(os.path.relpath(path, folder)).as_posix()
            if where not in hashes:
                named[where] = digest(path)
        rest = {other: others[other] for other in others if other not in named}
        if rest:
            named[OTHER_FILES] = _together(rest)
        covered = frozenset((*copies, *named, *others))
        hashes |= named
        model_files.append(ModelFiles(folder, name, sidecar.engines, hashes, copies, covered))
    declared = _together({"system.py": system, **others})
    return FolderFiles(folder, declared, tuple(model_files), tuple(broken))


def robot_file(file: Path, engines: tuple[str, ...], robot: RobotOptions) -> FolderFiles:
    """Hash a robot file and the files that it names.

    Args:
        file: the robot file.
        engines: engines that run the file.
        robot: options for reading the file.

    Raises:
        OSError: for an unreadable file.
    """
    files = {file: True, **parts(file)}
    names = {path: Path(os.path.relpath(path, file.parent)).as_posix() for path in files}
    hashes = {name: digest(path) for path, name in names.items()}
    copies = tuple(name for path, name in names.items() if files[path])
    model = ModelFiles(file.parent, file.name, engines, hashes, copies, frozenset(hashes))
    return FolderFiles(file, "", (model,), (), robot)


def hashed_again(before: FolderFiles, apart: Path) -> FolderFiles:
    """Hash the same folder or robot file again.

    Raises:
        OSError: for an unreadable file.
    """
    if before.robot is None:
        return folder_files(before.folder, apart)
    return robot_file(before.folder, before.models[0].engines, before.robot)


def with_reads(model: ModelFiles | None, reads: Mapping[str, str]) -> dict[str, str]:
    """Return the dependencies of a model's cases: its files, and the files that the folder's code
    read, which one hash covers except hidden ones.
    """
    if model is None:
        return {}
    besides = {name: state for name, state in reads.items() if name not in model.covered}
    return {**besides, **model.hashes}


def as_now(model: ModelFiles, accepted: Mapping[str, str]) -> dict[str, str]:
    """Return the same, with the present state of the files that were read for the accepted result.

    Nothing is run: unchanged code that finds the same files reads the same files.
    """
    besides = {
        name: state
        for name, state in accepted.items()
        if name not in model.hashes and name != OTHER_FILES
    }
    return {**states_now(model.folder, besides), **model.hashes}


def changed_names(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Return the names that differ between two such tables.

    A file that only one of two runs looked for did not change: it may have been loaded before.
    """

    def differs(name: str) -> bool:
        both = then.get(name), now.get(name)
        return both[0] != both[1] and (None not in both or any(map(is_content, filter(None, both))))

    return [name for name in sorted({*then, *now}) if differs(name)]


def model_hashes(folder: Path, resolution: float, apart: Path | None) -> dict[ModelKey, str]:
    """Return the hash of each model of a folder in each engine; {} if a file cannot be read.

    Args:
        folder: the system folder.
        resolution: of the run.
        apart: an inner folder to ignore: the baseline.
    """
    try:
        scan = folder_files(folder, apart)
    except OSError:
        return {}
    engine_versions = versions()
    return {
        (str(folder), one.model, engine): _hash(
            dependencies(one.hashes, engine, engine_versions, resolution), engine_versions
        )
        for one in scan.models
        for engine in one.engines
    }


def always_lines(reads: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Yield a sentence on each folder that always runs again, with what its code has opened.

    Args:
        reads: states of paths that code has read, by folder.
    """
    for folder, states in reads.items():
        if names := [name for name, state in states.items() if state == UNKNOWN]:
            yield f"{folder}: always runs again, because its code uses {', '.join(names)}"


def _hash(depends: Dependencies, engine_versions: Mapping[str, str | None]) -> str:
    ours = engine_versions["physics-crosscheck"], engine_versions["python"], np.__version__
    return digest_of(msgspec.json.encode([dataclasses.asdict(depends), ours], order="sorted"))


def versions() -> dict[str, str | None]:
    """Return the versions of this package, Python and each engine."""
    try:
        version = importlib.metadata.version("physics-crosscheck")
    except importlib.metadata.PackageNotFoundError:
        version = "not installed"
    engine_versions = {name: engine.version() for name, engine in engines().items()}
    return {"physics-crosscheck": version, "python": platform.python_version(), **engine_versions}


def _together(hashes: dict[str, str]) -> str:
    text = "\n".join(f"{name} {value}" for name, value in sorted(hashes.items()))
    return digest_of(text.encode(errors="surrogateescape"))


def _inside(folder: Path, apart: Path | None) -> Iterator[str]:
    """Yield the names of all files below a folder, except hidden files, caches and this tool's
    files.
    """
    apart = None if apart is None else apart.resolve()
    seen = set()
    for base, folders, names in os.walk(folder, followlinks=True):
        here = Path(base)
        real = here.resolve()
        if real in seen or real == apart or (here != folder and "results.json" in names):
            folders.clear()
            continue
        seen.add(real)
        folders[:] = sorted(f for f in folders if not f.startswith((".", "__pycache__")))
        for name in sorted(names):
            if not name.startswith(".") and (here / name).is_file():
                yield (here / name).relative_to(folder).as_posix()
