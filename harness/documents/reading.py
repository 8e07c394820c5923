"""Safe reading of untrusted files: plain files of bounded size only; the lines of their bytes."""

import difflib
import errno
import os
import re
import stat
import time
import tomllib
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from .errors import LocationError, quote, truncate

MAX_MODEL_BYTES = 64 * 2**20
"""The largest size of a model file, or of a part of one, bytes."""

MAX_SIDECAR_BYTES = 2**20
"""The largest size of a sidecar, bytes: more than ten thousand bindings."""

MAX_KEPT_BYTES = 2**22
"""The largest file whose bytes and elements are kept."""

SETTLED_SECONDS = 2.0
"""Age of the last change from which a file's times show each further change."""

MAX_TOML_DEPTH = 20
"""The deepest nesting of TOML tables and arrays."""

_MAX_KEY_PARTS = 100
_MANY_DIGITS = re.compile(r"[0-9_]{300}")

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFDIR: "a folder",
}

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
"""Suffixes of USD files."""

FLOAT_DIGITS = 5e-7
"""Largest relative rounding of numbers that USD stores in 32 bits."""

STAGE_SETTINGS = ("variants", "allow_outside")
"""Settings of engines with which a stage is opened, as of `UsdStage`."""

USD_VARIANTS, USD_OUTSIDE = "CROSSCHECK_USD_VARIANTS", "CROSSCHECK_USD_OUTSIDE"
"""Environment variables with these settings: `SET=NAME` for each variant, and `1`."""

CRATE, PACKAGE = b"PXR-USDC", b"PK\x03\x04"
"""First bytes of a binary layer and of a package, which have no lines."""

USD_HEAD = rb"\A(PXR-USDC|PK\x03\x04|#usda(?s:.*)(\"Physics\w+API\b|\bPhysics\w*Joint\b|@))"
"""Content of a layer or a package that may be a robot's: text with physics, or of other layers."""


def read_regular(path: Path, max_bytes: int | None = None) -> bytes:
    """Return the bytes of a plain file, without opening a pipe or a device, which could block.

    Files that were read last are kept, and opened again only if they change.

    Args:
        path: of the file, or of a link to it.
        max_bytes: largest allowed size.

    Raises:
        OSError: for anything but a plain file, a file that is too large, or one that can't be read.
    """
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise not_plain_file_error(path, status.st_mode)
    if max_bytes is not None and status.st_size > max_bytes:
        size = f"{status.st_size / 2**20:.1f} MB; at most {max_bytes / 2**20:g} MB are allowed"
        raise OSError(errno.EFBIG, f"it has {size}", str(path))
    changed = max(status.st_mtime_ns, status.st_ctime_ns)
    is_settled = time.time_ns() - changed > SETTLED_SECONDS * 1e9
    if status.st_size > MAX_KEPT_BYTES or not is_settled:
        return path.read_bytes()
    return _kept_bytes(path, status.st_dev, status.st_ino, status.st_size, changed)


@lru_cache(maxsize=16)
def _kept_bytes(path: Path, *_state: int) -> bytes:
    return path.read_bytes()


def not_plain_file_error(path: Path, mode: int) -> OSError:
    """Return the error for a path that is not a plain file, by its mode."""
    kind = _KINDS.get(stat.S_IFMT(mode), "not a file")
    return OSError(errno.EINVAL, f"it is {kind}; expected a file", str(path))


class TomlError(ValueError):
    """A text that is not valid or allowed TOML; begins with `:line:` if the line is known."""


def toml_document(text: str) -> dict[str, Any]:
    """Parse a text as TOML.

    Raises:
        TomlError: for invalid TOML, deeply nested tables, and numbers of more than 64 bits, which
            TOML does not allow.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        # The parser's time grows with the square of a key's parts.
        if line.partition("=")[0].count(".") > _MAX_KEY_PARTS and not line.lstrip().startswith("#"):
            raise TomlError(f":{number}: a key of more than {_MAX_KEY_PARTS} parts")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f": not TOML: {error}") from None
    except RecursionError:
        raise TomlError(f": more than {MAX_TOML_DEPTH} nested tables or arrays") from None
    except ValueError:  # Python parses no integer of more than 4300 digits
        match = _MANY_DIGITS.search(text)
        line_ = f":{text.count(chr(10), 0, match.start()) + 1}" if match else ""
        raise TomlError(f"{line_}: a number has too many digits to read") from None
    _check_values(data)
    return data


def _check_values(data: dict[str, Any]) -> None:
    level: list[Any] = [data]
    for _ in range(MAX_TOML_DEPTH):
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
        raise TomlError(f": more than {MAX_TOML_DEPTH} nested tables or arrays")


Span = tuple[int, int]
"""First byte of a number, and the one after its last."""


Resolve = Callable[[str], tuple[Span, float]]
"""A function from an address to its bytes and the parser's value there."""

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""A finite number, as model files write it."""


@dataclass(frozen=True)
class SourceFile:
    """The bytes of a file, and errors that name their lines."""

    file: Path
    data: bytes

    def line(self, offset: int) -> int:
        """Return the line of a byte, counted from 1."""
        return bisect_right(self._starts, offset)

    @cached_property
    def _starts(self) -> list[int]:
        """Offsets of the first byte of each line."""
        return [0, *(match.end() for match in re.finditer(rb"\r\n|\r|\n", self.data))]

    def column(self, offset: int) -> int:
        """Return the column of a character's first byte, counted from 1."""
        start = self._starts[self.line(offset) - 1]
        return len(self.data[start:offset].decode("utf-8").removeprefix("\ufeff")) + 1

    def text(self, span: Span) -> str:
        """Return the text between two bytes."""
        return self.data[slice(*span)].decode("utf-8")

    def lines(self, offsets: Iterable[int]) -> str:
        """Return the lines of some bytes, in words."""
        numbers = [str(self.line(offset)) for offset in offsets]
        return ("line " if len(numbers) == 1 else "lines ") + ", ".join(numbers)

    def error(self, address: str, sentence: str, offset: int | None = None) -> LocationError:
        """Return an error about an address, because of the byte at `offset`."""
        line = None if offset is None else self.line(offset)
        return LocationError(f"{quote(address)} {sentence}", file=self.file, line=line)


def nearest(wanted: str, candidates: Iterable[str]) -> str:
    """Return the names most similar to a wanted one, as a list in words; at most six."""
    names = list(dict.fromkeys(candidates))
    alike = difflib.get_close_matches(wanted, names, n=6, cutoff=0.0) if wanted else names[:6]
    more = len(names) - len(alike)
    return ", ".join(map(truncate, alike)) + (f" and {more} more" if more else "")


def apply_edits(data: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """Return a file's bytes with ranges (start, end) replaced; of overlapping ranges, the first."""
    pieces, done = list[bytes](), 0
    for start, end, new in sorted(changes):
        if start >= done:
            pieces += (data[done:start], new)
            done = end
    return b"".join((*pieces, data[done:]))
