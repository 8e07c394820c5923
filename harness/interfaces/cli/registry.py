"""Commands of extras and of other packages, which entry points register."""

import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points

from physics_crosscheck.harness.paths import IMPORT_ROOT
from .commands import COMMANDS
from .help import Command

GROUP = "crosscheck.commands"
"""The group of entry points: each is a `Command`, and has its name."""


def all_commands() -> Mapping[str, Command]:
    """Return every command by name, with those of the same group together.

    An entry point may not use the name of a command of this program. One that can't be loaded is
    left out with a message, so that the others still run.
    """
    every = dict(COMMANDS)
    points = _points()
    for name in sorted(points.keys() - COMMANDS.keys()):
        try:
            every[name] = _load(points[name])
        except (Exception, SystemExit) as error:
            print(f"crosscheck: command {name!r} can't be loaded: {error}", file=sys.stderr)
    groups = list(dict.fromkeys(command.group for command in every.values()))
    return dict(sorted(every.items(), key=lambda item: groups.index(item[1].group)))


def built_in_commands() -> Mapping[str, Command]:
    """Return the commands of this package alone, with those of its extras."""
    return {
        name: command
        for name, command in all_commands().items()
        if command.function.startswith("physics_crosscheck.")
    }


def _load(point: EntryPoint) -> Command:
    command = point.load()
    if not isinstance(command, Command):
        raise TypeError(f"{point.value} is not a physics_crosscheck.command.Command")
    return command


def _points() -> Mapping[str, EntryPoint]:
    installed = {point.name: point for point in entry_points(group=GROUP)}
    return installed | {point.name: point for point in _of_checkout()}


def _of_checkout() -> Iterator[EntryPoint]:
    """Yield the commands that a checkout registers, which may not be installed or be newer."""
    file = IMPORT_ROOT / "pyproject.toml"
    if not file.is_file():
        return
    # Imported here: an installed package needs no parser.
    import tomllib

    project = tomllib.loads(file.read_text(encoding="utf-8")).get("project", {})
    if project.get("name") == "physics-crosscheck":
        for name, value in project["entry-points"][GROUP].items():
            yield EntryPoint(name, value, GROUP)
