from collections.abc import Iterator

import pytest

from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.records import Results
from tests.report.chromium import Browser, Tab, running
from tests.report.page import Page
from tests.report.samples import mixed, results
from tests.report.steps import sound


@pytest.fixture(scope="session")
def agreeing() -> Results:
    return results()


@pytest.fixture(scope="session")
def troubled() -> Results:
    return mixed()


@pytest.fixture(scope="session")
def page(agreeing: Results) -> Page:
    return Page(render(agreeing))


@pytest.fixture(scope="session")
def troubled_page(troubled: Results) -> Page:
    return Page(render(troubled))


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with running(tmp_path_factory.mktemp("browser")) as started:
        yield started


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory, troubled: Results) -> str:
    path = tmp_path_factory.mktemp("report") / "index.html"
    write_report(path, troubled)
    return path.as_uri()


@pytest.fixture(scope="session")
def shared_tab(browser: Browser) -> Iterator[Tab]:
    with browser.tab() as tab:
        yield tab


@pytest.fixture
def seen(shared_tab: Tab, address: str) -> Iterator[Tab]:
    """Return the samples' page in its last state, for tests that do not change it."""
    shared_tab.problems.clear()
    shared_tab.send("Page.bringToFront")
    shared_tab.window()
    yield shared_tab
    sound(shared_tab, address)


@pytest.fixture
def tab(seen: Tab) -> Iterator[Tab]:
    """Return a freshly loaded page, for tests that change it."""
    seen.changed = True
    yield seen
    seen.changed = True
