"""What the outcome of a case depends on, as hashes: files, engine version, numerics.

Read without running anything: this is what tells, in a moment, that nothing has changed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.registry import model_formats
from physics_crosscheck.harness.modelfiles.parts import included, named_files
from physics_crosscheck.harness.modelfiles.path_states import (
    digest,
    digest_of,
    is_content,
    states_now,
    without_content,
)
from physics_crosscheck.harness.modelfiles.sidecar import (
    SidecarError,
    drop_absent_models,
    read_sidecar,
)
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.records.baseline import RobotOptions

BESIDE = "(beside)"
"""Stands for the files of a folder that no model file names: a `space.py` may open any of them."""


@dataclass(frozen=True)
class ModelFiles:
    """A model file of a folder, with everything that it is made of.

    Attributes:
        folder: the system folder.
        model: the file's name.
        engines: those that run it.
        hashes: name of each file, relative to the folder, and the hash of its content.
        copies: of these, the ones that a reader may want to see the differences of.
        beside: names of the files that are in these hashes, alone or together.
    """

    folder: Path
    model: str
    engines: tuple[str, ...]
    hashes: dict[str, str]
    copies: tuple[str, ...]
    beside: frozenset[str] = frozenset()


@dataclass(frozen=True)
class FolderFiles:
    """A system folder or a robot file: its models, and what there is that can't be run.

    Attributes:
        folder: the folder, or the robot file.
        system: hash of `system.py` and of the files that it may read; empty for a robot file.
        broken: sentences: sidecars that can't be read, model files without one.
        robot: options with which a robot file is read; None for a system folder.
    """

    folder: Path
    system: str
    models: tuple[ModelFiles, ...]
    broken: tuple[str, ...]
    robot: RobotOptions | None = None

    @property
    def base(self) -> Path:
        """The folder that the names of files are relative to."""
        return self.folder if self.robot is None else self.folder.parent


@dataclass(frozen=True, kw_only=True)
class Dependencies:
    """All that the outcome of a case depends on.

    Attributes:
        files: hashes by name, as in `ModelFiles`.
        engine_version: the engine with its version, as `engine 4.0.0`.
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
    """What a case depends on as things are now: the one place that knows the numerics' version."""
    return Dependencies(
        files=files,
        engine_version=f"{engine} {versions.get(engine)}",
        resolution=resolution,
        numerics=VERSION,
    )


def folder_files(folder: Path, apart: Path | None = None) -> FolderFiles:
    """Hash a system folder; `apart` is a folder inside that is none of its own (the baseline).

    Raises:
        OSError: for a file that can't be read. What can't be read is not taken as unchanged.
    """
    sidecars, broken, own = {}, [], {"system.py"}
    for path in sorted(folder.glob("*.toml")):
        own |= {path.name, path.with_suffix("").name}
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
    beside = {name: digest(folder / name) for name in _inside(folder, apart) if name not in own}
    system = digest(folder / "system.py")
    found = []
    for name, sidecar in zip(sidecars, drop_absent_models(sidecars.values()), strict=True):
        copies = (name, f"{name}.toml", "system.py")
        hashes = {copy: digest(folder / copy) for copy in copies}
        named = {}
        for path in named_files(sidecar.model):
            where = Path(os.path.relpath(path, folder)).as_posix()
            if where not in hashes:
                named[where] = digest(path)
        rest = {other: beside[other] for other in beside if other not in named}
        if rest:
            named[BESIDE] = _together(rest)
        own_and_beside = frozenset((*copies, *named, *beside))
        hashes |= named
        found.append(ModelFiles(folder, name, sidecar.engines, hashes, copies, own_and_beside))
    declared = _together({"system.py": system, **beside})
    return FolderFiles(folder, declared, tuple(found), tuple(broken))


def robot_file(file: Path, engines: tuple[str, ...], robot: RobotOptions) -> FolderFiles:
    """Hash a robot file and the files that it names.

    Args:
        file: the robot file.
        engines: those that run it.
        robot: options with which it is read.

    Raises:
        OSError: for a file that can't be read.
    """
    hashes = {
        Path(os.path.relpath(path, file.parent)).as_posix(): digest(path)
        for path in (file, *named_files(file))
    }
    model = ModelFiles(file.parent, file.name, engines, hashes, (file.name,), frozenset(hashes))
    return FolderFiles(file, "", (model,), (), robot)


def hashed_again(before: FolderFiles, apart: Path) -> FolderFiles:
    """Hash the same folder or robot file once more.

    Raises:
        OSError: for a file that can't be read.
    """
    if before.robot is None:
        return folder_files(before.folder, apart)
    return robot_file(before.folder, before.models[0].engines, before.robot)


def with_reads(model: ModelFiles | None, reads: Mapping[str, str]) -> dict[str, str]:
    """Return what a model's cases depend on: its files, and what its folder's code asked besides.

    The content of what lies in the folder and is no hidden file is in one hash with all that lies
    there. What else the code asked of such a file is under its name with `./` before it.
    """
    if model is None:
        return {}
    besides = {}
    for name, state in reads.items():
        if name not in model.beside:
            besides[name] = state
        elif more := without_content(state):
            besides[f"./{name}"] = more
    return {**besides, **model.hashes}


def as_now(model: ModelFiles, accepted: Mapping[str, str]) -> dict[str, str]:
    """Return the same with what was read when it was accepted, as that is now, running nothing.

    Code that is as it was, and finds what it found then, reads what it has read.
    """
    besides = {
        name: state
        for name, state in accepted.items()
        if name not in model.hashes and name != BESIDE
    }
    return {**states_now(model.folder, besides), **model.hashes}


def changed_names(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Return the names in two such tables that differ.

    What code looked for in one of two runs alone did not change: it may have found that loaded.
    """

    def differs(name: str) -> bool:
        both = then.get(name), now.get(name)
        return both[0] != both[1] and (None not in both or any(map(is_content, filter(None, both))))

    return [name for name in sorted({*then, *now}) if differs(name)]


def _together(hashes: dict[str, str]) -> str:
    text = "\n".join(f"{name} {value}" for name, value in sorted(hashes.items()))
    return digest_of(text.encode(errors="surrogateescape"))


def _inside(folder: Path, apart: Path | None) -> Iterator[str]:
    """Names of all files in a folder and below, but hidden ones, caches and this tool's own."""
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
