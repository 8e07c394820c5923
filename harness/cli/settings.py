"""Settings of a project, `[tool.crosscheck]` in its pyproject.toml: what arguments are by default.

[tool.crosscheck]
folders = ["models"]
engines = ["NAME"]
resolution = 1e-9

The nearest file with such a table counts, from the working folder up to the root of its repository;
outside a repository, that of the working folder alone. Paths start at its folder. The command line
overrides it. Others may have written the file: it names no scheduler, which runs code here, and no
path outside its folder, where a run would write.
"""

from __future__ import annotations

import argparse
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.cli import arguments

FILE = "pyproject.toml"
TABLE = "[tool.crosscheck]"

Read = Callable[[object, Path], object]
"""The default that a value means, of a folder's file; ValueError says what it should be."""


class SettingsError(ValueError):
    """A setting that can't be taken; the message names the file, the setting and the remedy."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One setting.

    Attributes:
        argument: whose default it is, by the name that argparse has for it.
        read: what a value means.
        commands: those that take it.
    """

    argument: str
    read: Read
    commands: frozenset[str]


@dataclass(frozen=True, kw_only=True)
class _SettingsFile:
    """A file with settings.

    Attributes:
        path: from the working folder.
        text: what it holds.
        table: its settings.
    """

    path: Path
    text: str
    table: Mapping[str, object]

    def error(self, key: str, message: str) -> SettingsError:
        """Build the error about a setting, with its line where that is known."""
        # Imported here: help needs no parser of files.
        from physics_crosscheck.harness.files.locations.location import LocationError, Source
        from physics_crosscheck.harness.files.locations.toml import toml_offset

        source = Source(self.path, self.text.encode())
        try:
            start = toml_offset(
                source, f"tool.crosscheck.{key if key.isidentifier() else repr(key)}"
            )
        except LocationError:
            start = None
        line = "" if start is None else f":{source.data[:start].count(10) + 1}"  # 10: a line feed
        return SettingsError(f"{self.path}{line}: {TABLE} {message}")


def apply(command: argparse.ArgumentParser, name: str) -> None:
    """Make a project's settings the defaults of a command, and mention the file in its help.

    Raises:
        SettingsError: for a file that can't be read, an unknown setting, or an invalid value.
    """
    file, notes = _nearest(Path.cwd())
    defaults: dict[str, object] = {}
    if file is not None:
        read = {key: _read(file, key, value) for key, value in file.table.items()}
        defaults = {
            SETTINGS[key].argument: default
            for key, default in read.items()
            if name in SETTINGS[key].commands
        }
    if file is not None and defaults:
        keys = ", ".join(key for key in file.table if name in SETTINGS[key].commands)
        command.epilog = f"Defaults from {file.path}: {keys}. {command.epilog or ''}"
        notes = (*notes, f"settings from {file.path}")
    command.set_defaults(**defaults, settings_notes=notes)


def _read(file: _SettingsFile, key: str, value: object) -> object:
    """The default that a setting means."""
    if why := _REFUSED.get(key):
        raise file.error(key, f"{key}: {why}")
    setting = SETTINGS.get(key)
    if setting is None:
        raise file.error(key, f"has no setting {key!r}; there are {', '.join(SETTINGS)}")
    try:
        return setting.read(value, file.path.parent)
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise file.error(key, f"{key} is {value!r}: {error}") from None


def _nearest(here: Path) -> tuple[_SettingsFile | None, tuple[str, ...]]:
    """The nearest file with settings, and notes about those that are ignored."""
    notes: list[str] = []
    for folder in _searched(here):
        path = Path(os.path.relpath(folder / FILE, here))
        if not (folder / FILE).is_file():
            continue
        ours = _is_ours(folder / FILE)
        try:
            file = _settings_file(path)
        except SettingsError:
            if ours:
                raise
            continue
        if file is not None and ours:
            return file, tuple(notes)
        if file is not None:
            notes.append(
                f"settings in {path} are ignored, since it belongs to another user;"
                " give them on the command line, or change its owner"
            )
    return None, tuple(notes)


