"""Cache of results from earlier runs, by all their dependencies.

Each entry is a JSON file. Its name is the hash of the task and its inputs: the contents of the
folder, engine and versions, and the source of this package and of the engine's adapter. The entry
also holds the states of all files that the folder's code read or looked for; they must be
unchanged. No entry is executed. A malformed file is ignored, and each file is written atomically.
"""

import contextlib
import hashlib
import importlib.metadata
import inspect
import os
import platform
import sys
import time
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.baseline.fingerprint import folder_files, versions
from physics_crosscheck.harness.documents.reading import USD_OUTSIDE, USD_VARIANTS
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.graph import Task
from physics_crosscheck.harness.modelfiles.code_reads import (
    UNKNOWN,
    digest_of,
    record_reads,
    states_now,
)
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.paths import SOURCES, is_own
from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.write import write_whole

LIBRARIES = ("numpy", "scipy", "sympy", "mpmath")
"""Libraries that affect numbers, besides the engines and this package."""

DAYS = 30
"""Days after which an unused entry is removed."""

SECONDS_A_DAY = 86_400.0


class CacheKey(Record, frozen=True, kw_only=True):
    """The key of a stored result: a task, and the hash of its dependencies.

    Attributes:
        kind: Kind of the task.
        folder: System folder, or the robot file.
        model: Name of the model file; empty for the whole folder.
        engine: Name of the engine; empty for the whole folder.
        scenario: Name of the scenario; empty for tasks other than cases.
        inputs: Hash of all inputs that are known in advance; empty if unknown.
    """

    kind: str
    folder: str
    model: str = ""
    engine: str = ""
    scenario: str = ""
    inputs: str


class _Entry(Record, frozen=True, kw_only=True):
    """A cache file: the key, the states of the files that were read, and the value."""

    key: CacheKey
    reads: dict[str, str]
    value: msgspec.Raw


class Cache:
    """A folder of cached results.

    Args:
        place: the folder, created if missing.

    Attributes:
        trouble: a sentence on why results are no longer stored; empty while they are.
    """

    def __init__(self, place: Path) -> None:
        self._place, self.problem = place, ""
        with self._writing():
            place.mkdir(parents=True, exist_ok=True)
            if not (place / ".gitignore").exists():
                write_whole(place / ".gitignore", "*\n")
            self._prune()

    def find(self, key: CacheKey, result: Any) -> Any | None:
        """Return the cached value if its dependencies are unchanged, otherwise None.

        Args:
            key: key of the value.
            result: type of the value.
        """
        path = self._path(key)
        if not key.inputs:
            return None
        with contextlib.suppress(
            OSError, msgspec.MsgspecError, RecursionError, UnicodeDecodeError, ValueError
        ):
            entry = msgspec.json.decode(path.read_bytes(), type=_Entry)
            if entry.key != key or states_now(Path(key.folder), entry.reads) != entry.reads:
                return None
            value = msgspec.json.decode(entry.value, type=result)
            os.utime(path)
            return value
        return None

    def store(self, key: CacheKey, value: Any, reads: Mapping[str, str]) -> None:
        """Store a value; the run continues if that fails.

        Args:
            key: key of the value.
            value: value of the key's kind.
            reads: states of the files that were read, by name relative to the folder.
        """
        if self.problem or not key.inputs:
            return
        if UNKNOWN in reads.values():
            return
        entry = _Entry(key=key, reads=dict(reads), value=msgspec.Raw(msgspec.json.encode(value)))
        with self._writing():
            path = self._path(key)
            path.parent.mkdir(exist_ok=True)
            write_whole(path, msgspec.json.encode(entry).decode())

    def _path(self, key: CacheKey) -> Path:
        name = hashlib.sha256(msgspec.json.encode(key)).hexdigest()
        return self._place / name[:2] / f"{name[2:]}.json"

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            why = f"{error.filename or self._place}: {error.strerror or error}"
            self.problem = f"nothing more is kept in the cache: {why}"

    def _prune(self) -> None:
        """Remove old entries, at most once a day."""
        mark, now = self._place / "pruned", time.time()
        if mark.exists() and now - mark.stat().st_mtime < SECONDS_A_DAY:
            return
        for path in self._place.glob("??/*.json"):
            with contextlib.suppress(OSError):
                if now - path.stat().st_mtime > DAYS * SECONDS_A_DAY:
                    path.unlink()
        mark.touch()


