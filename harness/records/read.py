"""Read records from JSON strictly: any invalid input is rejected with a one-sentence error."""

import errno
import json
import stat
from pathlib import Path
from typing import TypeVar

import msgspec

from .base import Record
from .results import SCHEMA, Results

R = TypeVar("R", bound=Record)


class ResultsError(ValueError):
    """A results file that can't be read; the message names file, place and remedy."""


class DecodeError(ValueError):
    """Text that is invalid JSON or has the wrong structure; gives the problem and its place."""


def decoded(data: bytes, wanted: type[R]) -> R:
    """Decode a record.

    Raises:
        DecodeError: if the text is invalid JSON or has the wrong structure.
    """
    try:
        record = msgspec.json.decode(data, type=wanted)
        json.loads(data, object_pairs_hook=_once)
        return record
    except msgspec.ValidationError as error:
        raise DecodeError(f"malformed: {_error_text(error)}") from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise DecodeError(f"not JSON: {_error_text(error)}") from None


def _once(pairs: list[tuple[str, object]]) -> None:
    """Reject an object with a duplicate key, which would lose a value."""
    keys = [key for key, _ in pairs]
    for key in keys:
        if keys.count(key) > 1:
            raise DecodeError(f"malformed: Object has the key `{key}` twice")


def _error_text(error: Exception) -> str:
    return " ".join(str(error).split())


class _ResultsHead(msgspec.Struct):
    """The field that distinguishes another schema from a broken file."""

    schema: int


def read_results(path: Path) -> Results:
    """Read results.json.

    Raises:
        ResultsError: if the file is missing, broken or of another schema, or cases contradict
            themselves.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # reading a pipe would block
            raise OSError(errno.EINVAL, "it is not a file")
        data = path.read_bytes()
    except OSError as error:
        reason = f"can't be read: {error.strerror}; run `crosscheck run` first"
        raise ResultsError(f"{path}: {reason}") from None
    again = "run `crosscheck run` again"
    try:
        schema = msgspec.json.decode(data, type=_ResultsHead).schema
    except msgspec.ValidationError:
        schema = None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        schema = SCHEMA  # invalid JSON: reported below
    if schema != SCHEMA:
        raise ResultsError(f"{path}: not a results file of schema {SCHEMA}; {again}")
    try:
        results = decoded(data, Results)
    except DecodeError as error:
        raise ResultsError(f"{path}: {error}; {again}") from None
    for i, case in enumerate(results.cases):
        if why := case.contradiction(results.resolution):
            raise ResultsError(f"{path}: `$.cases[{i}]`, {case.id}: {why}; {again}")
    return results
