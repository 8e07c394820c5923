"""Files that a model of bodies needs: included models, and meshes that affect it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.modelfiles.parts import PartError, check_parts, parts
from physics_crosscheck.harness.scaffold.assets import MEANT
from physics_crosscheck.harness.scaffold.folder import NewError


def included(model: Path) -> dict[str, bytes]:
    """Return relative path -> content of the models that a model file includes, at any depth.

    Raises:
        NewError: if a model is unsafe to copy or not below the model's folder.
    """
    try:
        check_parts(model)
    except PartError as error:
        raise NewError(str(error)) from None
    return dict(_read(model, [path for path, part in parts(model).items() if part], strict=True))


def besides(model: Path) -> list[Path]:
    """Return all other existing files that it names: meshes, height fields, textures."""
    return [path for path, part in parts(model).items() if not part]


def called(paths: Iterable[Path], names: Iterable[str]) -> list[Path]:
    """Return the files that match names, in any folder that engines search."""
    ends = [PurePosixPath(name).parts for name in names]
    # Some engines strip folders from a path (`strippath`), so compare the last parts.
    exact = [path for path in paths if any(path.parts[-len(end) :] == end for end in ends)]
    last = {end[-1] for end in ends} - {path.name for path in exact}
    return [path for path in paths if path in exact or path.name in last]


def contents(model: Path, paths: Iterable[Path]) -> dict[str, bytes]:
    """Return relative path -> content of files that a model file names, within its folder only.

    Raises:
        NewError: if a file can't be read.
    """
    return dict(_read(model, paths, strict=False))


def _read(model: Path, paths: Iterable[Path], *, strict: bool) -> Iterator[tuple[str, bytes]]:
    for path in paths:
        within = _below(path, model.parent)
        if within is None or within.suffix in MEANT:
            if strict:
                why = (
                    (f"a system folder runs or reads files that end with {path.suffix}: rename it")
                    if within is not None
                    else "which is not below its folder; copy it into the folder"
                )
                raise NewError(f"{model}: it needs {path}, {why}")
            continue
        try:
            yield str(within), read_regular(path)
        except OSError as error:
            raise NewError(f"{model}: it needs {path}: {error.strerror}") from None


def _below(path: Path, folder: Path) -> PurePosixPath | None:
    """Return a path relative to a folder; None if it is outside."""
    try:
        within = PurePosixPath(path.relative_to(folder).as_posix())
    except ValueError:
        return None
    return None if ".." in within.parts else within
