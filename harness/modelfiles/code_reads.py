"""Inputs of a folder's code: files in the folder by their content, and anything elsewhere.

Results of a folder are reused while its files are unchanged. Audit events show whether its code
opens, lists or imports something outside the folder, Python, the installed packages and this
package, or starts a process. `os.stat` and similar functions have no event and are wrapped.
Such a folder always runs again, and so does one whose code queries times or links of its files.
Python can't observe the environment, or files that a C library opens itself.
"""

import contextlib
import functools
import hashlib
import importlib.util
import os
import site
import sys
import sysconfig
import threading
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from importlib.machinery import SourceFileLoader, all_suffixes
from pathlib import Path
from types import FrameType
from typing import Any

from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.jobs.failure import package_folders
from physics_crosscheck.harness.paths import IMPORT_ROOT, PACKAGE, SOURCES

ABSENT = "absent"
UNKNOWN = "unknown"
"""State of a path that can't be read, or is outside the folder; never accepted as equal."""


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
    """Return the state of a path; the names in a folder without bytecode.

    Raises:
        OSError: for a path that can't be read.
    """
    try:
        if not os.path.isdir(path):
            return digest(Path(path)) if os.path.lexists(path) else ABSENT
        with os.scandir(path) as scan:
            names = [f"{one.name}{'/' * one.is_dir()}" for one in scan if one.name != "__pycache__"]
    except (FileNotFoundError, NotADirectoryError):
        return ABSENT
    return f"names:{digest_of(os.fsencode(chr(10).join(sorted(names))))}"


def is_content(state: str) -> bool:
    """Return whether a state is the hash of a file's content."""
    return len(state) == 16 and ":" not in state


def states_now(folder: Path, before: Mapping[str, str]) -> dict[str, str]:
    """Return the present states of paths, by name relative to a folder.

    Args:
        folder: base of the names.
        before: earlier states; what was unknown remains so.
    """
    return {name: _state_now(folder / name, before[name]) for name in before}


def _state_now(path: Path, before: str) -> str:
    try:
        return before if before == UNKNOWN else content(os.path.abspath(path))
    except (OSError, ValueError):
        return UNKNOWN


MAX_OUTSIDE = 8
"""Maximum number of accesses outside a folder to record."""

_EVENTS = {"import", "open", "os.listdir", "os.scandir", "sqlite3.connect", "ctypes.dlopen"}
_PROCESS_EVENTS = {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "socket.connect"}
_EVENTS |= _PROCESS_EVENTS
"""Audit events of Python: https://docs.python.org/3/library/audit_events.html."""

_QUERIES = ("stat", "lstat", "fstat", "access", "readlink")
_TIMES = ("stat", "lstat", "fstat", "getmtime", "getatime", "getctime", "readlink")
_LIBRARY = os.path.dirname(os.path.abspath(os.__file__)) + os.sep


class ReadRecording:
    """Inputs of a folder's code besides `system.py` and the loaded model.

    Args:
        folder: the folder whose code runs.
        caller: the frame that starts the recording; its own accesses are not the code's.

    Attributes:
        states: state by path relative to the folder: of the content inside, unknown outside.
    """

    def __init__(self, folder: Path, caller: FrameType | None) -> None:
        self._folder, self._caller = os.path.abspath(folder), caller
        self._inside = (f"{self._folder}{os.sep}", f"{os.path.realpath(folder)}{os.sep}")
        self._path = {os.path.abspath(place) for place in sys.path}
        self.states: dict[str, str] = {}

    def is_of_code(self) -> bool:
        """Return whether the folder's code makes the current access, directly or not."""
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and frame is not self._caller:
            if os.path.abspath(frame.f_code.co_filename).startswith(self._inside):
                return True
            frame = frame.f_back
        return frame is None  # a foreign thread

    def note(self, path: Any) -> None:
        """Record an access to a path."""
        here = os.path.abspath(os.fsdecode(path))
        if f"{here}{os.sep}".startswith(self._inside):
            self._add_state(here)
        elif not _installed(here):
            self.note_unknown(here)

    def note_unknown(self, what: str) -> None:
        """Record that the folder always runs again, because of a path or another reason."""
        if list(self.states.values()).count(UNKNOWN) < MAX_OUTSIDE:
            path = os.path.relpath(what, self._folder) if os.path.isabs(what) else f"({what})"
            self.states[Path(path).as_posix()] = UNKNOWN

    def note_query(self, path: Any, is_of_times: bool) -> None:
        """Record a query of a path; all paths move together with the folders above the folder."""
        here = "" if isinstance(path, int) else os.path.abspath(os.fsdecode(path))
        if is_of_times and not (here and _installed(here)):
            self.note_unknown(f"times of {os.path.basename(here) or 'an open file'}")
        elif here and not self._inside[0].startswith(os.path.join(here, "")):
            self.note(here)

    def note_import(self, name: str, is_direct: bool) -> None:
        """Record a search for a module: a file of that name could appear in any local folder."""
        for place in map(os.path.abspath, sys.path):
            if place not in self._path:
                self.note(place)
            elif (
                is_direct
                and "." not in name
                and place != str(IMPORT_ROOT)
                and not _installed(place)
            ):
                for suffix in ("", *all_suffixes()):
                    self._add_state(os.path.join(place, name) + suffix)

    def _add_state(self, path: str) -> None:
        name = Path(os.path.relpath(path, self._folder)).as_posix()
        self.states.setdefault(name, content(path))