def _searched(here: Path) -> tuple[Path, ...]:
    """Folders whose settings count: up to the repository's root, else the working folder alone."""
    folders = (here, *here.parents)
    roots = (i for i, folder in enumerate(folders) if (folder / ".git").exists())
    return folders[: next(roots, 0) + 1]


def _is_ours(path: Path) -> bool:
    """Whether a file belongs to the user of this process; always so where the system has none."""
    return not hasattr(os, "geteuid") or path.stat().st_uid == os.geteuid()


def _settings_file(path: Path) -> _SettingsFile | None:
    """A file's settings; None where it has no such table.

    Raises:
        SettingsError: for a file that can't be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
        tools = tomllib.loads(text).get("tool", {})
    except (ValueError, RecursionError, OSError) as error:
        raise SettingsError(f"{path}: can't be read: {error}") from None
    table = tools.get("crosscheck") if isinstance(tools, dict) else None
    if table is None:
        return None
    if not isinstance(table, dict):
        raise SettingsError(f"{path}: tool.crosscheck is {table!r}, and no table")
    return _SettingsFile(path=path, text=text, table=table)


def _of_text(read: Callable[[str], object]) -> Read:
    """A number, as the command line takes it."""

    def found(value: object, _: Path) -> object:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("a number belongs there")
        return read(f"{value}")

    return found


def _names(value: object, _: Path) -> list[str]:
    if not (isinstance(value, list) and all(isinstance(one, str) for one in value)):
        raise ValueError("a list of names belongs there")
    return list(value)


def _folders(value: object, base: Path) -> list[str]:
    """Paths from the file; what is none there is a built-in system's name, and stays."""
    return [str(base / name) if (base / name).exists() else name for name in _names(value, base)]


def _path(value: object, base: Path) -> Path:
    if not isinstance(value, str) or not value:
        raise ValueError("a path belongs there")
    if not (base / value).resolve().is_relative_to(base.resolve()):
        raise ValueError(f"it is outside the folder of {FILE}; give it on the command line")
    return base / value


def _switch(value: object, _: Path) -> bool:
    if not isinstance(value, bool):
        raise ValueError("true or false belongs there")
    return value


_RUNNING = frozenset({"run", "gate", "accept", "review"})
_TIMED = _RUNNING | {"audit", "derive", "compare", "versions", "mutate"}

SETTINGS: Mapping[str, Setting] = MappingProxyType({
    "folders": Setting(argument="folders", read=_folders, commands=frozenset({"run", "list"})),
    "engines": Setting(
        argument="engine", read=_names, commands=_RUNNING | {"list", "audit", "mutate"}
    ),
    "resolution": Setting(
        argument="resolution",
        read=_of_text(arguments.resolution),
        commands=_RUNNING | {"compare", "versions"},
    ),
    "limit": Setting(argument="limit", read=_of_text(arguments.seconds), commands=_TIMED),
    "memory": Setting(argument="memory", read=_of_text(arguments.memory), commands=_TIMED),
    "jobs": Setting(
        argument="jobs",
        read=_of_text(arguments.positive),
        commands=_RUNNING | {"audit", "versions", "mutate"},
    ),
    "cache": Setting(argument="cache", read=_path, commands=frozenset({"run", "audit"})),
    "baseline": Setting(argument="baseline", read=_path, commands=_RUNNING),
    "out": Setting(argument="out", read=_path, commands=frozenset({"run"})),
    "strict": Setting(argument="strict", read=_switch, commands=frozenset({"run"})),
    "history": Setting(argument="history", read=_switch, commands=frozenset({"run"})),
    "require-engines": Setting(
        argument="require_engines", read=_switch, commands=frozenset({"run"})
    ),
})  # fmt: skip
"""All of them, by their names in the file."""

_REFUSED: Mapping[str, str] = MappingProxyType(
    {
        "scheduler": "a file can't name one, since whoever runs a scheduler can run code on this"
        f" machine; give --scheduler ADDRESS, or set {arguments.SCHEDULER}",
    }
)
"""What the file can't set, and the remedy."""
