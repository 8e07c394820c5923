"""results.json: assembled, made plain JSON, written whole or not at all, read back checked."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import math
import os
import platform
import tempfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

SCHEMA = 1


class ResultsError(ValueError):
    """A results file that can't be read; the message names file, place and remedy."""


def results(
    systems: Sequence[Mapping[str, Any]],
    models: Sequence[Mapping[str, Any]],
    cases: Sequence[Mapping[str, Any]],
    engines: Mapping[str, str | None],
    resolution: float,
    seconds: float,
    baseline: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Assemble the results of a run; NaN and infinity become null."""
    since = {} if baseline is None else {"baseline": baseline}
    plain: dict[str, Any] = _plain(
        {
            "schema": SCHEMA,
            "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "versions": {
                "physics-crosscheck": _own_version(),
                "python": platform.python_version(),
                **engines,
            },
            "resolution": resolution,
            "seconds": seconds,
            "systems": list(systems),
            "models": list(models),
            "cases": [{k: v for k, v in case.items() if k != "place"} for case in cases],
            **since,
        }
    )
    return plain


def _own_version() -> str:
    try:
        return importlib.metadata.version("physics-crosscheck")
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def schema() -> dict[str, Any]:
    """The JSON Schema of results.json."""
    text = resources.files(__package__).joinpath("results.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all: a temporary file beside it, then a rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def write_results(path: Path, found: Mapping[str, Any]) -> None:
    """Write results.json."""
    write_whole(path, json.dumps(found, allow_nan=False, separators=(",", ":")) + "\n")


def read_results(path: Path) -> dict[str, Any]:
    """Read results.json.

    Raises:
        ResultsError: for a file that is missing, broken or of another schema.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = f"can't be read: {error.strerror}; run `crosscheck run` first"
        raise ResultsError(f"{path}: {reason}") from None
    except ValueError as error:
        raise ResultsError(f"{path}: no JSON: {error}; run `crosscheck run` again") from None
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise ResultsError(f"{path}: not results of schema {SCHEMA}; run `crosscheck run` again")
    return found
