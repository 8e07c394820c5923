"""Help of the commands: complete, short, wrapped, and true to the parsers."""

from __future__ import annotations

import argparse
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.command import group
from physics_crosscheck.harness.interfaces.cli.help import GROUPS, CommandParser
from physics_crosscheck.harness.interfaces.cli.main import build_parser, subparsers
from physics_crosscheck.harness.interfaces.cli.reference import generated_pages
from physics_crosscheck.harness.interfaces.cli.registry import built_in_commands
from physics_crosscheck.harness.interfaces.cli.settings import SETTINGS
from physics_crosscheck.harness.records.codes import codes
from physics_crosscheck.harness.records.schema import SCHEMAS

COMMANDS = built_in_commands()
PARSER = build_parser(COMMANDS, COMMANDS)
PARSERS = subparsers(PARSER)
DOCS = Path(__file__).parents[2] / "docs"

SPECIAL_MEANING = {
    ("compare", "--engine"), ("versions", "--engine"), ("report", "--out"), ("accept", "-v"),
    ("accept", "--verbose"),
}  # fmt: skip
"""Options that share a name with others but differ in meaning."""


def options(command: CommandParser) -> Iterator[argparse.Action]:
    return (action for action in command._actions if action.help is not argparse.SUPPRESS)


def shown(name: str, columns: int, patch: pytest.MonkeyPatch) -> str:
    patch.setenv("COLUMNS", str(columns))
    return (PARSERS[name] if name else PARSER).format_help()


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_description_groups_examples_and_exit_codes(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    about, text = PARSERS[name].about, shown(name, 80, monkeypatch)
    first, second = about.description.split("\n")
    assert first in text
    assert second in text
    assert len(about.examples) == 2
    assert all(f"  # {what}\n  {line}\n" in text for what, line in about.examples.items())
    assert all(
        re.search(rf"^  {re.escape(code)} +{re.escape(meaning.split()[0])}", text, re.MULTILINE)
        for code, meaning in about.exit_codes.items()
    )
    titles = [line[:-1] for line in text.splitlines() if line.endswith(":") and line[0] != " "]
    used = [title for title in GROUPS if group(PARSERS[name], title)._group_actions]
    assert titles == [*used, "Examples", "Exit codes"]
    assert {each.title for each in PARSERS[name]._action_groups} == set(GROUPS)
    others = group(PARSERS[name], GROUPS[-1])._group_actions
    assert [action.dest for action in others] == ["help"]


@pytest.mark.parametrize("name", COMMANDS)
def test_no_help_has_more_than_12_words(name: str) -> None:
    assert len(COMMANDS[name].purpose.split()) <= 10
    for action in options(PARSERS[name]):
        assert action.help, action.dest
        assert len(action.help.split()) <= 12, action.help
        assert action.help[0].isupper(), action.help


@pytest.mark.parametrize("columns", [60, 80])
@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_no_line_is_wider_than_the_terminal_and_no_example_is_broken(
    name: str, columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = shown(name, columns, monkeypatch)
    assert max(map(len, text.splitlines())) <= columns
    examples = PARSERS[name].about.examples.values() if name else ()
    assert all(f"\n  {line}\n" in text for line in examples)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_parse(name: str) -> None:
    for line in PARSERS[name].about.examples.values():
        command = re.search(r"crosscheck [^|)]*", line)
        assert command, line
        words = shlex.split(command[0])[1:]
        assert PARSER.parse_args(words).command == name, line


def test_option_has_the_same_help_in_all_commands() -> None:
    texts: dict[str, set[str]] = {}
    for name, command in PARSERS.items():
        for action in options(command):
            for option in action.option_strings:
                if (name, option) not in SPECIAL_MEANING:
                    text = (action.help or "").partition(" [")[0]
                    texts.setdefault(option, set()).add(text)
    assert {option: helps for option, helps in texts.items() if len(helps) > 1} == {}


def test_defaults_in_brackets_are_those_of_the_parsers() -> None:
    checked = 0
    for command in PARSERS.values():
        for action in options(command):
            text = (action.help or "").partition(" [")[2].removesuffix("]")
            value = action.default
            if isinstance(value, Path) or (isinstance(value, float | str) and value and text):
                assert text, action.dest
                same = float(text) == value if isinstance(value, float) else text == str(value)
                assert same, (action.dest, text, value)
                checked += 1
    assert checked > 30


def test_every_setting_is_an_argument_of_its_commands() -> None:
    for name, command in COMMANDS.items():
        for key in command.settings:
            dests = {action.dest for action in options(PARSERS[name])}
            assert SETTINGS[key].argument in dests, (key, name)
    assert {key for command in COMMANDS.values() for key in command.settings} == set(SETTINGS)


def test_generated_pages_link_to_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Check every link from and to a generated page; those of the machine stay outside."""
    before = generated_pages()
    monkeypatch.setenv("CROSSCHECK_SCHEDULER", "tcp://there:8786")
    generated = generated_pages()
    assert generated == before
    kinds = Counter(path.partition("/")[0] for path in generated)
    assert kinds["messages"] == len(codes()) + 1
    assert kinds["schema"] == len(SCHEMAS)
    assert not {path for path in generated if (DOCS / path).exists()}
    written = {str(path.relative_to(DOCS)): path.read_text() for path in DOCS.rglob("*.md")}
    every = {**written, **generated}
    for page, text in every.items():
        for target in re.findall(r"\]\(([\w./-]+\.(?:md|json))", text):
            path = os.path.normpath(os.path.join(os.path.dirname(page), target))
            assert path in every or path.startswith("..") or (DOCS / path).exists(), (page, target)
