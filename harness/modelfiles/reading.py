"""Reading what somebody else has put into a folder: plain files alone, and none without an end."""

from __future__ import annotations

import errno
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

MOST_MODEL = 64 * 2**20
"""Bytes of a model file, or of a part of one."""

MOST_SIDECAR = 2**20
"""Bytes of a sidecar: more than ten thousand bindings."""

MOST_DEPTH = 20
"""Tables and arrays in one another, of TOML."""

_MOST_PARTS = 100
_MANY_DIGITS = re.compile(r"[0-9_]{300}")

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFDIR: "a folder",
}


def read_regular(path: Path, most: int | None = None) -> bytes:
    """The bytes of a plain file; what might never end, a pipe or a device, is not even opened.

    Args:
        path: of the file, or of a link to it.
        most: bytes that it may have.

    Raises:
        OSError: for what is no plain file, is larger, or can't be read.
    """
    found = os.stat(path)
    if not stat.S_ISREG(found.st_mode):
        raise no_plain_file(path, found.st_mode)
    if most is not None and found.st_size > most:
        size = f"{found.st_size / 2**20:.1f} MB; at most {most / 2**20:g} MB are allowed"
        raise OSError(errno.EFBIG, f"it has {size}", str(path))
    return path.read_bytes()


def no_plain_file(path: Path, mode: int) -> OSError:
    """The error for something that is no plain file, by its mode."""
    kind = _KINDS.get(stat.S_IFMT(mode), "not a file")
    return OSError(errno.EINVAL, f"it is {kind}; expected a file", str(path))


class TomlError(ValueError):
    """A text that is no TOML, or none that is read; begins with `:line:` where it is known."""


def toml_document(text: str) -> dict[str, Any]:
    """Read a text as TOML.

    Raises:
        TomlError: for what is none, for tables in one another without end, and for numbers of more
            than 64 bits, which TOML has none of.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        # The parser's time grows with the square of a key's parts.
        if line.partition("=")[0].count(".") > _MOST_PARTS and not line.lstrip().startswith("#"):
            raise TomlError(f":{number}: a key of more than {_MOST_PARTS} parts")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f": not TOML: {error}") from None
    except RecursionError:
        raise TomlError(f": more than {MOST_DEPTH} nested tables or arrays") from None
    except ValueError:  # Python reads no integer of more than 4300 digits
        found = _MANY_DIGITS.search(text)
        line_ = f":{text.count(chr(10), 0, found.start()) + 1}" if found else ""
        raise TomlError(f"{line_}: a number has too many digits to read") from None
    _check_values(data)
    return data


def _check_values(data: dict[str, Any]) -> None:
    level: list[Any] = [data]
    for _ in range(MOST_DEPTH):
        level = [
            inner
            for value in level
            for inner in (
                value.values()
                if isinstance(value, dict)
                else value
                if isinstance(value, list)
                else ()
            )
        ]
        if any(isinstance(value, int) and value.bit_length() > 64 for value in level):
            raise TomlError(": a whole number of more than 64 bits; write it with an exponent")
    if any(isinstance(value, dict | list) for value in level):
        raise TomlError(f": more than {MOST_DEPTH} nested tables or arrays")
