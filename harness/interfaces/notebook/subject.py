"""Resolve names to a model in its system folder, a folder, or a robot file."""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from physics_crosscheck.harness.documents.expanded import XACRO
from physics_crosscheck.harness.engines.registry import engines, engines_to_run, missing
from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.modelfiles.folders import FORMATS, check_engines, system_folders
from physics_crosscheck.harness.modelfiles.model_files import check_springs, only_model
from physics_crosscheck.harness.modelfiles.robot_targets import ROBOT, robot_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.planning.options import check_text
from .trajectory import MotionError

Name = str | PathLike[str]


@dataclass(frozen=True, kw_only=True)
class NotebookSubject:
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
        path = self.file or self.folder
        assert path is not None
        return path

    @property
    def base(self) -> Path:
        """Folder that file names are relative to."""
        return self.place.parent if self.folder is None else self.folder


def model_named(name: Name) -> NotebookSubject:
    """Return the model file that a name refers to; of a folder, its only one.

    Raises:
        MotionError, FolderError: if there is no such model, with the alternatives.
        TypeError: if the name is not a path.
    """
    check_text(name, "model", path=True)
    text = str(name)
    built_in = named_model(text)
    if built_in is not None:
        if built_in.scenario or built_in.engine:
            raise MotionError(
                f"{text} is a case; name its model, {built_in.folder / built_in.model}, and"
                " scenario and engine apart from it"
            )
        return NotebookSubject(folder=built_in.folder, file=built_in.folder / built_in.model)
    robots = robot_files([text], None)
    if robots.files:
        return NotebookSubject(folder=None, file=robots.files[0])
    if robots.faults:
        raise MotionError(next(iter(robots.faults.values())))
    (folder,) = _single_folder(system_folders([text]), text)
    return NotebookSubject(folder=folder, file=only_model(folder))


def system_named(name: Name) -> NotebookSubject:
    """Return the mechanism that a name refers to.

    Raises:
        MotionError, FolderError: if there is no such system, with the alternatives.
        TypeError: if the name is not a path.
    """
    check_text(name, "system", path=True)
    text = str(name)
    built_in = named_model(text)
    if built_in is not None:
        return NotebookSubject(folder=built_in.folder, file=None)
    if Path(text).suffix in (*FORMATS, XACRO) or text.startswith(ROBOT):
        return NotebookSubject(folder=None, file=model_named(text).file)
    (folder,) = _single_folder(system_folders([text]), text)
    return NotebookSubject(folder=folder, file=None)


def sidecar_of(file: Path) -> Sidecar:
    """Return the sidecar of a model file in its folder.

    Raises:
        SidecarError: naming file, key and remedy.
    """
    return read_sidecar(Path(f"{file}.toml"))


def engine_for(subject: NotebookSubject, requested: str | None) -> str:
    """Return the requested engine, or the first installed engine that runs a file.

    Raises:
        MotionError, FolderError, SidecarError: with the engines that run it, or an install command.
        TypeError: if the name is not a string.
    """
    assert subject.file is not None
    if requested is not None:
        check_text(requested, "engine")
        check_engines([requested])
    all_engines = engines()
    if subject.folder is None:
        names = [engine.name for engine in engines_to_run(subject.file.suffix)]
        fits = requested is None or subject.file.suffix in all_engines[requested].formats
    else:
        sidecar = sidecar_of(subject.file)
        names = [*sidecar.engines, *sidecar.absent]
        fits = requested is None or requested in names
    if not fits:
        why = "" if subject.folder is None else f" (see {subject.file.name}.toml)"
        raise MotionError(
            f"{subject.file} does not run in {requested}, only in {_listed(names)}{why}"
        )
    wanted = [requested] if requested is not None else names
    for name in wanted:
        if name in all_engines and all_engines[name].version() is not None:
            if subject.folder is not None:
                check_springs(sidecar, all_engines[name])
            return name
    hints = "; ".join(missing(all_engines[name]) for name in wanted if name in all_engines)
    raise MotionError(f"{subject.file}: {hints or 'no engine that is known runs it'}")


def _single_folder(folders: list[Path], name: str) -> list[Path]:
    if len(folders) != 1:
        names = _listed(folder.name for folder in folders)
        raise MotionError(
            f"{name} holds {len(folders)} systems, of which one is to be named: {names}"
        )
    return folders


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
