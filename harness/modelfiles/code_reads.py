"""Recording of the files that a folder's code reads or searches for outside the folder.

`system.py` and a Python model file may open data or import modules from anywhere. Their results
depend on the files that they read, on missing files that they searched for, on folders that they
listed, and on sizes and times that they queried. The recording keeps each state just before the
access (`modelfiles.path_states`). It leaves out Python and installed packages, whose versions are
recorded elsewhere. It also leaves out the user's cache, as of engines that compile, and files that
the code created. Python can't observe the environment, the network, other processes, and files that
a C library opens itself.
"""

from __future__ import annotations

import builtins
import contextlib
import functools
import importlib.machinery
import importlib.util
import os
import site
import sys
import sysconfig
import threading
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from importlib.abc import PathEntryFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

from physics_crosscheck.harness.jobs.failure import package_folders
from physics_crosscheck.harness.modelfiles import path_states as states
from physics_crosscheck.harness.modelfiles.path_states import ABSENT, UNREADABLE, Way
from physics_crosscheck.harness.paths import PACKAGE, SOURCES, is_own

_SYSTEM = ("/proc", "/dev", "/sys", "/etc", "/usr/share")


class ReadRecording:
    """Paths that were read or searched for, each with its state before the access.

    Args:
        folder: the folder whose code runs.
        caller: the frame that starts the recording; its own accesses are not the code's.
    """

    def __init__(self, folder: Path, caller: FrameType | None = None) -> None:
        self._folder, self._caller = os.path.abspath(folder), caller
        self._path = tuple(sys.path)
        self._words: dict[str, dict[Way, str]] = {}
        self._modules: dict[str, dict[str, str]] = {}
        self._created: set[str] = set()
        self._removed: set[str] = set()

    def is_of_code(self) -> bool:
        """Return whether the folder's code makes the current access.

        Installed packages may be on the call stack in between, but not this package.
        """
        frame = _calling_frame()
        while frame is not None and frame is not self._caller:
            file = frame.f_code.co_filename
            if self._is_within(os.path.abspath(file)) or _origin(file) == "code":
                return True
            if _origin(file) == "ours":
                return False
            frame = frame.f_back
        return frame is None  # a foreign thread

    def lose(self) -> None:
        """Mark the recording as unusable, because the path of an access is unknown."""
        self._words["(a folder that was open)"] = {states.content: UNREADABLE}

    def note(self, path: str, way: Way) -> None:
        """Record the state of a path, unless it is recorded or irrelevant."""
        recorded_states = self._words.get(path, {})
        if way in recorded_states or not self._counts(path):
            return
        try:
            word = way(path)
        except OSError:
            word = UNREADABLE
        self._words.setdefault(path, {})[way] = word

    def note_module(self, folder: str, name: str) -> None:
        """Record which file of a folder an import of a name finds."""
        if self._counts(os.path.join(folder, "")):
            found_modules = self._modules.setdefault(folder, {})
            found_modules.setdefault(name, states.module_file(folder, name))

    def note_search(self, name: str) -> None:
        """Record the results of importing a name from folders that the code added to `sys.path`."""
        for folder in sys.path:
            here = os.path.abspath(folder)
            if folder not in self._path:
                self.note_module(here, name)

    def note_link(self, path: str) -> None:
        """Record the target of a symbolic link, except above the folder, where all paths move with
        it.
        """
        if not self._folder.startswith(os.path.join(path, "")):
            self.note(path, states.link)

    def make(self, path: str) -> None:
        """Note that the code creates a path, so that it and its content are not inputs."""
        if path not in self._words:
            self._created.add(path)

    def move(self, path: str, target: str) -> None:
        """Note that a path is moved, or removed if there is no target."""
        if path in self._words:
            self._removed.add(path)
        elif target and path in self._created:
            self.make(target)

    def states(self) -> dict[str, str]:
        """Return the states by path, relative to the folder."""
        return {
            Path(os.path.relpath(path, self._folder)).as_posix(): found
            for path, found in self._all_states().items()
        }

    def _all_states(self) -> dict[str, str]:
        words = {path: dict.fromkeys(self._relevant_states(path)) for path in self._words}
        for folder, states_found in self._modules.items():
            words.setdefault(folder, {})[states.modules(states_found)] = None
        return {
            path: states.joined(states_found)
            for path, states_found in words.items()
            if states_found
        }

    def _relevant_states(self, path: str) -> Iterator[str]:
        """Yield the states of a path, without those that a more precise one implies.

        A temporary copy that a C library has created and removed is not an input.
        """
        words = self._words[path]
        gone = path not in self._removed and not os.path.lexists(path)
        for way, word in words.items():
            if gone and word not in (ABSENT, UNREADABLE):
                continue
            if way is states.kind and word != ABSENT and len(words) > 1:
                continue
            yield word

    def _counts(self, path: str) -> bool:
        """Return whether a path is an input: neither installed nor created by the code itself."""
        if not self._is_within(path) and _installed(path):
            return False
        return not self._created or self._created.isdisjoint((path, *map(str, Path(path).parents)))

    def _is_within(self, path: str) -> bool:
        return path.startswith(f"{self._folder}{os.sep}")


