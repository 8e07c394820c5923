"""The files that a model of bodies needs: what it includes, and meshes where they have a say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from physics_crosscheck.harness.modelfiles.parts import PartError, check_parts, parts
from physics_crosscheck.harness.modelfiles.reading import read_regular
from physics_crosscheck.harness.scaffold.assets import MEANT
from physics_crosscheck.harness.scaffold.folder import NewError


def included(model: Path) -> dict[str, bytes]:
    """Relative path -> content of the models that a model file includes, at any depth.

    Raises:
        NewError: for one that may do harm, or is not below the model's folder.
    """
    try:
        check_parts(model)
    except PartError as error:
        raise NewError(str(error)) from None
    return dict(_read(model, [path for path, part in parts(model).items() if part], strict=True))


def besides(model: Path) -> list[Path]:
    """All else that it names and that is there: meshes, height fields, textures."""
    return [path for path, part in parts(model).items() if not part]


def called(paths: Iterable[Path], names: Iterable[str]) -> list[Path]:
    """Those of some files that are meant by names: in any folder that they are looked for in."""
    ends = [PurePosixPath(name).parts for name in names]
    # A whole path is cut by some (`strippath`), so that the last part has to do.
    exact = [path for path in paths if any(path.parts[-len(end) :] == end for end in ends)]
    last = {end[-1] for end in ends} - {path.name for path in exact}
    return [path for path in paths if path in exact or path.name in last]


def contents(model: Path, paths: Iterable[Path]) -> dict[str, bytes]:
    """Relative path -> content of files that a model file names; none of those elsewhere.

    Raises:
        NewError: for one that can't be read.
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
    """Its place in a folder; None where it is elsewhere."""
    try:
        within = PurePosixPath(path.relative_to(folder).as_posix())
    except ValueError:
        return None
    return None if ".." in within.parts else within