def _installed(path: str) -> bool:
    """Return whether a path belongs to Python, to an installed package or to this package."""
    metadata = (".dist-info", ".egg-info")  # wherever the package is; engines are detected there
    return f"{path}{os.sep}".startswith(_roots()) or os.path.dirname(path).endswith(metadata)


@lru_cache(maxsize=1)
def _roots() -> tuple[str, ...]:
    names = ("stdlib", "platstdlib", "purelib", "platlib", "scripts")
    roots = {sysconfig.get_path(name) for name in names} | {
        os.devnull,
        _LIBRARY,
        *map(str, SOURCES),
    }
    roots |= {str(PACKAGE), *site.getsitepackages(), site.getusersitepackages(), *package_folders()}
    version = f"python{sys.version_info[0]}{sys.version_info[1]}.zip"  # the zipped standard library
    roots |= {str(Path(_LIBRARY).parent / version), sys.pycache_prefix or os.devnull}
    both = {os.path.abspath(root) for root in roots} | {os.path.realpath(root) for root in roots}
    return tuple(sorted(f"{root}{os.sep}" for root in both))


_recordings: list[ReadRecording] = []
"""Active recordings, the innermost last; each receives all accesses."""


_noting = threading.local()
"""Its `on` is true in a thread that notes an access: its own accesses are ignored."""


def _record(note: Callable[[ReadRecording], None]) -> None:
    """Let each recording note an access by its folder's code."""
    if not _recordings or getattr(_noting, "on", False):
        return
    _noting.on = True
    try:
        for recording in filter(ReadRecording.is_of_code, _recordings):
            try:
                note(recording)
            except Exception:  # it would end the user's code
                recording.note_unknown("a path that can't be read")
    finally:
        _noting.on = False


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Record an audit event."""
    if not _recordings or getattr(_noting, "on", False) or event not in _EVENTS:
        return
    frame = sys._getframe(1)
    if event == "import":
        name, file = arguments[:2]
        is_direct = not _installed(os.path.abspath(_beyond(frame, "<frozen ").f_code.co_filename))
        _record(lambda each: each.note(file) if file else each.note_import(name, is_direct))
    elif event in _PROCESS_EVENTS:
        _record(lambda each: each.note_unknown(event))
    elif not isinstance(arguments[0], int):
        if not (event.startswith("os.") and frame.f_code.co_filename.startswith("<frozen ")):
            path = _source_of(arguments[0] or ".")
            _record(lambda each: each.note(path))
        if event == "os.scandir" and _beyond(frame, _LIBRARY) is frame:
            _record(lambda each: each.note_query(arguments[0] or ".", is_of_times=True))


def _beyond(frame: FrameType, files: str | tuple[str, ...]) -> FrameType:
    """Return the innermost frame whose file has no such beginning."""
    while frame.f_back is not None and frame.f_code.co_filename.startswith(files):
        frame = frame.f_back
    return frame


def _source_of(path: Any) -> Any:
    """Return the source of a bytecode file, which Python reads in place of the source."""
    with contextlib.suppress(ValueError):
        return importlib.util.source_from_cache(os.fsdecode(path))
    return path


def _wrapped(name: str) -> Callable[..., Any]:
    """Return a function of `os` that records a query: of times or links, or of the existence.

    Functions of the standard library query the existence, except those of `_TIMES`.
    """
    function = getattr(os, name)

    @functools.wraps(function)
    def noted(path: Any, *rest: Any, **named: Any) -> Any:
        last, frame = name, sys._getframe(1)
        while _recordings and frame.f_code.co_filename.startswith((_LIBRARY, "<frozen ")):
            assert frame.f_back is not None
            last, frame = frame.f_code.co_name, frame.f_back
        _record(lambda each: each.note_query(path, is_of_times=last in _TIMES))
        return function(path, *rest, **named)

    return noted


def _path_stats(loader: SourceFileLoader, path: str) -> Any:
    """Hide the bytecode of a local module, which may be of another source."""
    if not _installed(os.path.abspath(path)):
        raise OSError
    return _REPLACED[SourceFileLoader, "path_stats"][0](loader, path)


_REPLACED: dict[tuple[Any, str], tuple[Any, Any]] = {
    **{(os, name): (getattr(os, name), _wrapped(name)) for name in _QUERIES},
    (SourceFileLoader, "path_stats"): (SourceFileLoader.path_stats, _path_stats),
}
"""Functions with their replacements while code is recorded."""


@contextlib.contextmanager
def record_reads(folder: Path) -> Iterator[ReadRecording]:
    """Record the inputs of a folder's code in this block.

    Local modules that an earlier folder's code imported are imported again, from their source.
    """
    _hook_once()
    _roots()  # before imports are recorded: in Python 3.12 a `Path` imports a module itself
    for name in _local:
        sys.modules.pop(name, None)
    reads, path, before = ReadRecording(folder, sys._getframe(2)), list(sys.path), set(sys.modules)
    present = {key: getattr(*key) for key in _REPLACED}
    _recordings.append(reads)
    for key, (_, replacement) in _REPLACED.items():
        setattr(*key, replacement)
    try:
        yield reads
        reads.note_import("", is_direct=False)
    finally:
        for key, function in present.items():
            setattr(*key, function)
        _recordings.remove(reads)
        sys.path[:] = path
        _local.update(filter(_is_local, {*sys.modules} - before))


_local: set[str] = set()
"""Names of modules that the code of folders imported."""


def _is_local(name: str) -> bool:
    file = getattr(sys.modules[name], "__file__", None)
    return isinstance(file, str) and not _installed(os.path.abspath(file))


@lru_cache(maxsize=1)
def _hook_once() -> None:
    sys.addaudithook(_hook)  # stays as long as the process
