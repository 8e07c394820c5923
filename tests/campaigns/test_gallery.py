"""The gallery: robots of a repository in every engine, as one site."""

from __future__ import annotations

import html
import json
import shutil
import subprocess
from pathlib import Path

import pytest

from gallery.__main__ import main
from gallery.robots import ROBOTS, robot_files

CASES = Path(__file__).parents[2] / "docs/cases"
ROWS = {
    "Arm": ("arm.urdf", "arm.xml"),
    "Pendulum": ("pendulum.urdf",),
    "Door": ("door.urdf",),
    "Sensor": ("sensor.urdf",),
    "Lamp": ("lamp.xml",),
    "Fingers": ("fingers.urdf",),
}
"""Small robots, which stand for public ones."""


@pytest.fixture
def gallery(tmp_path: Path) -> list[str]:
    """Return the command line for a repository with the robots."""
    repository = tmp_path / "them/robots"
    repository.mkdir(parents=True)
    for name in (file for files in ROWS.values() for file in files):
        shutil.copy(CASES / name, repository)
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "-C", str(repository)]
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "-m", "robots"]):
        subprocess.run([*git, *words], check=True)
    commit = subprocess.check_output([*git, "rev-parse", "HEAD"], text=True).strip()
    rows = [
        f'"{title}" = {{ kind = "arm", files = {[f"them/robots/{one}" for one in files]} }}'
        for title, files in ROWS.items()
    ]
    origin = f'"them/robots" = {{ commit = "{commit}", licence = "MIT" }}'
    listing = tmp_path / "robots.toml"
    listing.write_text("\n".join(["[repositories]", origin, "[robots]", *rows]))
    places = {"store": "store", "site": "site", "clones": "clones", "robots": "robots.toml"}
    options = [f"--{key}={tmp_path / place}" for key, place in places.items()]
    return [*options, f"--source={tmp_path}/{{owner}}/{{repository}}"]


@pytest.mark.slow
def test_the_gallery_is_a_page_of_robots_by_engines(gallery: list[str], tmp_path: Path) -> None:
    main(gallery)
    site = tmp_path / "site"
    cells = json.loads((site / "gallery.json").read_bytes())["cells"]
    assert {cell["robot"] for cell in cells} == set(ROWS)
    assert all(cell["sentence"] and (site / cell["page"]).is_file() for cell in cells)
    differing = next(cell for cell in cells if cell["outcome"] == "DIFFERS")
    page = (site / f"engines/{differing['engine']}.html").read_text()
    assert differing["sentence"] in html.unescape(page)
    assert "arm.urdf" in (site / "formats.html").read_text()
    assert (site / "robots/arm.xml/compare.html").is_file()  # the comparison as a page
    refuted = [cell for cell in cells if cell["outcome"] in ("DIFFERS", "REFUSED")]
    assert all(cell["line"] for cell in refuted), refuted

    # An unchanged robot is not run again, and a changed cell is named.
    before = (tmp_path / "store/pendulum.urdf/results.json").stat().st_mtime_ns
    cells[0]["text"] = "1.0"
    (site / "gallery.json").write_text(json.dumps({"cells": cells}))
    main(gallery)
    assert (tmp_path / "store/pendulum.urdf/results.json").stat().st_mtime_ns == before
    assert f"{cells[0]['robot']} in" in (site / "changes.txt").read_text()

    # A changed robot gets a new picture, the others keep theirs; stored texts become pages.
    pictures = [site / f"robots/{name}/picture.png" for name in ("pendulum.urdf", "door.urdf")]
    for picture in pictures:
        picture.write_bytes(b"old")
    results = tmp_path / "store/pendulum.urdf/results.json"
    results.write_bytes(results.read_bytes() + b"\n")
    (tmp_path / "store/versions").mkdir()
    (tmp_path / "store/versions/mujoco.txt").write_text("$ crosscheck versions door.urdf\n")
    main([*gallery, "--pages-only"])
    assert [one.exists() and one.read_bytes() == b"old" for one in pictures] == [False, True]
    assert "crosscheck versions door.urdf" in (site / "versions.html").read_text()


def test_every_robot_has_a_commit_and_a_licence() -> None:
    files = [file for row in robot_files() for file in row]
    assert len({file.robot for file in files}) >= 40
    assert all(len(file.commit) == 40 and file.licence for file in files)
    assert len({file.slug for file in files}) == len(files), ROBOTS
