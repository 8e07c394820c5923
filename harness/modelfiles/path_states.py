"""The state of a path that code can observe, as words that a later run compares.

A word is one of
- 16 hexadecimal digits: the hash of a file's content;
- `absent`, `file`, `folder`, `other`: the kind;
- `names:HASH`: the names in a folder; `entries:HASH`: with their sizes and times;
- `access:WORD`: the permissions to read, write and execute;
- `times:HASH`: mode, size and time of modification; `link:HASH`: the target of a symbolic link;
- `modules:NAME=FILE,...`: the file of a folder that an import of each name finds; empty for no
file.

`; ` joins several words of one path.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Mapping
from importlib.machinery import BYTECODE_SUFFIXES, EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from pathlib import Path

from physics_crosscheck.harness.documents.reading import read_regular

ABSENT = "absent"
UNREADABLE = "can't be read"
"""Replaces a hash; never accepted as equal."""

_JOIN = "; "

Way = Callable[[str], str]
"""A function that returns the word of a path."""


def digest(path: Path) -> str:
    """Return the hash of a file's content, 16 hexadecimal digits, ignoring the line ends of a
    text.
    """
    return digest_of(read_regular(path))


def digest_of(data: bytes) -> str:
    """Return the hash of a file's content. Git may check out the same text with other line ends."""
    if b"\0" not in data:
        data = data.replace(b"\r\n", b"\n")
    return hashlib.sha256(data).hexdigest()[:16]


def content(path: str) -> str:
    """Return the hash of a file, or the names of a folder: the result of opening it to read."""
    there = kind(path)
    if there == ABSENT:
        return ABSENT
    return names(path) if there == "folder" else digest(Path(path))


def kind(path: str) -> str:
    """Return the kind of a path: a file, a folder, something else, or absent."""
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ABSENT
    if stat.S_ISREG(mode):
        return "file"
    return "folder" if stat.S_ISDIR(mode) else "other"


def names(path: str) -> str:
    """Return the hash of the names in a folder, and of which of them are folders."""
    return _listing(path, "names", lambda entry: "/" * entry.is_dir())


def entries(path: str) -> str:
    """Return the hash of the names in a folder with kinds, sizes and times."""
    return _listing(path, "entries", lambda entry: _times(entry.stat(follow_symlinks=False)))


def times(path: str) -> str:
    """Return the hash of a path's mode, size and time of modification."""
    try:
        return f"times:{digest_of(_times(os.stat(path)).encode())}"
    except (FileNotFoundError, NotADirectoryError):
        return ABSENT


def access(path: str) -> str:
    """Return what this process may do with a path: `r`, `w` and `x`."""
    if not os.path.exists(path):
        return ABSENT
    ways = {"r": os.R_OK, "w": os.W_OK, "x": os.X_OK}
    return f"access:{''.join(name for name, way in ways.items() if os.access(path, way))}"


def link(path: str) -> str:
    """Return the hash of a symbolic link's target, or the kind of another path."""
    if not os.path.islink(path):
        return kind(path)
    return f"link:{digest_of(os.fsencode(os.readlink(path)))}"


def module_file(folder: str, name: str) -> str:
    """Return the file in a folder that an import of a name finds, as `importlib` searches it."""
    suffixes = (*EXTENSION_SUFFIXES, *SOURCE_SUFFIXES, *BYTECODE_SUFFIXES)
    candidates = [f"{name}/__init__{suffix}" for suffix in suffixes]
    candidates += [f"{name}{suffix}" for suffix in suffixes]
    for candidate in candidates:
        if os.path.isfile(os.path.join(folder, candidate)):
            return candidate
    return f"{name}/" if os.path.isdir(os.path.join(folder, name)) else ""


def modules(files: Mapping[str, str]) -> str:
    """Return the word for the modules searched in a folder: their files by name."""
    return "modules:" + ",".join(f"{name}={files[name]}" for name in sorted(files))


def joined(words: Mapping[str, None]) -> str:
    """Join words into the state of a path."""
    return _JOIN.join(words)


def merged(*several: Mapping[str, str]) -> dict[str, str]:
    """Merge the states of paths that were recorded more than once, with all of their words."""
    result: dict[str, dict[str, None]] = {}
    for states in several:
        for name, state in states.items():
            result.setdefault(name, {}).update(dict.fromkeys(state.split(_JOIN)))
    return {name: joined(words) for name, words in result.items()}


def is_content(state: str) -> bool:
    """Return whether a state is the hash of a file's content alone."""
    return len(state) == 16 and all(digit in "0123456789abcdef" for digit in state)


def without_content(state: str) -> str:
    """Return the words of a state except the hash of the content."""
    return _JOIN.join(word for word in state.split(_JOIN) if not is_content(word))


def state_now(folder: Path, name: str, before: str) -> str:
    """Return the present state of a path, in the words of an earlier state.

    Args:
        folder: base of the name.
        name: of the path.
        before: its earlier state; empty requests the hash of its content.
    """
    path = os.path.join(folder, name)
    try:
        words = [_word_now(path, word) for word in before.split(_JOIN)]
    except (OSError, ValueError):
        return UNREADABLE
    return joined(dict.fromkeys(words))


def states_now(folder: Path, before: Mapping[str, str]) -> dict[str, str]:
    """Return the present states of paths, by name relative to a folder, in the words of earlier
    ones.
    """
    return {name: state_now(folder, name, before[name]) for name in before}


def _word_now(path: str, word: str) -> str:
    way, _, rest = word.partition(":")
    if way == "modules":
        names = [pair.partition("=")[0] for pair in rest.split(",")]
        return modules({name: module_file(path, name) for name in names})
    return _WAYS.get(way, content)(path)


_WAYS: Mapping[str, Way] = {
    **dict.fromkeys((ABSENT, "file", "folder", "other"), kind),
    "names": names,
    "entries": entries,
    "access": access,
    "times": times,
    "link": link,
}


def _listing(path: str, way: str, more: Callable[[os.DirEntry[str]], str]) -> str:
    try:
        with os.scandir(path) as scan:
            lines = sorted(f"{entry.name}{more(entry)}" for entry in scan)
    except (FileNotFoundError, NotADirectoryError):
        return kind(path)
    return f"{way}:{digest_of(os.fsencode(chr(10).join(lines)))}"


def _times(status: os.stat_result) -> str:
    return f" {status.st_mode} {status.st_size} {status.st_mtime_ns}"
