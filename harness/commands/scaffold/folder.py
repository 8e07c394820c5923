"""A new system folder on disk: name, files and texts of it, written whole or not at all."""

import json
import os
import re
import shutil
import tempfile
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import template

_WIDTH = 100


def comment(text: str) -> list[str]:
    """Return the lines of a comment."""
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.split()), _WIDTH - 2)]


def literal(value: object) -> str:
    """Format a setting as TOML."""
    return quoted(value) if isinstance(value, str) else json.dumps(value)


def plain(text: str) -> str:
    """Make text safe for a comment: one line, without hidden characters."""
    return "".join(c if c.isprintable() else "?" for c in text)


def quoted(text: str) -> str:
    """Return a string literal that Python and TOML read as the same text, for any name of a joint.

    Lone surrogates, from file names that are not UTF-8, become question marks, since TOML has none.
    """
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(c: str) -> str:
    if c in '"\\':
        return f"\\{c}"
    if c.isprintable():
        return c
    code = ord(c)
    if 0xD800 <= code < 0xE000:
        return "?"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_PLACEHOLDER = b"my_model"


class NewError(ValueError):
    """An error that prevents creating a folder; the message names the problem and the remedy."""


def check_name(target: Path) -> None:
    """Reject an invalid name of a system, or an existing path.

    Raises:
        NewError: naming the path.
    """
    if not _NAME.fullmatch(target.name):
        raise NewError(
            f"{target.name!r} is not a valid system name; use a letter, then "
            "letters, digits, _ or -"
        )
    if os.path.lexists(target):
        raise NewError(f"{target}: exists already; nothing was written. Choose another name")
    if not target.parent.is_dir():
        raise NewError(f"{target.parent}: no such folder for {target.name}")


def example(name: str) -> dict[str, bytes]:
    """Return the files of the example under a name: a damped pendulum for every engine."""
    return {
        path.name: path.read_bytes().replace(_PLACEHOLDER, name.encode())
        for path in sorted(template().iterdir())
        if path.is_file()
    }


def write_folder(
    target: Path, files: Mapping[str, bytes], check: Callable[[Path], None] | None = None
) -> None:
    """Write a folder whole or not at all: write a temporary sibling, check it, then rename it.

    `check` gets the temporary folder, which has the target's name. If it raises, nothing remains.

    Raises:
        NewError: if the target exists by then.
    """
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as temporary:
        folder = Path(temporary) / target.name
        for name, data in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        if check is not None:
            check(folder)
            for cache in folder.rglob("__pycache__"):
                shutil.rmtree(cache)
        try:
            if os.path.lexists(target):
                raise FileExistsError
            os.rename(folder, target)
        except OSError:
            raise NewError(f"{target}: can't be written; nothing was written") from None
