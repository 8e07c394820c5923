"""Folder of the accepted baseline: one readable JSON file per system, and the accepted texts.

Each quantity has its own line, in a stable order, so that a diff shows exactly what changed.
"""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from physics_crosscheck.harness.documents.reading import MAX_MODEL_BYTES, read_regular
from physics_crosscheck.harness.modelfiles.code_reads import digest_of
from .file import BaselineFileError, SystemBaseline, file_text, read_file, read_target

T = TypeVar("T")

MAX_BYTES = 512 * 2**20
"""Maximum size of a file, enough for thousands of cases."""

ACCEPTED = ".accepted"
"""Suffix of accepted texts, so that no tool takes them for models or code."""


class BaselineError(ValueError):
    """An unreadable or invalid baseline; the message gives the file, the place and the remedy."""


def read_baseline(folder: Path) -> dict[str, SystemBaseline]:
    """Read all systems of a baseline by name; empty if the folder does not exist.

    Raises:
        BaselineError: for an invalid file.
    """
    files = {path.relative_to(folder).with_suffix("").as_posix(): path for path in _files(folder)}
    return {name: _read(path, partial(read_file, system=name)) for name, path in files.items()}


def named_targets(folder: Path) -> list[tuple[str, bool]]:
    """Return the folders and robot files that a baseline names, and which are robot files.

    Raises:
        BaselineError: for a file without a folder or a robot file.
    """
    return [_read(path, read_target) for path in _files(folder)]


def _files(folder: Path) -> list[Path]:
    if folder.exists() and not folder.is_dir():
        raise BaselineError(
            f"{folder}: is not a folder; a baseline is a folder with one file per system"
        )
    return sorted(folder.rglob("*.json"))


def _read(path: Path, reader: Callable[[bytes], T]) -> T:
    try:
        return reader(read_regular(path, MAX_BYTES))
    except OSError as error:
        reason = f"can't be read: {error.strerror}"
    except BaselineFileError as error:
        reason = " ".join(str(error).split())
    raise BaselineError(f"{path}: {reason}")


def accepted_text(folder: Path, system: str, name: str, wanted: str) -> str | None:
    """Return the accepted text of a file, if it is stored and has the wanted hash."""
    with suppress(OSError, UnicodeDecodeError):
        data = read_regular(_text_path(folder, system, name), MAX_MODEL_BYTES)
        if digest_of(data) == wanted:
            return data.decode("utf-8")
    return None


def _text_path(folder: Path, system: str, name: str) -> Path:
    """Return the place of an accepted text; one from outside of the model's folder lies in `__`."""
    parts = ("__" if part == ".." else part for part in name.split("/"))
    return folder.joinpath(system, *parts).with_name(Path(name).name + ACCEPTED)


def write_baseline(
    folder: Path, systems: Sequence[SystemBaseline], texts: Mapping[tuple[str, str], bytes]
) -> list[Path]:
    """Write systems, and texts by (system, file name); return the files that changed.

    All files are written to temporary names first and then renamed, so that a full disk or a killed
    run leaves the old baseline intact. Unneeded texts are removed, and the file of a system without
    cases.

    Raises:
        OSError: from the file system; nothing has changed then.
    """
    wanted: dict[Path, bytes | None] = {}
    for system_baseline in systems:
        wanted |= _wanted_texts(folder, system_baseline, texts)
    # Rename the entries last: their hashes identify the texts that belong to them.
    for system_baseline in systems:
        wanted[folder / f"{system_baseline.system}.json"] = (
            file_text(system_baseline).encode() if system_baseline.cases else None
        )
    changed = {path: data for path, data in wanted.items() if _bytes(path) != data}
    _replace(changed)
    return list(changed)


def _wanted_texts(
    folder: Path, system_baseline: SystemBaseline, texts: Mapping[tuple[str, str], bytes]
) -> dict[Path, bytes | None]:
    """Return the new content of a system's accepted texts; None to remove one."""
    kept = {
        _text_path(folder, system_baseline.system, name): texts.get((system_baseline.system, name))
        for name in _texts_of(system_baseline)
    }
    here = folder / system_baseline.system
    # Below the name of a folder there may be other systems; below that of a file there are none.
    stored = here.glob if system_baseline.robot is None else here.rglob
    gone = dict.fromkeys(sorted(path for path in stored(f"*{ACCEPTED}") if path not in kept))
    return {**gone, **{path: text for path, text in sorted(kept.items()) if text is not None}}


def _replace(changed: Mapping[Path, bytes | None]) -> None:
    """Write or remove files, all or none as far as writing can fail."""
    staged: dict[Path, str] = {}
    try:
        for path, data in changed.items():
            if data is not None:
                staged[path] = _stage(path, data)
        for path, data in changed.items():
            if data is None:
                path.unlink(missing_ok=True)
            else:
                os.replace(staged.pop(path), path)
    finally:
        for temporary in staged.values():
            os.unlink(temporary)


def _texts_of(system_baseline: SystemBaseline) -> set[str]:
    """Return the files whose accepted text is kept: models, their sidecars and the declaration; of
    a robot file, all files that are texts.
    """
    if system_baseline.robot is not None:
        return {name for case in system_baseline.cases.values() for name in case.files}
    models = {case.model for case in system_baseline.cases}
    return {"system.py", *models, *(f"{model}.toml" for model in models)} if models else set()


def _bytes(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None


def _stage(path: Path, data: bytes) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
    except BaseException:
        os.unlink(temporary)
        raise
    return temporary
