"""The documentation as a site: every page, every link and the reference of the public names."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built strictly: a link to a page or a heading that is not there is an error."""
    place = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(place)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
    )
    assert done.returncode == 0, done.stderr
    return place


def test_notebooks_are_pages_with_their_code(site: Path) -> None:
    for path in (ROOT / "examples").glob("*.ipynb"):
        page = (site / "examples" / f"{path.stem}.html").read_text()
        assert "physics_crosscheck" in page, path.name


def test_the_site_is_searched_offline(site: Path) -> None:
    index = (site / "search" / "search_index.json").read_text()
    assert "panda_link8" in index


@pytest.mark.slow
def test_every_page_is_in_the_site(site: Path) -> None:
    pages = {
        path.relative_to(ROOT / "docs").with_suffix(".html")
        for path in (ROOT / "docs").rglob("*.md")
    }
    renamed = {p.with_name("index.html") if p.name == "README.html" else p for p in pages}
    assert {page for page in renamed if not (site / page).is_file()} == set()
    index = (site / "index.html").read_text()
    lost = {p for p in renamed if f'href="{p.as_posix()}"' not in index}
    messages = (site / "messages" / "index.html").read_text()
    assert {str(p) for p in lost if f'href="{p.name}"' not in messages} <= {"index.html"}


def test_the_reference_has_the_public_names_with_their_docstrings(site: Path) -> None:
    page = re.sub(r"<[^>]+>", " ", (site / "reference" / "python.html").read_text())
    for words in (
        "relative discrepancy to resolve",  # check
        "Whether all cases and audits agree",  # Results
        "An adapter: its name, whether its engine is there",  # Engine
        "Run a model once, from start to end, and nothing else",  # simulate
        "with a bound of the error of every value",  # reference
        "joints without a partner; with the remedy",  # compare
    ):
        assert words in " ".join(page.split()), words


def test_no_page_asks_anything_of_the_network(site: Path) -> None:
    pages = [path.read_text() for path in site.rglob("*.html")]
    asked = {
        found
        for page in pages
        for found in re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)"', page)
    }
    assert asked == set()
