"""Every command of README, tutorial and other pages, in its order.

Those of README and tutorial run from the wheel alone. On other pages `crosscheck` runs in this
process where a line is nothing else: a process of its own would import everything again.
"""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from tests.commands import crosscheck
from tests.installed.conftest import Installed
from tests.installed.documents import ROOT, check_shown, commands

HERE = re.compile(r"crosscheck (?!engines)[^|;&$<>\n]*")
"""Lines that run in this process, which may know of further engines."""


def follow(document: str, installed: Installed, place: Path, *, wheel: bool = False) -> None:
    """Run a document's commands in a folder, `cd` included."""
    run, _ = commands((ROOT / document).read_text())
    assert run
    here = place
    for command in run:
        if not wheel and HERE.fullmatch(command.text):
            words = shlex.split(command.text)[1:]
            done = crosscheck(*words, cwd=here, CI=None, COLUMNS=None)
            assert done.returncode == command.code, f"{command.text}\n{done.stdout}{done.stderr}"
            check_shown(command, done.stdout)
            continue
        done = installed.shell(f"{command.text}\ncode=$?; pwd >&2; exit $code", here)
        said = done.stdout + done.stderr
        assert done.returncode == command.code, f"{command.text}\n{said}"
        here = Path(done.stderr.strip().splitlines()[-1])
        check_shown(command, done.stdout)


@pytest.mark.slow
def test_the_tutorial_does_what_it_says(installed: Installed, tmp_path: Path) -> None:
    follow("docs/tutorial.md", installed, tmp_path, wheel=True)


@pytest.mark.slow
def test_coordinates_are_mapped_as_the_page_on_folders_says(
    installed: Installed, tmp_path: Path
) -> None:
    follow("docs/folder.md", installed, tmp_path)


PAGES = [
    *sorted(f"docs/get-started/{path.name}" for path in (ROOT / "docs/get-started").glob("*.md")),
    *sorted(f"docs/how-to/{path.name}" for path in (ROOT / "docs/how-to").glob("*.md")),
    *("docs/cases.md", "docs/compare.md", "docs/gate.md", "docs/robots.md"),
]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if commands((ROOT / page).read_text())[0]])
def test_a_page_does_what_it_shows(installed: Installed, tmp_path: Path, page: str) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    follow(page, installed, tmp_path)


@pytest.mark.slow
def test_the_commands_of_the_readme_work(installed: Installed, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    data = Path(pytest.importorskip("pybullet_data").getDataPath())
    shutil.copy(data / "franka_panda" / "panda.urdf", tmp_path)
    follow("README.md", installed, tmp_path, wheel=True)


@pytest.mark.parametrize("document", ["README.md", "docs/tutorial.md"])
def test_what_is_not_run_is_the_exception(document: str) -> None:
    run, excepted = commands((ROOT / document).read_text())
    most, least = {"README.md": (5, 2), "docs/tutorial.md": (2, 8)}[document]
    assert len(excepted) <= most, [c.text for c in excepted]
    assert len(run) >= least


def test_every_how_to_page_shows_a_command_its_meaning_and_a_remedy() -> None:
    pages = [page for page in PAGES if page.startswith("docs/how-to/") and "index" not in page]
    assert len(pages) >= 12
    for page in pages:
        text = (ROOT / page).read_text()
        assert commands(text)[0], page
        headings = [line for line in text.splitlines() if line.startswith("## ")]
        assert headings == ["## Meaning", "## Remedy"], page


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= 400


def test_each_page_begins_with_its_reader_and_the_result() -> None:
    """The pages of message codes begin with the message."""
    for path in (ROOT / "docs").rglob("*.md"):
        first = path.read_text().split("\n\n")[1]
        named = re.search(r"Afterwards|needs? this page|you have", first)
        assert named or path.name.startswith("XC"), f"{path}: {first}"


def test_the_pages_for_contributors_and_the_glossary_are_one_page_each() -> None:
    for page in ("CONTRIBUTING.md", "docs/architecture.md", "docs/glossary.md"):
        assert len((ROOT / page).read_text().split()) <= 650, page
    rows = re.findall(r"^\| \*\*", (ROOT / "docs/glossary.md").read_text(), re.MULTILINE)
    assert len(rows) <= 25
