"""Settings of a project: defaults of options, `[tool.crosscheck]` in its pyproject.toml.

[tool.crosscheck] folders = ["models"] engines = ["NAME"] resolution = 1e-9

The nearest file with such a table applies, from the working folder up to the root of its
repository. Outside a repository, only the working folder is searched. Paths start at the file's
folder. The command line overrides the file. Others may have written it, so it can set no scheduler,
which runs code on this machine, and no path outside its folder, where a run would write.
"""

import argparse
import contextlib
import json
import os
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from . import arguments
from .help import suggestion

FILE = "pyproject.toml"
TABLE = "[tool.crosscheck]"

Read = Callable[[object, Path], object]
"""Returns the default for a value; its ValueError states the expected value."""


class SettingsError(ValueError):
    """An invalid setting; the message names the file, the line, the setting and the remedy."""


class Setting(NamedTuple):
    """The argument of argparse that a setting sets, the type of its value, and its reader."""

    argument: str
    kind: str
    read: Read


@dataclass(frozen=True, kw_only=True)
class _SettingsFile:
    """A file with settings: its path from the working folder, its text and its table."""

    path: Path
    text: str
    table: Mapping[str, object]

    def error(self, key: str, message: str) -> SettingsError:
        """Build the error about a setting, with its line if known."""
        # Imported here: help needs no parser of files.
        from physics_crosscheck.harness.documents.errors import LocationError
        from physics_crosscheck.harness.documents.reading import SourceFile
        from physics_crosscheck.harness.modelfiles.locations.toml import toml_offset

        source = SourceFile(self.path, self.text.encode())
        name, line = key if key.isidentifier() else repr(key), ""
        with contextlib.suppress(LocationError):
            start = toml_offset(source, f"tool.crosscheck.{name}")
            line = f":{source.data[:start].count(10) + 1}"  # 10: a line feed
        return SettingsError(f"{self.path}{line}: {TABLE} {message}")


def apply(parser: argparse.ArgumentParser, settings: Collection[str]) -> None:
    """Make a project's settings the defaults of a command, and mention the file in its help.

    Args:
        parser: the command's parser.
        settings: keys of the settings that the command uses.

    Raises:
        SettingsError: for a file that can't be read, an unknown setting, or an invalid value.
    """
    file, notes = _nearest(Path.cwd())
    values = _values(file)
    defaults = {SETTINGS[key].argument: values[key] for key in values if key in settings}
    if file is not None and defaults:
        keys = ", ".join(key for key in file.table if key in settings)
        parser.epilog = f"Defaults from {file.path}: {keys}.\n\n{parser.epilog or ''}"
        notes = (*notes, f"settings from {file.path}")
    parser.set_defaults(**defaults, settings_defaults=defaults, settings_notes=notes)


def project_settings(folder: Path, names: Collection[str]) -> dict[str, Any]:
    """Return the values of a project's settings, by the arguments that they set.

    Args:
        folder: where the search for the file begins.
        names: of the arguments.

    Raises:
        SettingsError: as of `apply`.
    """
    file, _ = _nearest(folder)
    values = {SETTINGS[key].argument: value for key, value in _values(file).items()}
    return {
        name: value.resolve() if isinstance(value, Path) else value
        for name, value in values.items() if name in names
    }  # fmt: skip


def _values(file: _SettingsFile | None) -> dict[str, object]:
    return {} if file is None else {key: _read(file, key, one) for key, one in file.table.items()}


def _read(file: _SettingsFile, key: str, value: object) -> object:
    """Return the default that a setting stands for."""
    if why := _REFUSED.get(key):
        raise file.error(key, f"{key} {why}")
    setting = SETTINGS.get(key)
    if setting is None:
        setting_names = f" Settings: {', '.join(SETTINGS)}."
        raise file.error(key, f"unknown setting {key!r}.{suggestion(key, SETTINGS)}{setting_names}")
    try:
        return setting.read(value, file.path.parent)
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise file.error(key, f"{key} {error}") from None


