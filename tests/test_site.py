"""The documentation as a site: every page, every link and the reference of the public names."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.reference import generated_pages
from tests.report.chromium import running
from tests.report.steps import needs_browser

ROOT = Path(__file__).parents[1]


pytestmark = pytest.mark.release  # a build takes most of a minute, with the notebooks executed


def sources() -> list[Path]:
    """Return the source files of the site, without compiled code."""
    paths = [path for name in ("docs", "examples") for path in (ROOT / name).rglob("*")]
    return sorted(path for path in paths if "__pycache__" not in path.parts)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build strictly: a link to a missing page or heading is an error."""
    place, before = tmp_path_factory.mktemp("site"), sources()
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(place)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1", "EXECUTE_NOTEBOOKS": "true"},
    )
    assert done.returncode == 0, done.stderr
    assert sources() == before
    return place


def test_notebooks_show_pictures_tables_and_formulas(site: Path) -> None:
    pages = {path.stem: path.read_text() for path in (site / "examples").glob("*.html")}
    assert pages.keys() == {path.stem for path in (ROOT / "examples").glob("*.ipynb")}
    for name, page in pages.items():
        assert "physics_crosscheck" in page, name
        assert 'src="data:image/png;base64,' in page, name
        assert "<table" in page, name
        assert tempfile.gettempdir() + "/" not in page, name
        assert "white-space:pre;overflow-x:auto" not in page, f"{name}: Rich printed a string"
    assert "<msqrt>" in pages["pendulum"]


@needs_browser
def test_site_can_be_searched_from_disk(site: Path, tmp_path: Path) -> None:
    with running(tmp_path) as browser, browser.tab() as tab:
        tab.send("Page.navigate", url=(site / "index.html").as_uri())
        tab.until("document.readyState === 'complete' && window.location$")
        tab.run("document.querySelector('label[for=__search]').click()")
        field = "document.querySelector('.md-search__input')"
        tab.run(f"{field}.focus(), {field}.value = 'panda_link8', null")
        tab.run(f"{field}.dispatchEvent(new KeyboardEvent('keyup'))")
        tab.until("document.querySelector('.md-search-result__item')")
        assert tab.problems == []


def test_site_contains_every_page(site: Path) -> None:
    pages = {
        path.relative_to(ROOT / "docs").with_suffix(".html")
        for path in (ROOT / "docs").rglob("*.md")
    }
    generated = generated_pages()
    pages |= {Path(path).with_suffix(".html") for path in generated if path.endswith(".md")}
    assert all((site / path).is_file() for path in generated if path.endswith(".json"))
    renamed = {p.with_name("index.html") if p.name == "README.html" else p for p in pages}
    assert {page for page in renamed if not (site / page).is_file()} == set()
    index = (site / "index.html").read_text()
    lost = {p for p in renamed if f'href="{p.as_posix()}"' not in index}
    messages = (site / "messages" / "index.html").read_text()
    assert {str(p) for p in lost if f'href="{p.name}"' not in messages} <= {"index.html"}


def test_reference_shows_docstrings_of_public_names(site: Path) -> None:
    page = re.sub(r"<[^>]+>", " ", (site / "reference" / "python.html").read_text())
    for words in (
        "smallest relative discrepancy to detect",  # check
        "True if all cases and audits agree",  # Results
        "An adapter: its names, formats and capabilities",  # Engine
        "Run a model file once, at one time step",  # simulate
        "with an error bound for every value",  # solve
        "joints have no partner; the message gives the remedy",  # compare
    ):
        assert words in " ".join(page.split()), words


def test_pages_load_nothing_from_the_network(site: Path) -> None:
    pages = [path.read_text() for path in site.rglob("*.html")]
    urls = {
        url
        for page in pages
        for url in re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)"', page)
    }
    assert urls == set()
