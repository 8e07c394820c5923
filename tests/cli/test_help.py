"""Help and completion of all commands, also of other packages: complete, short, and true."""

import argparse
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.command import group
from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS as OWN_COMMANDS
from physics_crosscheck.harness.interfaces.cli.completion import SHELLS
from physics_crosscheck.harness.interfaces.cli.help import GROUPS, CommandParser
from physics_crosscheck.harness.interfaces.cli.main import build_parser, subparsers
from physics_crosscheck.harness.interfaces.cli.reference import generated_pages
from physics_crosscheck.harness.interfaces.cli.registry import GROUP, built_in_commands
from physics_crosscheck.harness.interfaces.cli.settings import SETTINGS
from physics_crosscheck.harness.records.codes import codes
from physics_crosscheck.harness.records.schema import SCHEMAS
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome
from tests.commands import crosscheck
from tests.faults.known_folder import environment
from tests.records.made import case, results, verdict

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


def test_generated_pages_link_to_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
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


def completions(line: str, here: Path) -> list[str]:
    output = here / "completed"
    subprocess.run(
        [sys.executable, "-m", "physics_crosscheck"],
        cwd=here,
        check=False,
        timeout=300,
        env=environment()
        | {
            "_ARGCOMPLETE": "1",
            "_ARGCOMPLETE_STDOUT_FILENAME": str(output),
            "_ARGCOMPLETE_IFS": "\n",
            "COMP_LINE": line,
            "COMP_POINT": str(len(line)),
        },
    )
    return output.read_text().split("\n")


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("crosscheck ver", ["versions"]),
        ("crosscheck run --last", ["--last-failed"]),
        ("crosscheck run --engine mujo", ["mujoco"]),
        ("crosscheck run torsi", ["torsional_disc"]),
        ("crosscheck run --format gi", ["github"]),
        ("crosscheck completion z", ["zsh"]),
        ("crosscheck run 'my ar", ["my arm/"]),
    ],
)
def test_partial_command_line_is_completed(tmp_path: Path, line: str, wanted: list[str]) -> None:
    (tmp_path / "my arm").mkdir()
    results = [one.strip() for one in completions(line, tmp_path)]
    assert [one.replace("\\ ", " ").strip("'") for one in results] == wanted


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_its_script(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "physics_crosscheck", "completion", shell],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
        env=environment(),
    )
    assert "crosscheck" in done.stdout
    assert not done.stderr


ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "own-command.md").read_text()
INTERFACES = ROOT / "harness" / "interfaces"


def block(language: str) -> str:
    """Return the only block of the page in a language."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    return str(text)


def register(site: Path, lines: str) -> None:
    info = site / "worst-1.0.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: worst\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{lines}")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Install the command of the page as the page shows, and return the folder."""
    site = tmp_path / "site"
    points = tomllib.loads(block("toml"))["project"]["entry-points"][GROUP]
    register(site, "".join(f"{name} = {value}\n" for name, value in points.items()))
    (site / "worst_command.py").write_text(block("python"))
    monkeypatch.syspath_prepend(site)
    yield site
    sys.modules.pop("worst_command", None)


def test_command_of_another_package_is_listed_explained_and_run(site: Path, tmp_path: Path) -> None:
    off = verdict(discrepancy=0.01, largest_discrepancy=0.01)
    record = results(case(Outcome.AGREES), case(Outcome.DIFFERS, verdict=off))
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "results.json").write_text(encoded(record))
    listed = crosscheck("--help", cwd=tmp_path).stdout
    assert "Our tools:\n  worst       Print the cases with the largest discrepancies\n" in listed
    about = crosscheck("worst", "--help", cwd=tmp_path).stdout
    assert "usage: crosscheck worst [options]" in about
    assert "--count N" in about
    done = crosscheck("worst", "--count", "1", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"1e-02  {record.cases[1].id}\n"
    wrong = crosscheck("wrost", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "unknown command 'wrost'. Did you mean worst?" in wrong.stderr


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("no_such_module:COMMAND", "No module named 'no_such_module'"),
        ("worst_command:main", "worst_command:main is not a physics_crosscheck.command.Command"),
        ("worst_command:absent", "has no attribute 'absent'"),
    ],
)
def test_command_that_can_not_be_loaded_is_reported_and_the_others_stay(
    site: Path, tmp_path: Path, value: str, why: str
) -> None:
    register(site, f"broken = {value}\n")
    done = crosscheck("--help", cwd=tmp_path)
    assert done.stderr.startswith("crosscheck: command 'broken' can't be loaded: ")
    assert why in done.stderr
    assert "  sweep  " in done.stdout
    assert "  broken  " not in done.stdout
    assert crosscheck("run", "--help", cwd=tmp_path).stderr == ""


@pytest.mark.usefixtures("site")
def test_another_package_can_not_replace_a_command(site: Path, tmp_path: Path) -> None:
    register(site, "explain = worst_command:COMMAND\n")
    done = crosscheck("explain", "XC101", cwd=tmp_path)
    assert done.returncode == 0
    assert "XC101" in done.stdout
    assert "largest discrepancies" not in crosscheck("--help", cwd=tmp_path).stdout


def test_command_line_names_no_command_of_an_extra() -> None:
    extras = built_in_commands().keys() - OWN_COMMANDS.keys()
    registered = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    assert extras == set(registered[GROUP])
    for file in INTERFACES.rglob("*.py"):
        text = file.read_text()
        assert not [name for name in extras if f'"{name}"' in text or f"crosscheck {name}" in text]