def _nearest(here: Path) -> tuple[_SettingsFile | None, tuple[str, ...]]:
    """Return the nearest file with settings, and notes about ignored files."""
    notes: list[str] = []
    for folder in _searched(here):
        path = Path(os.path.relpath(folder / FILE))
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
                f"ignoring settings in {path}, since it belongs to another user;"
                " use options, or change its owner"
            )
    return None, tuple(notes)


def _searched(here: Path) -> tuple[Path, ...]:
    """Return the folders to search: up to the repository's root, else only the working folder."""
    folders = (here, *here.parents)
    roots = (i for i, folder in enumerate(folders) if (folder / ".git").exists())
    return folders[: next(roots, 0) + 1]


def _is_ours(path: Path) -> bool:
    """Return whether this process's user owns a file; always true on systems without users."""
    return not hasattr(os, "geteuid") or path.stat().st_uid == os.geteuid()


def _settings_file(path: Path) -> _SettingsFile | None:
    """Return a file's settings; None if it has no such table.

    Raises:
        SettingsError: for a file that can't be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
        tools = tomllib.loads(text).get("tool", {})
    except (ValueError, RecursionError, OSError) as error:
        raise SettingsError(f"{path}: cannot be read: {error}. Fix the file.") from None
    table = tools.get("crosscheck") if isinstance(tools, dict) else None
    if table is None:
        return None
    if not isinstance(table, dict):
        raise SettingsError(f"{path}: {TABLE} must be a table, not {_toml(table)}")
    return _SettingsFile(path=path, text=text, table=table)


def _must_be(expected: str, value: object) -> ValueError:
    return ValueError(f"must be {expected}, not {_toml(value)}")


def _toml(value: object) -> str:
    """Return a value as a message shows it, on one line and in ASCII."""
    return json.dumps(value, default=str)


def _of_text(read: Callable[[str], object]) -> Read:
    """Return a reader of numbers that accepts what the command line does."""

    def read_number(value: object, _: Path) -> object:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _must_be("a number", value)
        return read(f"{value}")

    return read_number


def _names(value: object, _: Path) -> list[str]:
    if not (isinstance(value, list) and all(isinstance(one, str) for one in value)):
        raise _must_be("a list of names", value)
    return list(value)


def _folders(value: object, base: Path) -> list[str]:
    """Return paths relative to the file; other names are those of built-in systems."""
    return [str(base / name) if (base / name).exists() else name for name in _names(value, base)]


def _path(value: object, base: Path) -> Path:
    if not isinstance(value, str) or not value:
        raise _must_be("a path", value)
    if not (base / value).resolve().is_relative_to(base.resolve()):
        raise ValueError(
            f"must be inside the folder of {FILE}, not {_toml(value)}. Use the option instead."
        )
    return base / value


def _codes(value: object, base: Path) -> tuple[str, ...]:
    return arguments.code_prefixes(",".join(_names(value, base)))


def _switch(value: object, _: Path) -> bool:
    if not isinstance(value, bool):
        raise _must_be("true or false", value)
    return value


SETTINGS: Mapping[str, Setting] = MappingProxyType(
    {
        "folders": Setting("folders", "list of paths or names", _folders),
        "engines": Setting("engines", "list of names", _names),
        "resolution": Setting("resolution", "number", _of_text(arguments.resolution)),
        "limit": Setting("limit", "number", _of_text(arguments.seconds)),
        "memory": Setting("memory", "number", _of_text(arguments.memory)),
        "jobs": Setting("jobs", "whole number", _of_text(arguments.positive)),
        "cache": Setting("cache", "path", _path),
        "baseline": Setting("baseline", "path", _path),
        "out": Setting("out", "path", _path),
        "strict": Setting("strict", "boolean", _switch),
        "select": Setting("select", "list of codes", _codes),
        "ignore": Setting("ignore", "list of codes", _codes),
        "require-engines": Setting("require_engines", "boolean", _switch),
    }
)
"""All settings, by their names in the file. The table of commands names those of each."""

_REFUSED: Mapping[str, str] = MappingProxyType(
    {
        "scheduler": "is not allowed in a file, since a scheduler can run code on this machine."
        f" Use --scheduler ADDRESS, or set {arguments.SCHEDULER}.",
    }
)
"""Settings that the file can't contain: the reason and the remedy."""
