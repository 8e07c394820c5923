"""All commands of README, tutorial and other pages, in order.

A line that only calls `crosscheck` runs in this process, because a new one would import everything
again. `test_installed.py` runs commands from the wheel.
"""

from __future__ import annotations

import hashlib
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.reference import generated_pages
from tests.commands import crosscheck
from tests.installed.conftest import CHECKOUT
from tests.installed.documents import ROOT, check_shown, commands
from tests.standing import shorten_scenarios

HERE = re.compile(r"crosscheck (?!engines)[^|;&$<>\n]*")
"""Lines that run in this process, which may have further engines."""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> CommandCache:
    return CommandCache(tmp_path_factory.mktemp("cache"))


class CommandCache:
    """Results of commands by folder content: pages repeat commands in equal folders."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._done = dict[tuple[str, bytes], subprocess.CompletedProcess[str]]()

    def run(self, text: str, here: Path) -> subprocess.CompletedProcess[str]:
        """Run a line in a folder, or copy its result from an equal folder."""
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
            shorten_scenarios(here / words[1])
        shutil.copytree(here, after)
        self._done[key] = done
        return done


def follow(document: str, cache: CommandCache, place: Path) -> None:
    """Run a document's commands in a folder, `cd` included."""
    run, _ = commands((ROOT / document).read_text())
    assert run
    here = place
    for command in run:
        if HERE.fullmatch(command.text):
            done = cache.run(command.text, here)
            output = done.stdout + done.stderr
        else:
            done = CHECKOUT.shell(f"{command.text}\ncode=$?; pwd >&2; exit $code", here)
            output = done.stdout + done.stderr
            here = Path(done.stderr.strip().splitlines()[-1])
        assert done.returncode == command.code, f"{command.text}\n{output}"
        check_shown(command, done.stdout)


@pytest.mark.release
def test_tutorial_commands_print_what_is_shown(cache: CommandCache, tmp_path: Path) -> None:
    follow("docs/tutorial.md", cache, tmp_path)


@pytest.mark.release
def test_commands_of_the_page_on_folders_work(cache: CommandCache, tmp_path: Path) -> None:
    follow("docs/folder.md", cache, tmp_path)


PAGES = [
    *sorted(f"docs/get-started/{path.name}" for path in (ROOT / "docs/get-started").glob("*.md")),
    *sorted(f"docs/how-to/{path.name}" for path in (ROOT / "docs/how-to").glob("*.md")),
    *("docs/cases.md", "docs/compare.md", "docs/gate.md", "docs/robots.md", "docs/scope.md"),
]


@pytest.mark.release
@pytest.mark.parametrize("page", [page for page in PAGES if commands((ROOT / page).read_text())[0]])
def test_page_commands_print_what_is_shown(cache: CommandCache, tmp_path: Path, page: str) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    follow(page, cache, tmp_path)


@pytest.mark.release
def test_readme_commands_work(cache: CommandCache, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    data = Path(pytest.importorskip("pybullet_data").getDataPath())
    shutil.copy(data / "franka_panda" / "panda.urdf", tmp_path)
    follow("README.md", cache, tmp_path)


@pytest.mark.parametrize("document", ["README.md", "docs/tutorial.md"])
def test_most_commands_are_run(document: str) -> None:
    run, excepted = commands((ROOT / document).read_text())
    max_excluded, min_run = {"README.md": (5, 2), "docs/tutorial.md": (3, 8)}[document]
    assert len(excepted) <= max_excluded, [c.text for c in excepted]
    assert len(run) >= min_run


def test_how_to_questions_have_command_meaning_and_remedy() -> None:
    """Check that a page answers its title, or each `## question?` in a section of its own."""
    pages = [page for page in PAGES if page.startswith("docs/how-to/") and "index" not in page]
    questions = 0
    for page in pages:
        first, *sections = re.split(r"^(?=## .*\?$)", (ROOT / page).read_text(), flags=re.M)
        for text in sections or [first]:
            mark = "### " if sections else "## "
            headings = [line for line in text.splitlines() if line.startswith(mark)]
            assert headings == [f"{mark}Meaning", f"{mark}Remedy"], text
            assert any(commands(text)), text
            questions += 1
    assert questions >= 8


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= 400


def test_pages_begin_with_reader_and_result() -> None:
    """Check pages except those of message codes, which begin with the message."""
    texts = {str(path): path.read_text() for path in (ROOT / "docs").rglob("*.md")}
    texts |= {path: text for path, text in generated_pages().items() if path.endswith(".md")}
    for path, text in texts.items():
        first = text.split("\n\n")[1]
        named = re.search(r"Afterwards|needs? this page|you have", first)
        assert named or "/XC" in path, f"{path}: {first}"


def test_contributor_pages_and_glossary_are_short() -> None:
    for page in ("CONTRIBUTING.md", "docs/architecture.md", "docs/glossary.md"):
        assert len((ROOT / page).read_text().split()) <= 650, page
    rows = re.findall(r"^\| \*\*", (ROOT / "docs/glossary.md").read_text(), re.MULTILINE)
    assert len(rows) <= 25
