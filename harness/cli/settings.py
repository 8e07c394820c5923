"""Settings of a project, `[tool.crosscheck]` in its pyproject.toml: what arguments are by default.

[tool.crosscheck]
folders = ["models"]
engines = ["NAME"]
resolution = 1e-9

The file is the nearest one above where one stands that has such a table; its paths are from the
folder that it lies in. What is given on the command line goes before it.
"""

from __future__ import annotations

import argparse
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from harness.cli import arguments

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


def apply(command: argparse.ArgumentParser, name: str) -> None:
    """Make a project's settings the defaults of a command, and say so in its help.

    Raises:
        SettingsError: for a file that can't be read, an unknown setting, or a value that is none.
    """
    found = _nearest(Path.cwd())
    if found is None:
        return
    path, table = found
    taken = {}
    for key, value in table.items():
        setting = SETTINGS.get(key)
        if setting is None:
            there = ", ".join(SETTINGS)
            raise SettingsError(f"{path}: {TABLE} has no setting {key!r}; there are {there}")
        try:
            default = setting.read(value, path.parent)
        except (ValueError, argparse.ArgumentTypeError) as error:
            raise SettingsError(f"{path}: {TABLE} {key} is {value!r}: {error}") from None
        if name in setting.commands:
            taken[setting.argument] = default
    if taken:
        command.set_defaults(**taken)
        keys = ", ".join(key for key in table if name in SETTINGS[key].commands)
        command.epilog = f"Defaults from {path}: {keys}. {command.epilog or ''}"


def _nearest(here: Path) -> tuple[Path, Mapping[str, object]] | None:
    """The nearest file with settings, as a path from `here`, and those."""
    for folder in (here, *here.parents):
        file = folder / FILE
        if file.is_file():
            path = Path(os.path.relpath(file, here))
            try:
                tools = tomllib.loads(file.read_text(encoding="utf-8")).get("tool", {})
            except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
                raise SettingsError(f"{path}: can't be read: {error}") from None
            table = tools.get("crosscheck") if isinstance(tools, dict) else None
            if isinstance(table, dict):
                return path, table
            if table is not None:
                raise SettingsError(f"{path}: tool.crosscheck is {table!r}, and no table")
    return None


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
    return base / value


def _text(value: object, _: Path) -> str:
    if not isinstance(value, str):
        raise ValueError("a text belongs there")
    return value


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
    "scheduler": Setting(
        argument="scheduler", read=_text, commands=frozenset({"run", "sweep"})
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
