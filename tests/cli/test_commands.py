"""Commands behind entry points: those of extras, and the one of `docs/how-to/own-command.md`."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS
from physics_crosscheck.harness.interfaces.cli.registry import GROUP, built_in_commands
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome
from tests.commands import crosscheck
from tests.records.made import case, results, verdict

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
    extras = built_in_commands().keys() - COMMANDS.keys()
    registered = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    assert extras == set(registered[GROUP])
    for file in INTERFACES.rglob("*.py"):
        text = file.read_text()
        assert not [name for name in extras if f'"{name}"' in text or f"crosscheck {name}" in text]
