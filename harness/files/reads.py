"""What a folder's code reads beside the folder's own files: recorded as it is run.

`system.py` and a Python model file may open data or import modules from anywhere. What they read
is what the outcome depends on, so a baseline keeps its hashes too. What comes with Python or was
installed is left out: its version is another matter. So is what programs keep for themselves in the
user's cache, as engines that compile do, and what no audit hook of Python sees: the environment, a
network, another process.
"""

from __future__ import annotations

import contextlib
import importlib.machinery
import os
import site
import sys
import sysconfig
from collections.abc import Iterator
from functools import lru_cache
from importlib.abc import PathEntryFinder
from pathlib import Path
from typing import Any

import physics_crosscheck
from harness.schedule.source import package_folders

_OWN = ("harness", "reference", "physics_crosscheck")
_SYSTEM = ("/proc", "/dev", "/sys", "/etc", "/usr/share")


class Reads:
    """Files that were read, as they are named where they were opened.

    Attributes:
        files: their paths, absolute, in the order in which they were opened.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = os.path.abspath(folder)
        self.files: dict[str, None] = {}

    def note(self, path: str) -> None:
        """A file was opened to be read."""
        here = os.path.abspath(path)
        within = here.startswith(f"{self._folder}{os.sep}")
        if (within or not _installed(here)) and os.path.isfile(here):
            self.files[here] = None

    def names(self) -> tuple[str, ...]:
        """The files by their places relative to the folder.

        A copy that what was run has made for itself, and that is gone, is nothing it depends on.
        """
        left = filter(os.path.isfile, self.files)
        return tuple(Path(os.path.relpath(file, self._folder)).as_posix() for file in left)


_METADATA = (".dist-info", ".egg-info")
"""Folders that say what is installed, wherever the package is; engines are looked up there."""


def _installed(path: str) -> bool:
    """Whether a file belongs to Python, to an installed package, to us or to the machine."""
    return path.startswith(_roots()) or os.path.dirname(path).endswith(_METADATA)


def user_cache() -> Path:
    """Where programs keep for a user what can be made again, as the platform has it."""
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


@lru_cache(maxsize=1)
def _roots() -> tuple[str, ...]:
    known = sysconfig.get_paths()
    roots = {known[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")}
    roots |= {*site.getsitepackages(), site.getusersitepackages(), *package_folders(), *_SYSTEM}
    roots |= {str(physics_crosscheck.BESIDE / name) for name in _OWN}
    # A virtual environment has its packages here and its standard library elsewhere.
    roots |= {str(Path(os.__file__).parent)}
    roots |= {str(user_cache())}
    if sys.pycache_prefix:  # our own modules' bytecode; a folder's is not read
        roots |= {sys.pycache_prefix}
    both = {os.path.abspath(root) for root in roots} | {os.path.realpath(root) for root in roots}
    return tuple(sorted(f"{root}{os.sep}" for root in both))


_recording: Reads | None = None
_hooked = False


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Note what is opened to be read; must not raise, since that would end what is run."""
    if _recording is None or event != "open":
        return
    path, mode, flags = arguments
    # os.open tells flags alone.
    writes = flags & (os.O_WRONLY | os.O_RDWR) if mode is None else set(mode) & set("wax+")
    if writes:
        return
    with contextlib.suppress(Exception):
        _recording.note(os.fsdecode(path))


@contextlib.contextmanager
def recorded(folder: Path) -> Iterator[Reads]:
    """Record what is read meanwhile by what is run of a folder.

    Modules that an earlier folder's code has imported from where nothing is installed are
    forgotten: each folder gets, and is seen to read, its own. Their bytecode is neither read nor
    written, so that what counts is the source.
    """
    global _recording, _hooked
    if not _hooked:
        sys.addaudithook(_hook)  # stays as long as the process
        _hooked = True
    _forget()
    before, reads = _recording, Reads(folder)
    path = list(sys.path)
    _recording = reads
    try:
        with _sources_alone():
            yield reads
    finally:
        _recording = before
        sys.path[:] = path


def _forget() -> None:
    """Drop modules from where nothing is installed; all of ours have been imported long since."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and name != "__main__" and getattr(module, _MARK, False):
            del sys.modules[name]


_MARK = "_crosscheck_local"


class _SourceLoader(importlib.machinery.SourceFileLoader):
    """Reads a module's source and never its bytecode, which may be of another source."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)

    def exec_module(self, module: Any) -> None:
        setattr(module, _MARK, True)
        super().exec_module(module)


def _finder(path: str) -> PathEntryFinder:
    """A finder for folders in which nothing is installed."""
    if _installed(os.path.join(os.path.abspath(path or "."), "")):
        raise ImportError
    details: list[tuple[Any, list[str]]] = [
        (importlib.machinery.ExtensionFileLoader, importlib.machinery.EXTENSION_SUFFIXES),
        (_SourceLoader, importlib.machinery.SOURCE_SUFFIXES),
        (importlib.machinery.SourcelessFileLoader, importlib.machinery.BYTECODE_SUFFIXES),
    ]
    return importlib.machinery.FileFinder.path_hook(*details)(path)


@contextlib.contextmanager
def _sources_alone() -> Iterator[None]:
    cache = dict(sys.path_importer_cache)
    sys.path_importer_cache.clear()
    sys.path_hooks.insert(0, _finder)
    try:
        yield
    finally:
        sys.path_hooks.remove(_finder)
        sys.path_importer_cache.clear()
        sys.path_importer_cache.update(cache)