def key_of_folder(folder: Path, options: Mapping[str, object]) -> CacheKey:
    """Return the key of a folder's preparation, with its options."""
    try:
        dependencies = (folder_files(folder).system, options, _environment())
        folder_hash = digest_of(msgspec.json.encode(dependencies))
    except OSError:
        folder_hash = ""
    return CacheKey(kind="target", folder=str(folder), inputs=folder_hash)


def key_of_file(file: Path, options: Mapping[str, object]) -> CacheKey:
    """Return the key of a robot file's preparation, with its options and all files that it
    names.
    """
    try:
        has_sidecar = file.with_name(f"{file.name}.toml").is_file()  # reported as not read
        dependencies = (part_digests(file), options, has_sidecar, VERSION, _environment())
        file_hash = digest_of(msgspec.json.encode(dependencies))
    except OSError:
        file_hash = ""
    return CacheKey(kind="target", folder=str(file), inputs=file_hash)


def with_environment(model_hash: str, engine: str, motion: float, thorough: bool) -> str:
    """Extend the hash of a folder's model by the packages and the adapter that affect it."""
    return model_hash and digest_of(
        f"{model_hash} {motion!r} {thorough} {_environment()} {_adapter(engine)}".encode()
    )


def file_in_engine(prepared: CacheKey, engine: str, resolution: float, thorough: bool) -> str:
    """Return the hash of a robot file in an engine, based on its preparation; "" if unknown."""
    file_hash = prepared.inputs
    return file_hash and digest_of(
        f"{file_hash} {engine} {resolution!r} {thorough} {_adapter(engine)}".encode()
    )


def with_snapshot(model_hash: str, snapshot: Snapshot) -> str:
    """Add a snapshot that the model must repeat to its hash."""
    return model_hash and digest_of(model_hash.encode() + msgspec.json.encode(snapshot))


@lru_cache(maxsize=1)
def _environment() -> str:
    """Return a hash of this package's source and of its libraries' versions."""
    version_list = [
        platform.machine(),
        sys.platform,
        *(f"{name} {importlib.metadata.version(name)}" for name in LIBRARIES),
        *(f"{name} {version}" for name, version in versions().items() if version is not None),
        *map(_source, SOURCES),
        *(os.environ.get(name, "") for name in (USD_VARIANTS, USD_OUTSIDE)),
    ]
    return digest_of(msgspec.json.encode(version_list))


@lru_cache(maxsize=64)
def _adapter(name: str) -> str:
    """Return a hash of an engine adapter's source; adapters of this package are hashed with it."""
    file = _engine_file(name)
    return "" if file is None or is_own(str(file)) else _source(file.parent)


def _engine_file(name: str) -> Path | None:
    engine = engines().get(name)
    file = None if engine is None else inspect.getsourcefile(type(engine))
    return None if file is None else Path(file)


def _source(folder: Path) -> str:
    hasher = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        hasher.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return hasher.hexdigest()


class TaskOutput(msgspec.Struct):
    """The value of a task, and the states of the files that it read, by name relative to a
    folder.
    """

    value: Any
    reads: dict[str, str]


class Reading:
    """A task's function that also records the files that it reads."""

    def __init__(self, task: Task[Any, Any], folder: Path) -> None:
        self._function, self._folder = task.function, folder

    def __call__(self, argument: Any) -> TaskOutput:
        """Call the function."""
        with record_reads(self._folder) as reads:
            value = self._function(argument)
        return TaskOutput(value, reads.states)
