"""Every command of README, tutorial and other pages, in its order, from the wheel alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.installed.conftest import Installed
from tests.installed.documents import ROOT, check_shown, commands


def follow(document: str, installed: Installed, place: Path) -> None:
    """Run a document's commands in a folder, `cd` included."""
    run, _ = commands((ROOT / document).read_text())
    assert run
    here = place
    for command in run:
        done = installed.shell(f"{command.text}\ncode=$?; pwd >&2; exit $code", here)
        said = done.stdout + done.stderr
        assert done.returncode == command.code, f"{command.text}\n{said}"
        here = Path(done.stderr.strip().splitlines()[-1])
        check_shown(command, done.stdout)


@pytest.mark.slow
def test_the_tutorial_does_what_it_says(installed: Installed, tmp_path: Path) -> None:
    follow("docs/tutorial.md", installed, tmp_path)


@pytest.mark.slow
def test_coordinates_are_mapped_as_the_page_on_folders_says(
    installed: Installed, tmp_path: Path
) -> None:
    follow("docs/folder.md", installed, tmp_path)


@pytest.mark.slow
def test_cases_that_people_had_are_told_as_the_page_says(
    installed: Installed, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    follow("docs/cases.md", installed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["files-differ", "which-step", "engine-reads", "own-engine"])
def test_how_to_pages_do_what_they_say(installed: Installed, tmp_path: Path, page: str) -> None:
    shutil.copytree(ROOT / "docs" / "cases", tmp_path, dirs_exist_ok=True)
    follow(f"docs/how-to/{page}.md", installed, tmp_path)


@pytest.mark.slow
def test_the_commands_of_the_readme_work(installed: Installed, tmp_path: Path) -> None:
    template = ROOT / "template"
    (tmp_path / "path" / "to").mkdir(parents=True)
    shutil.copytree(template, tmp_path / "path" / "to" / "my_folder")
    shutil.copy(template / "mujoco.xml", tmp_path / "old.xml")
    shutil.copy(template / "robot.urdf", tmp_path / "robot.urdf")
    follow("README.md", installed, tmp_path)


@pytest.mark.parametrize("document", ["README.md", "docs/tutorial.md"])
def test_what_is_not_run_is_the_exception(document: str) -> None:
    run, excepted = commands((ROOT / document).read_text())
    known = {"README.md": 7, "docs/tutorial.md": 2}
    assert len(excepted) <= known[document], [c.text for c in excepted]
    assert len(run) >= 8
