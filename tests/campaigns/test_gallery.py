"""The gallery: robots of a repository in every engine, as one site."""

from __future__ import annotations

import html
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from msgspec.structs import replace

from gallery.__main__ import main
from gallery.robots import ROBOTS, robot_files
from gallery.site import Done, Entry, write_site
from physics_crosscheck.harness.checks.findings import finding
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.records import SourceLine
from tests.report.samples import results

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
def test_the_gallery_is_a_page_of_robots_by_engines(
    gallery: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(gallery)
    printed = capsys.readouterr().out
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
    assert all(f" in {cell['engine']} has no means" in printed for cell in refuted), printed

    # An unchanged robot is not run again, and a changed cell is named.
    before = (tmp_path / "store/pendulum.urdf/results.json").stat().st_mtime_ns
    cells[0]["text"] = "1.0"
    (site / "gallery.json").write_text(json.dumps({"cells": cells}))
    main(gallery)
    assert (tmp_path / "store/pendulum.urdf/results.json").stat().st_mtime_ns == before
    assert f"{cells[0]['robot']} in" in (site / "changes.txt").read_text()


def test_a_changed_robot_gets_a_new_picture_and_stored_texts_become_pages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = finding("massless", ("a",), "no mass", location=SourceLine(file="a.urdf", line=3))
    base = results(1)
    models = tuple(replace(one, audit=(fault,), diagnosis=None) for one in base.models)
    given, drawn = replace(base, models=models), list[Path]()
    monkeypatch.setattr("gallery.site.write_pictures", drawn.extend)
    store, site = tmp_path / "store", tmp_path / "site"
    (first, *_), (second, *_), *_ = robot_files()
    for file in (first, second):
        write_whole(store / file.slug / "results.json", encoded(given))
        write_whole(store / file.slug / "compare.txt", f"$ crosscheck compare {file.slug}")
        write_whole(site / f"robots/{file.slug}/picture.png", "old")
        write_whole(site / f"robots/{file.slug}/results.json", encoded(given))
    write_whole(site / f"robots/{first.slug}/results.json", "{}")  # of the robot before
    write_whole(store / "versions/mujoco.txt", "$ crosscheck versions door.urdf")
    done = Done(address=first.address, versions={}, command="crosscheck run")
    entries = [Entry(file=one, done=done, results=given) for one in (first, second)]
    write_site(site, store, entries)
    assert drawn == [site / "robots" / first.slug]
    index = (site / "index.html").read_text()  # each fault of a file once, at its line
    assert index.count("<td>the file</td>") == 2
    assert f"{first.address}#L3" in index
    assert "massless" not in (site / "engines/mujoco.html").read_text()
    assert f"compare {second.slug}" in (site / "formats.html").read_text()
    assert "versions door.urdf" in (site / "versions.html").read_text()


def test_every_robot_has_a_commit_and_a_licence() -> None:
    files = [file for row in robot_files() for file in row]
    assert len({file.robot for file in files}) >= 40
    assert all(len(file.commit) == 40 and file.licence for file in files)
    assert len({file.slug for file in files}) == len(files), ROBOTS
