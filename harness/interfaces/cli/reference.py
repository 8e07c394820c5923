"""Generated pages of the site: commands and settings, result files with schemas, messages.

`python -m physics_crosscheck.harness.interfaces.cli.reference FOLDER` writes all of them.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path

from physics_crosscheck.harness.documents.reading import USD_OUTSIDE, USD_VARIANTS
from physics_crosscheck.harness.records.schema import PAGES, SCHEMAS, page_texts, schema_text
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.results.messages import pages
from .arguments import SCHEDULER, XACRO_ARGUMENTS
from .help import CommandParser, metavar
from .main import build_parser, subparsers
from .registry import built_in_commands
from .settings import SETTINGS

_CONFIGURATION = """\
# Configuration

This page is for projects that set defaults of command options in `pyproject.toml`.
Afterwards you know every setting.

```toml
[tool.crosscheck]
folders = ["models"]
engines = ["mujoco"]
limit = 300
cache = ".crosscheck_cache"
strict = true
```

Options on the command line override these settings. `crosscheck run` prints the name of the file,
and `crosscheck run --help` lists the settings in force. An unknown setting or an invalid value is
an error with file and line. `check()` does not read this table. pytest reads `resolution`, `limit`,
`memory`, `baseline`, `require-engines`, `select` and `ignore`.

## Which file is read

The nearest `pyproject.toml` with this table is read. The search starts in the working folder and
ends at the root of the repository, which is the first folder with `.git`. Outside a repository,
only the working folder is searched. A file of another user is ignored with a note.

Paths are relative to the file. `cache`, `baseline` and `out` must lie in the folder of
the file, and `scheduler` is not allowed: a scheduler can run code on your machine.

## Settings
"""

_VARIABLES = f"""
## Environment variables

| Variable | Meaning |
|---|---|
| `{SCHEDULER}` | Address of a Dask scheduler, as `--scheduler` |
| `{XACRO_ARGUMENTS}` | Arguments of xacro sources, as `--xacro-arg` |
| `{USD_VARIANTS}` | Variants of USD robots, as `--variant` |
| `{USD_OUTSIDE}` | If set, as `--allow-outside` |
| `CI` | If set, print logs instead of a progress bar; `accept` refuses to run |
| `GITHUB_ACTIONS` | If `true`, also print annotations for GitHub |
| `NO_COLOR` | If set, print without colors |
"""


def command_line_page() -> str:
    """Return the page of all commands."""
    commands = built_in_commands()
    parsers = subparsers(build_parser(commands, commands))
    lines = [
        "# Command line",
        "",
        "This page is for users of the command line. Afterwards you know every command with its"
        " options, examples and exit codes.",
        "`crosscheck COMMAND --help` prints the same in a terminal. `python -m physics_crosscheck`"
        " works like `crosscheck`.",
        "",
        "Values in brackets are defaults. [Settings](configuration.md) can change them.",
    ]
    for title, items in groupby(commands.items(), lambda item: item[1].group):
        group = dict(items)
        lines += ["", f"## {title}", "", "| Command | Purpose |", "|---|---|"]
        lines += [f"| [`{name}`](#crosscheck-{name}) | {group[name].purpose} |" for name in group]
        for name in group:
            lines += ["", *_command_lines(name, parsers[name])]
    return "\n".join(lines) + "\n"


def configuration_page() -> str:
    """Return the page of all settings."""
    commands = built_in_commands()
    parsers = subparsers(build_parser(commands, commands))
    lines = ["| Setting | Type | Default | Meaning | Commands |", "|---|---|---|---|---|"]
    for key, setting in SETTINGS.items():
        by_default: dict[str, list[str]] = {}
        meaning = ""
        users = sorted(name for name, command in commands.items() if key in command.settings)
        for name in users:
            meaning, default = _meaning_and_default(_action(parsers[name], setting.argument))
            by_default.setdefault(default, []).append(name)
        names = ", ".join(f"`{name}`" for name in users)
        row = [f"`{key}`", setting.kind, _defaults(by_default), meaning, names]
        lines.append(f"| {' | '.join(row)} |")
    return f"{_CONFIGURATION}\n" + "\n".join(lines) + "\n" + _VARIABLES


def generated_pages() -> dict[str, str]:
    """Return the text of every generated file by its path in the site."""
    return {
        "reference/command-line.md": command_line_page(),
        "reference/configuration.md": configuration_page(),
        **{f"reference/{name}": text for name, text in page_texts(PAGES).items()},
        **{f"schema/{name}.schema.json": schema_text(name) for name in SCHEMAS},
        **{f"messages/{name}": text for name, text in pages().items()},
    }


def _command_lines(name: str, command: CommandParser) -> Iterator[str]:
    about = command.about
    yield from (f"### crosscheck {name}", "", *about.description.split("\n"), "")
    yield from ("```", (command.usage or "").replace("\xa0", " "), "```")
    for group in command._action_groups:
        actions = [one for one in group._group_actions if one.help is not argparse.SUPPRESS]
        if actions:
            yield from ("", f"**{group.title}**", "", "| | |", "|---|---|")
            yield from (f"| {_name(one)} | {_cell(one.help or '')} |" for one in actions)
    yield from ("", "**Examples**", "", "```sh")
    for what, line in about.examples.items():
        yield from (f"# {what}", line)
    yield from ("```", "", "**Exit codes**", "", "| | |", "|---|---|")
    yield from (f"| {code} | {meaning} |" for code, meaning in about.exit_codes.items())


def _name(action: argparse.Action) -> str:
    if not action.option_strings:
        return f"`{_cell(metavar(action))}`"
    names = ", ".join(action.option_strings)
    return f"`{_cell(f'{names} {metavar(action)}'.rstrip())}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def _action(command: CommandParser, argument: str) -> argparse.Action:
    return next(one for one in command._actions if one.dest == argument)


def _meaning_and_default(action: argparse.Action) -> tuple[str, str]:
    text, bracket, default = (action.help or "").removesuffix("]").partition(" [")
    if not bracket:
        default = "false" if action.nargs == 0 else "none"
    return text.removesuffix("; repeatable"), default


def _defaults(commands: Mapping[str, list[str]]) -> str:
    common, *others = sorted(commands, key=lambda default: -len(commands[default]))
    text = "; ".join(f"{default} for {', '.join(commands[default])}" for default in others)
    return f"{common} ({text})" if text else common


if __name__ == "__main__":
    for path, content in generated_pages().items():
        write_whole(Path(sys.argv[1]) / path, content)
