"""Resolve names to a model in its system folder, a folder, or a robot file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from physics_crosscheck.harness.engines.registry import engines, engines_to_run, missing
from physics_crosscheck.harness.extras.notebook.trajectory import MotionError
from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.modelfiles.folders import FORMATS, check_engines, system_folders
from physics_crosscheck.harness.modelfiles.model_files import check_springs, model_files
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.planning.options import check_text

Name = str | PathLike[str]


@dataclass(frozen=True, kw_only=True)
class Subject:
    """A mechanism, and a file that models it.

    Attributes:
        folder: folder with `system.py`; None for a robot file without one.
        file: the model file; None for the folder as a whole.
    """

    folder: Path | None
    file: Path | None

    @property
    def place(self) -> Path:
        """Path that messages name."""
        found = self.file or self.folder
        assert found is not None
        return found

    @property
    def base(self) -> Path:
        """Folder that file names are relative to."""
        return self.place.parent if self.folder is None else self.folder


def model_named(name: Name) -> Subject:
    """Return the model file that a name refers to.

    Raises:
        MotionError: if there is no such model, with the alternatives.
        TypeError: if the name is not a path.
    """
    check_text(name, "model", path=True)
    text = str(name)
    found = named_model(text)
    if found is not None:
        if found.scenario or found.engine:
            raise MotionError(
                f"{text} is a case; name its model, {found.folder / found.model}, and scenario and"
                " engine apart from it"
            )
        return Subject(folder=found.folder, file=found.folder / found.model)
    robots = robot_files([text])
    if robots.files:
        return Subject(folder=None, file=robots.files[0])
    if robots.faults:
        raise MotionError(next(iter(robots.faults.values())))
    (folder,) = _one(system_folders([text]), text)
    names = [one.model.name for one in model_files(folder) if isinstance(one, Sidecar)]
    raise MotionError(f"{text} is a system folder; name a model file in it: {_listed(names)}")


def system_named(name: Name) -> Subject:
    """Return the mechanism that a name refers to.

    Raises:
        MotionError, FolderError: if there is no such system, with the alternatives.
        TypeError: if the name is not a path.
    """
    check_text(name, "system", path=True)
    text = str(name)
    found = named_model(text)
    if found is not None:
        return Subject(folder=found.folder, file=None)
    if Path(text).suffix in FORMATS:
        return Subject(folder=None, file=model_named(text).file)
    (folder,) = _one(system_folders([text]), text)
    return Subject(folder=folder, file=None)


def sidecar_of(file: Path) -> Sidecar:
    """Return the sidecar of a model file in its folder.

    Raises:
        SidecarError: naming file, key and remedy.
    """
    return read_sidecar(Path(f"{file}.toml"))


def engine_for(subject: Subject, asked: str | None) -> str:
    """Return the requested engine, or the first installed engine that runs a file.

    Raises:
        MotionError, FolderError, SidecarError: with the engines that run it, or an install command.
        TypeError: if the name is not a string.
    """
    assert subject.file is not None
    if asked is not None:
        check_text(asked, "engine")
        check_engines([asked])
    known = engines()
    if subject.folder is None:
        names = [engine.name for engine in engines_to_run(subject.file.suffix)]
        fits = asked is None or subject.file.suffix in known[asked].formats
    else:
        sidecar = sidecar_of(subject.file)
        names = [*sidecar.engines, *sidecar.absent]
        fits = asked is None or asked in names
    if not fits:
        why = "" if subject.folder is None else f" (see {subject.file.name}.toml)"
        raise MotionError(f"{subject.file} does not run in {asked}, only in {_listed(names)}{why}")
    wanted = [asked] if asked is not None else names
    for name in wanted:
        if name in known and known[name].version() is not None:
            if subject.folder is not None:
                check_springs(sidecar, known[name])
            return name
    told = "; ".join(missing(known[name]) for name in wanted if name in known)
    raise MotionError(f"{subject.file}: {told or 'no engine that is known runs it'}")


def _one(folders: list[Path], name: str) -> list[Path]:
    if len(folders) != 1:
        names = _listed(folder.name for folder in folders)
        raise MotionError(
            f"{name} holds {len(folders)} systems, of which one is to be named: {names}"
        )
    return folders


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
