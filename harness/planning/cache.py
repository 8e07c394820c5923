"""What earlier runs found, by all that it depends on: a run takes it from there.

A file of JSON for each piece of work, named by the hash of what it is and depends on: the contents
of the folder, engine and versions, and the source of this package and of the engine's adapter.
With the value is the state of all that the folder's code read or looked for, which must be the same
still. Nothing in it is run, a file that can't be read as what it should be is as good as none, and
each is written whole or not at all.
"""

from __future__ import annotations

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

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.baseline.inputs import versions
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.graph import Task
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.harness.modelfiles.path_states import UNREADABLE, digest_of, states_now
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.paths import SOURCES, is_own
from physics_crosscheck.harness.planning.prepared import FolderFacts, RobotFacts
from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.survey import Audit, FileSurvey
from physics_crosscheck.harness.records.write import write_whole

LIBRARIES = ("numpy", "scipy", "sympy", "mpmath")
"""What digits come from, beside the engines and this package."""

DAYS = 30
"""What nobody asked for in so many days is dropped."""

SECONDS_A_DAY = 86_400.0


KINDS: Mapping[str, Any] = {
    "folder": FolderFacts,
    "robot": RobotFacts,
    "case": Case,
    "linearizations": tuple[EngineLinearization, ...],
    "coverage": Coverage,
    "diagnosis": Diagnosis,
    "audit": Audit,
    "survey": FileSurvey,
    "measurement": Measurement,
}
"""Of each kind of work what comes of it."""


class Piece(Record, frozen=True, kw_only=True):
    """A piece of work, and the hash of what it depends on.

    Attributes:
        kind: one of `KINDS`.
        folder, model, engine, scenario: whose; empty where it has none.
        inputs: hash of all that is known of before it is done; empty: it can't be told.
    """

    kind: str
    folder: str
    model: str = ""
    engine: str = ""
    scenario: str = ""
    inputs: str


class _Entry(Record, frozen=True, kw_only=True):
    """A file: the piece, the states of what was read for it, and what came of it."""

    piece: Piece
    reads: dict[str, str]
    value: msgspec.Raw


class Cache:
    """A folder of what was found.

    Args:
        place: the folder; made where there is none.

    Attributes:
        trouble: why nothing is kept any more, in a sentence; empty while it is.
    """

    def __init__(self, place: Path) -> None:
        self._place, self.trouble = place, ""
        with self._writing():
            place.mkdir(parents=True, exist_ok=True)
            if not (place / ".gitignore").exists():
                write_whole(place / ".gitignore", "*\n")
            self._prune()

    def find(self, piece: Piece) -> Any | None:
        """What came of a piece of work, if it was done and all is as it was; else None."""
        path = self._path(piece)
        if not piece.inputs:
            return None
        with contextlib.suppress(
            OSError, msgspec.MsgspecError, RecursionError, UnicodeDecodeError, ValueError
        ):
            entry = msgspec.json.decode(path.read_bytes(), type=_Entry)
            if entry.piece != piece or not _as_they_were(Path(piece.folder), entry.reads):
                return None
            value = msgspec.json.decode(entry.value, type=KINDS[piece.kind])
            os.utime(path)
            return value
        return None

    def keep(self, piece: Piece, value: Any, reads: Mapping[str, str]) -> None:
        """Keep what came of a piece of work; where it can't be, the run goes on without.

        Args:
            piece: the work.
            value: of its kind.
            reads: states of what was read for it, by name relative to the folder.
        """
        if self.trouble or not piece.inputs:
            return
        if UNREADABLE in reads.values():
            return
        entry = _Entry(
            piece=piece, reads=dict(reads), value=msgspec.Raw(msgspec.json.encode(value))
        )
        with self._writing():
            path = self._path(piece)
            path.parent.mkdir(exist_ok=True)
            write_whole(path, msgspec.json.encode(entry).decode())

    def _path(self, piece: Piece) -> Path:
        name = hashlib.sha256(msgspec.json.encode(piece)).hexdigest()
        return self._place / name[:2] / f"{name[2:]}.json"

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            why = f"{error.filename or self._place}: {error.strerror or error}"
            self.trouble = f"nothing more is kept in the cache: {why}"

    def _prune(self) -> None:
        """Drop what is old, once a day at most."""
        mark, now = self._place / "pruned", time.time()
        if mark.exists() and now - mark.stat().st_mtime < SECONDS_A_DAY:
            return
        for path in self._place.glob("??/*.json"):
            with contextlib.suppress(OSError):
                if now - path.stat().st_mtime > DAYS * SECONDS_A_DAY:
                    path.unlink()
        mark.touch()