_METADATA = (".dist-info", ".egg-info")
"""Folders of package metadata, wherever the package is; engines are detected there."""


def _installed(path: str) -> bool:
    """Return whether a file belongs to Python, to an installed package, to this package or the
    machine.
    """
    return path.startswith(_roots()) or os.path.dirname(path).endswith(_METADATA)


def user_cache() -> Path:
    """Return the platform's folder for a user's caches."""
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


@lru_cache(maxsize=1)
def _roots() -> tuple[str, ...]:
    python_paths = sysconfig.get_paths()
    roots = {
        python_paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib", "scripts")
    }
    roots |= {*site.getsitepackages(), site.getusersitepackages(), *package_folders(), *_SYSTEM}
    roots |= {str(folder) for folder in (PACKAGE, *SOURCES)}
    # A virtual environment has its packages here and its standard library elsewhere.
    roots |= {str(Path(os.__file__).parent)}
    version = f"python{sys.version_info[0]}{sys.version_info[1]}.zip"  # the zipped standard library
    roots |= {str(user_cache()), str(Path(os.__file__).parents[1] / version)}
    if sys.pycache_prefix:  # bytecode of this package; a folder's bytecode is not read
        roots |= {sys.pycache_prefix}
    both = {os.path.abspath(root) for root in roots} | {os.path.realpath(root) for root in roots}
    return tuple(sorted(f"{root}{os.sep}" for root in both))


@lru_cache(maxsize=1024)
def _origin(file: str) -> str:
    """Return the origin of a source file: `code` for a folder's, `ours`, or else `installed`."""
    here = os.path.abspath(file)
    if is_own(here):
        return "ours"
    return "installed" if file.startswith("<") or _installed(here) else "code"


@lru_cache(maxsize=1024)
def _standard_module(file: str) -> str:
    """Return the standard library's module of a file; empty for another file."""
    if file.startswith("<frozen "):
        return file.removeprefix("<frozen ").rstrip(">").partition(".")[0]
    for name in ("stdlib", "platstdlib"):
        root = os.path.join(os.path.realpath(sysconfig.get_path(name)), "")
        here = os.path.realpath(file)
        if here.startswith(root) and not here.startswith(os.path.join(root, "site-packages")):
            return here.removeprefix(root).replace(os.sep, "/").partition("/")[0].split(".")[0]
    return ""


