"""All dependencies of a model's results, as one hash: equal hashes allow their reuse."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import platform
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np

from physics_crosscheck.harness.baseline.fingerprint import (
    Dependencies,
    dependencies,
    folder_files,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.path_states import UNREADABLE, digest_of
from physics_crosscheck.harness.records.case import ModelKey


def inputs(folder: Path, resolution: float, apart: Path | None) -> dict[ModelKey, str]:
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


def with_reads_of_system(model_hash: str, key: ModelKey, reads: Mapping[str, str]) -> str:
    """Add the files that `system.py` read or looked for to the hash of a model; "" if unknown.

    Args:
        model_hash: hash of the model.
        key: key of the model. A model that is code may read any file while it runs.
        reads: states of the files that were read, by name relative to the folder.
    """
    if not model_hash or Path(key[1]).suffix == ".py" or UNREADABLE in reads.values():
        return ""
    return digest_of(msgspec.json.encode([model_hash, reads], order="sorted"))


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