def _as_they_were(folder: Path, reads: Mapping[str, str]) -> bool:
    return states_now(folder, reads) == dict(reads)


def piece_of_folder(folder: Path, *, described: bool, motion: float = 0.0) -> Piece:
    """The preparation of a folder; without `described` it has no derivation."""
    try:
        known = f"{folder_files(folder).system} {described} {motion!r} {_surroundings()}"
    except OSError:
        known = ""
    return Piece(kind="folder", folder=str(folder), inputs=known and digest_of(known.encode()))


def models_inputs(known: Mapping[ModelKey, str], motion: float = 0.0) -> dict[ModelKey, str]:
    """The hashes of models in engines, as `harness.baseline.inputs` has them, for all runs."""
    return {
        key: digest_of(f"{one} {motion!r} {_surroundings()} {_adapter(key[-1])}".encode())
        for key, one in known.items()
    }


def piece_of_robot(file: Path, options: Mapping[str, object]) -> Piece:
    """Return the preparation of a robot's file under options, with all that it names."""
    try:
        beside = file.with_name(f"{file.name}.toml").is_file()  # which is told as not read
        told = (part_digests(file), options, beside, VERSION, _surroundings())
        known = digest_of(msgspec.json.encode(told))
    except OSError:
        known = ""
    return Piece(kind="robot", folder=str(file), inputs=known)


def robot_inputs(prepared: Piece, engine: str, resolution: float) -> str:
    """The hash of a robot's file in an engine, by that of its preparation; empty where it is."""
    known = prepared.inputs
    return known and digest_of(f"{known} {engine} {resolution!r} {_adapter(engine)}".encode())


def with_snapshot(known: str, snapshot: Snapshot | None) -> str:
    """The hash of a model that is to repeat a snapshot."""
    return known and digest_of(known.encode() + msgspec.json.encode(snapshot))


@lru_cache(maxsize=1)
def _surroundings() -> str:
    """Hash of this package's source, and of the versions of what it stands on."""
    known = [
        platform.machine(),
        sys.platform,
        *(f"{name} {importlib.metadata.version(name)}" for name in LIBRARIES),
        *(f"{name} {version}" for name, version in versions().items() if version is not None),
        *map(_source, SOURCES),
    ]
    return digest_of(msgspec.json.encode(known))


@lru_cache(maxsize=64)
def _adapter(name: str) -> str:
    """Hash of the source that an engine's adapter is in; that of our own is in all."""
    file = _engine_file(name)
    return "" if file is None or is_own(str(file)) else _source(file.parent)


def _engine_file(name: str) -> Path | None:
    engine = engines().get(name)
    file = None if engine is None else inspect.getsourcefile(type(engine))
    return None if file is None else Path(file)


def _source(folder: Path) -> str:
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        found.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


class Told(msgspec.Struct):
    """What came of a task, and the states of what it read, by name relative to a folder."""

    value: Any
    reads: dict[str, str]


class Reading:
    """A task's function that tells what it reads beside."""

    def __init__(self, task: Task[Any, Any], folder: Path) -> None:
        self._function, self._folder = task.function, folder

    def __call__(self, argument: Any) -> Told:
        """Do it."""
        with record_reads(self._folder) as reads:
            value = self._function(argument)
        return Told(value, reads.states())