def _calling_frame() -> FrameType | None:
    """Return the frame that makes the current access: the innermost outside this file."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return frame


_recordings: list[ReadRecording] = []
"""Active recordings, the innermost last; each receives all accesses."""


class _Noting(threading.local):
    """A flag per thread: a recording is active, whose own accesses are ignored."""

    on = False


_noting = _Noting()


def _call_recorder(function: Callable[..., None], *arguments: Any) -> None:
    """Call a recording function and suppress its exceptions, which would end the user's code."""
    if not _recordings or _noting.on:
        return
    _noting.on = True
    try:
        with contextlib.suppress(Exception):
            function(*arguments)
    finally:
        _noting.on = False


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Record an audit event of opening, listing, creating or moving."""
    if _recordings and event in _EVENTS:
        _call_recorder(_EVENTS[event], *arguments)


def _note(path: Any, way: Way) -> None:
    """Record that the folder's code accesses a path."""
    here = os.path.abspath(os.fsdecode(path))
    for reads in _recordings:
        if reads.is_of_code():
            reads.note(here, way)


def _opened(path: Any, mode: str | None, flags: int) -> None:
    """Record that a file is about to be opened for reading or created."""
    if isinstance(path, int):  # opened before
        return
    here = _source_of(os.path.abspath(os.fsdecode(path)))
    if mode is None:  # os.open passes flags only
        makes = bool(flags & os.O_TRUNC) or flags & _NEW == _NEW
        reads = flags & (os.O_WRONLY | os.O_APPEND) != os.O_WRONLY
    else:
        makes, reads = not {"w", "x"}.isdisjoint(mode), True
    if mode is not None and "x" in mode:
        _note(here, states.kind)
    if makes:
        _created(here, exclusive="w" not in (mode or "") and not flags & os.O_TRUNC)
    elif reads:
        _read(here)


_NEW = os.O_CREAT | os.O_EXCL


def _read(here: str) -> None:
    """Record a file whoever reads it; record a missing one only if the folder's code searches for
    it.
    """
    if states.kind(here) != "file":
        _note(here, states.content)
        return
    for reads in _recordings:
        reads.note(here, states.content)


def _source_of(path: str) -> str:
    """Return the source of a bytecode file, which Python reads in place of the source."""
    with contextlib.suppress(ValueError):
        source = importlib.util.source_from_cache(path)
        if os.path.isfile(source):
            return source
    return path


def _created(path: Any, mode: int = 0, dir_fd: int = -1, *, exclusive: bool = True) -> None:
    """Record that a path is created; with `exclusive`, creation fails if it exists."""
    if dir_fd != -1:  # inside an opened folder, which was recorded
        return
    here = os.path.abspath(os.fsdecode(path))
    if not (exclusive and os.path.lexists(here)):
        for reads in _recordings:
            reads.make(here)


def _linked(_: Any, path: Any, *dir_fds: int) -> None:
    _created(path, dir_fd=max(dir_fds))


def _moved(path: Any, target: Any, *dir_fds: int) -> None:
    if max((-1, *dir_fds)) != -1 or (isinstance(target, int) and target != -1):
        return
    where = "" if isinstance(target, int) else os.path.abspath(os.fsdecode(target))
    for reads in _recordings:
        reads.move(os.path.abspath(os.fsdecode(path)), where)


def _listed(path: Any = None, *, entries: bool = False) -> None:
    """Record that a folder is listed; its entries may expose sizes and times."""
    asking = _calling_frame()
    if isinstance(path, int) or asking is None:  # opened before
        return
    module = _standard_module(asking.f_code.co_filename)
    if module != "importlib":  # names that importlib searches for are recorded separately
        way = states.entries if entries and not module else states.names
        _note("." if path is None else path, way)


def _database(path: Any) -> None:
    """Record a database that C opens; its name may be that of a resource, `file:PATH?mode=ro`."""
    name = os.fsdecode(path)
    _note(name.removeprefix("file:").partition("?")[0] if "file:" in name else name, states.content)


_EVENTS: Mapping[str, Callable[..., None]] = {
    "open": _opened,
    "os.listdir": _listed,
    "os.scandir": functools.partial(_listed, entries=True),
    "os.mkdir": _created,
    "os.symlink": _linked,
    "os.link": _linked,
    "os.rename": _moved,
    "os.remove": _moved,
    "sqlite3.connect": _database,
    "ctypes.dlopen": lambda path: _note(path, states.content),
}
"""Audit events of Python: https://docs.python.org/3/library/audit_events.html."""


