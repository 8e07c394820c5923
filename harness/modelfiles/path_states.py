"""What code can learn of a path, as words that a later run compares: content, kind, names, times.

A word is one of
- 16 hexadecimal digits: the hash of a file's content;
- `absent`, `file`, `folder`, `other`: what is there;
- `names:HASH`: the names in a folder; `entries:HASH`: with their sizes and times;
- `access:WORD`: what of it is allowed, of reading, writing and running;
- `times:HASH`: mode, size and time of modification; `link:HASH`: where a symbolic link points;
- `modules:NAME=FILE,...`: which file of a folder an import of each name finds; empty: none.

Several words of one path are joined by `; `.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Mapping
from importlib.machinery import BYTECODE_SUFFIXES, EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from pathlib import Path

from physics_crosscheck.harness.modelfiles.reading import read_regular

ABSENT = "absent"
UNREADABLE = "can't be read"
"""In the place of a hash; never as accepted."""

_JOIN = "; "

Way = Callable[[str], str]
"""Returns the word of a path."""


def digest(path: Path) -> str:
    """Hash of a file's content, 16 hexadecimal digits; line ends of a text don't count."""
    return digest_of(read_regular(path))


def digest_of(data: bytes) -> str:
    """Hash of the content of a file. Git may hand out the same text with other line ends."""
    if b"\0" not in data:
        data = data.replace(b"\r\n", b"\n")
    return hashlib.sha256(data).hexdigest()[:16]


def content(path: str) -> str:
    """Return the hash of a file, or the names of a folder: what opening it to read gives."""
    there = kind(path)
    if there == ABSENT:
        return ABSENT
    return names(path) if there == "folder" else digest(Path(path))


def kind(path: str) -> str:
    """Return what is there: a file, a folder, something else, or nothing."""
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
    """Return the hash of where a symbolic link points; what is there where it is none."""
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


def modules(found: Mapping[str, str]) -> str:
    """Return the word for the modules that were looked for in a folder: their files by name."""
    return "modules:" + ",".join(f"{name}={found[name]}" for name in sorted(found))


def joined(words: Mapping[str, None]) -> str:
    """Return the state of a path of its words."""
    return _JOIN.join(words)


def merged(*several: Mapping[str, str]) -> dict[str, str]:
    """Return the states of paths that were noted more than once: with all of their words."""
    found: dict[str, dict[str, None]] = {}
    for one in several:
        for name, state in one.items():
            found.setdefault(name, {}).update(dict.fromkeys(state.split(_JOIN)))
    return {name: joined(words) for name, words in found.items()}


def is_content(state: str) -> bool:
    """Return whether a state is the hash of a file's content alone."""
    return len(state) == 16 and all(digit in "0123456789abcdef" for digit in state)


def without_content(state: str) -> str:
    """Return the words of a state but the hash of the content."""
    return _JOIN.join(word for word in state.split(_JOIN) if not is_content(word))


def state_now(folder: Path, name: str, before: str) -> str:
    """Return the state of a path now, in the words that it had before.

    Args:
        folder: that the name is relative to.
        name: of the path.
        before: its state then; empty: the hash of its content is wanted.
    """
    path = os.path.join(folder, name)
    try:
        words = [_word_now(path, word) for word in before.split(_JOIN)]
    except (OSError, ValueError):
        return UNREADABLE
    return joined(dict.fromkeys(words))


def states_now(folder: Path, before: Mapping[str, str]) -> dict[str, str]:
    """Return the states of paths now, by name relative to a folder, in the words of before."""
    return {name: state_now(folder, name, before[name]) for name in before}


def _word_now(path: str, word: str) -> str:
    way, _, rest = word.partition(":")
    if way == "modules":
        known = [pair.partition("=")[0] for pair in rest.split(",")]
        return modules({name: module_file(path, name) for name in known})
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
        with os.scandir(path) as found:
            lines = sorted(f"{entry.name}{more(entry)}" for entry in found)
    except (FileNotFoundError, NotADirectoryError):
        return kind(path)
    return f"{way}:{digest_of(os.fsencode(chr(10).join(lines)))}"


def _times(found: os.stat_result) -> str:
    return f" {found.st_mode} {found.st_size} {found.st_mtime_ns}"
