"""Every command of README, tutorial and other pages, in its order.

`crosscheck` runs in this process where a line is nothing else, with its tasks: others would import
everything again. `test_installed.py` runs commands from the wheel alone.
"""

from __future__ import annotations

import hashlib
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.commands import crosscheck
from tests.installed.conftest import CHECKOUT
from tests.installed.documents import ROOT, check_shown, commands
from tests.standing import brief

HERE = re.compile(r"crosscheck (?!engines)[^|;&$<>\n]*")
"""Lines that run in this process, which may know of further engines."""


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Known:
    return Known(tmp_path_factory.mktemp("known"))


class Known:
    """Commands that ran, with the folder after each: pages repeat commands in the same folder."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._done = dict[tuple[str, bytes], subprocess.CompletedProcess[str]]()

    def run(self, text: str, here: Path) -> subprocess.CompletedProcess[str]:
        """Run a line in a folder, or copy what it left in an equal folder."""
        words = shlex.split(text)[1:]
        files = sorted(path for path in here.rglob("*") if path.is_file())
        state = "\0".join(f"{path.relative_to(here)} {path.read_bytes()!r}" for path in files)
        key = text, hashlib.sha256(state.encode()).digest()
        after = self._place / hashlib.sha256(repr(key).encode()).hexdigest()
        if key in self._done:
            shutil.copytree(after, here, dirs_exist_ok=True)
            return self._done[key]
        done = crosscheck(*words, cwd=here, CI=None, COLUMNS=None)
        if words[0] == "new" and "duration=" in (here / words[1] / "system.py").read_text():
            brief(here / words[1])
        shutil.copytree(here, after)
        self._done[key] = done
        return done


def follow(document: str, known: Known, place: Path) -> None:
    """Run a document's commands in a folder, `cd` included."""
    run, _ = commands((ROOT / document).read_text())
    assert run
    here = place
    for command in run:
        if HERE.fullmatch(command.text):
            done = known.run(command.text, here)
            said = done.stdout + done.stderr
        else:
            done = CHECKOUT.shell(f"{command.text}\ncode=$?; pwd >&2; exit $code", here)
            said = done.stdout + done.stderr
            here = Path(done.stderr.strip().splitlines()[-1])
        assert done.returncode == command.code, f"{command.text}\n{said}"
        check_shown(command, done.stdout)


@pytest.mark.release
def test_the_tutorial_does_what_it_says(known: Known, tmp_path: Path) -> None:
    follow("docs/tutorial.md", known, tmp_path)


@pytest.mark.release
def test_coordinates_are_mapped_as_the_page_on_folders_says(known: Known, tmp_path: Path) -> None:
    follow("docs/folder.md", known, tmp_path)


PAGES = [
    *sorted(f"docs/get-started/{path.name}" for path in (ROOT / "docs/get-started").glob("*.md")),
    *sorted(f"docs/how-to/{path.name}" for path in (ROOT / "docs/how-to").glob("*.md")),
    *("docs/cases.md", "docs/compare.md", "docs/gate.md", "docs/robots.md"),
]


@pytest.mark.release
@pytest.mark.parametrize("page", [page for page in PAGES if commands((ROOT / page).read_text())[0]])
def test_a_page_does_what_it_shows(known: Known, tmp_path: Path, page: str) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    follow(page, known, tmp_path)


@pytest.mark.release
def test_the_commands_of_the_readme_work(known: Known, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    data = Path(pytest.importorskip("pybullet_data").getDataPath())
    shutil.copy(data / "franka_panda" / "panda.urdf", tmp_path)
    follow("README.md", known, tmp_path)


@pytest.mark.parametrize("document", ["README.md", "docs/tutorial.md"])
def test_what_is_not_run_is_the_exception(document: str) -> None:
    run, excepted = commands((ROOT / document).read_text())
    most, least = {"README.md": (5, 2), "docs/tutorial.md": (3, 8)}[document]
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