def _looked_up(path: Any, dir_fd: int | None = None, follow_symlinks: bool = True) -> None:
    """Record a query of a path that has no audit event."""
    way = _queried()
    if way is None:
        return
    where = _place(path, dir_fd)
    if where is None:
        for reads in filter(ReadRecording.is_of_code, _recordings):
            reads.lose()
    elif not follow_symlinks and os.path.islink(where):
        _note(where, states.link)
    else:
        _note(where, way)


def _queried() -> Way | None:
    """Return what is queried about a path: its kind or its times, or None if irrelevant.

    `exists`, `is_file` and similar functions query the kind only, and so do the modules of the
    standard library that compare or copy files. For `realpath` only links matter.
    """
    frame = _calling_frame()
    while frame is not None:
        module = _standard_module(frame.f_code.co_filename)
        if module not in ("genericpath", "posixpath", "ntpath", "pathlib"):
            return states.kind if module else states.times
        if frame.f_code.co_name in ("resolve", "realpath", "_joinrealpath"):
            return None
        if frame.f_code.co_name not in _ASK_TIMES:
            return states.kind
        frame = frame.f_back
    return states.times


_ASK_TIMES = ("stat", "lstat", "getsize", "getmtime", "getatime", "getctime")


def _place(path: Any, dir_fd: int | None) -> str | None:
    """Return the path of a query, also relative to an open folder, or None if unknown."""
    try:
        if isinstance(path, int):
            return os.readlink(f"/proc/self/fd/{path}")
        base = "" if dir_fd is None else os.readlink(f"/proc/self/fd/{dir_fd}")
    except OSError:
        return None
    return os.path.join(base, os.fsdecode(path))


def _noted_stat(path: Any, *rest: Any, dir_fd: int | None = None, **more: Any) -> None:
    _looked_up(path, dir_fd, more.get("follow_symlinks", True))


def _noted_link(path: Any, *rest: Any, dir_fd: int | None = None, **more: Any) -> None:
    """Record a link's target, except above the folder: all other paths are relative to it."""
    where = _place(path, dir_fd)
    if where is not None:
        here = os.path.abspath(where)
        for reads in filter(ReadRecording.is_of_code, _recordings):
            reads.note_link(here)


def _noted_access(path: Any, *rest: Any, dir_fd: int | None = None, **more: Any) -> None:
    where = _place(path, dir_fd)
    if where is not None:
        _note(where, states.access)


def _noted_lstat(path: Any, *, dir_fd: int | None = None) -> None:
    _looked_up(path, dir_fd, follow_symlinks=False)


def _noted_open(path: Any, flags: int, *rest: Any, dir_fd: int | None = None) -> None:
    """Record a file in an open folder; all others have an audit event."""
    if dir_fd is not None:
        where = _place(path, dir_fd)
        if where is None:
            for reads in filter(ReadRecording.is_of_code, _recordings):
                reads.lose()
        else:
            _opened(where, None, flags)


def _wrapped(function: Callable[..., Any], note: Callable[..., None]) -> Callable[..., Any]:
    @functools.wraps(function)
    def noted(*arguments: Any, **named: Any) -> Any:
        _call_recorder(functools.partial(note, *arguments, **named))
        if named.get("dir_fd") is None or _noting.on:
            return function(*arguments, **named)
        _noting.on = True  # its audit event would not contain the folder
        try:
            return function(*arguments, **named)
        finally:
            _noting.on = False

    for having in (os.supports_dir_fd, os.supports_fd, os.supports_follow_symlinks):
        if function in having:
            having.add(noted)
    return noted


_LOOK_UPS: Mapping[str, Callable[..., Any]] = {
    "stat": _wrapped(os.stat, _noted_stat),
    "lstat": _wrapped(os.lstat, _noted_lstat),
    "fstat": _wrapped(os.fstat, _noted_stat),
    "access": _wrapped(os.access, _noted_access),
    "readlink": _wrapped(os.readlink, _noted_link),
    "open": _wrapped(os.open, _noted_open),
}
"""Functions of `os` that query a path without an audit event, or with an incomplete one."""


@contextlib.contextmanager
def record_reads(folder: Path) -> Iterator[ReadRecording]:
    """Record the files that a folder's code reads and searches for in this block.

    Modules that an earlier folder's code imported, except installed ones, are forgotten, so that
    each folder reads its own. Their bytecode is neither read nor written, so that only the source
    matters.
    """
    _hook_once()
    _roots()  # before imports are recorded: in Python 3.12 a `Path` imports a module itself
    _forget()
    reads = ReadRecording(folder, sys._getframe(2))
    path = list(sys.path)
    imports = builtins.__import__
    before = {name: getattr(os, name) for name in _LOOK_UPS}
    _recordings.append(reads)
    try:
        for name, function in _LOOK_UPS.items():
            setattr(os, name, function)
        builtins.__import__ = _imports
        with _source_loaders():
            yield reads
    finally:
        builtins.__import__ = imports
        for name, function in before.items():
            setattr(os, name, function)
        _recordings.remove(reads)
        sys.path[:] = path


def _imports(name: str, *rest: Any, **more: Any) -> Any:
    """Replace `import`, which does not search for a module that is already loaded."""
    if _recordings and _origin(sys._getframe(1).f_code.co_filename) == "code":
        _call_recorder(_searched, name.partition(".")[0])
    return _import(name, *rest, **more)


_import = builtins.__import__


def _searched(name: str) -> None:
    for reads in _recordings:
        reads.note_search(name)


@lru_cache(maxsize=1)
def _hook_once() -> None:
    sys.addaudithook(_hook)  # stays as long as the process


def _forget() -> None:
    """Drop modules that are not installed; this package's modules are imported already."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and name != "__main__" and getattr(module, _MARK, False):
            del sys.modules[name]


_MARK = "_crosscheck_local"


class _SourceLoader(importlib.machinery.SourceFileLoader):
    """A loader that reads a module's source, never its bytecode, which may be of another source."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)

    def exec_module(self, module: Any) -> None:
        setattr(module, _MARK, True)
        super().exec_module(module)


class _Finder(importlib.machinery.FileFinder):
    """A finder that records searches in a folder, successful or not: a new file could take
    precedence.
    """

    def find_spec(self, fullname: str, target: ModuleType | None = None) -> ModuleSpec | None:
        _call_recorder(self._note, fullname.rpartition(".")[2])
        return super().find_spec(fullname, target)

    def _note(self, name: str) -> None:
        for reads in filter(ReadRecording.is_of_code, _recordings):
            reads.note_module(self.path, name)
            file = os.path.join(self.path, states.module_file(self.path, name))
            if file.endswith(tuple(importlib.machinery.EXTENSION_SUFFIXES)):
                reads.note(file, states.content)  # C loads it


def _finder(path: str) -> PathEntryFinder:
    """Return a finder for folders without installed packages, even if they do not exist yet."""
    if os.path.isfile(path) or _installed(os.path.join(os.path.abspath(path or "."), "")):
        raise ImportError
    details: list[tuple[Any, list[str]]] = [
        (importlib.machinery.ExtensionFileLoader, importlib.machinery.EXTENSION_SUFFIXES),
        (_SourceLoader, importlib.machinery.SOURCE_SUFFIXES),
        (importlib.machinery.SourcelessFileLoader, importlib.machinery.BYTECODE_SUFFIXES),
    ]
    return _Finder(path, *details)


@contextlib.contextmanager
def _source_loaders() -> Iterator[None]:
    cache = dict(sys.path_importer_cache)
    sys.path_importer_cache.clear()
    sys.path_hooks.insert(0, _finder)
    try:
        yield
    finally:
        sys.path_hooks.remove(_finder)
        sys.path_importer_cache.clear()
        sys.path_importer_cache.update(cache)
