"""Many cases: the page has the overview and loads cases from separate files on demand."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.harness.render import html as report
from physics_crosscheck.harness.render.html import parts, render, write_report
from physics_crosscheck.harness.render.html.parts import folder_of
from physics_crosscheck.records import Results
from tests.report.chromium import Browser, Tab
from tests.report.page import Page
from tests.report.samples import results
from tests.report.steps import (
    BOTH,
    BUILT,
    CASE,
    DIAGNOSIS,
    KINDS,
    SYSTEM,
    TALL,
    needs_browser,
    rows,
    shown,
)

ALL = """[...document.querySelectorAll('#cases tbody tr')]
  .filter((row) => row.checkVisibility()).map((row) => row.innerText)"""


@pytest.fixture
def written(tmp_path: Path, troubled: Results, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(report, "WHOLE", 18)
    monkeypatch.setattr(parts, "TOGETHER", 2)
    path = tmp_path / "many" / "index.html"
    write_report(path, troubled)
    return path


@pytest.fixture
def parts_tab(browser: Browser, written: Path) -> Iterator[Tab]:
    with browser.tab() as tab:
        yield tab


def parts_read(tab: Tab) -> list[str]:
    return [one.rpartition("/")[2] for one in tab.requests if ".parts/" in one]


def sound(tab: Tab, path: Path) -> None:
    assert tab.problems == []
    requested = {one.partition("#")[0] for one in tab.requests}
    assert all(one.startswith(path.parent.as_uri()) for one in requested)
    for problem in ("errors", "blocked"):
        assert tab.run(f"document.documentElement.dataset.{problem}") is None


def test_page_has_no_cases_and_each_case_is_in_one_file(written: Path, troubled: Results) -> None:
    page = Page(written.read_text("utf-8"))
    others = ("case-", "pack-case", "system-", "diagnosis-")
    assert not [one for one in page.ids() if one.startswith(others)]
    assert "overview" in page.ids()
    assert list(page.packs) == ["parts"]
    texts = [file.read_text("utf-8") for file in folder_of(written).iterdir()]
    assert len(texts) > 9
    names = [place for place, case in enumerate(troubled.cases) if case.series is not None]
    for place in names:
        assert sum(f'"pack-case-{place}"' in text for text in texts) == 1
    assert written.stat().st_size < len(render(troubled)) - 50_000


@pytest.mark.slow
@needs_browser
def test_views_open_with_plots_and_curves_of_other_files(
    parts_tab: Tab, written: Path, troubled: Results
) -> None:
    parts_tab.window(height=TALL)
    parts_tab.open(written.as_uri())
    assert parts_read(parts_tab) == []
    ids = parts_tab.run(
        "[...document.querySelectorAll('#cases tbody a')].map((a) => a.hash.slice(1))"
    )
    assert len(ids) == len(troubled.cases)
    for case, plots in KINDS.items():
        parts_tab.go(case)
        parts_tab.until(f"document.getElementById({case!r})?.checkVisibility()")
        parts_tab.until(BUILT)
        assert shown(parts_tab) == [case]
        assert parts_tab.run("document.querySelectorAll('[data-drawn]').length") == plots
    for view, plots in ((SYSTEM, 1), (DIAGNOSIS, 3)):
        parts_tab.go(view)
        parts_tab.until(f"document.getElementById({view!r})?.checkVisibility()")
        parts_tab.until(BUILT)
        assert parts_tab.run("document.querySelectorAll('[data-drawn]').length") == plots
    for view in parts_tab.run(
        "[...document.querySelectorAll('header nav a')].map((a) => a.hash.slice(1))"
    ):
        parts_tab.go(view)
        parts_tab.until(f"document.getElementById({view!r})?.checkVisibility()")
    files = parts_read(parts_tab)
    assert len(files) == len(set(files))
    assert {*files} < {file.name for file in folder_of(written).iterdir()}
    sound(parts_tab, written)


@needs_browser
def test_permalink_reads_one_file_and_back_reads_none(parts_tab: Tab, written: Path) -> None:
    parts_tab.open(f"{written.as_uri()}#{BOTH}")
    assert shown(parts_tab) == [BOTH]
    parts_tab.until(BUILT)
    read = parts_read(parts_tab)
    assert 1 <= len(read) <= 3, "its own, and those of the engines over it"
    parts_tab.go("overview")
    parts_tab.until("document.querySelector('#overview').checkVisibility()")
    parts_tab.run("history.back()")
    parts_tab.until(f"document.getElementById('{BOTH}').checkVisibility()")
    assert parts_read(parts_tab) == read
    sound(parts_tab, written)


@needs_browser
def test_missing_file_is_reported_and_can_be_restored(parts_tab: Tab, written: Path) -> None:
    folder = folder_of(written)
    folder.rename(folder.with_name("elsewhere"))
    parts_tab.open(f"{written.as_uri()}#{CASE}")
    assert shown(parts_tab) == ["overview"]
    message = parts_tab.run("document.getElementById('missing').innerText")
    assert message.startswith("The file index.parts/")
    assert message.endswith(".js can't be read; keep it together with this page.")
    folder.with_name("elsewhere").rename(folder)
    parts_tab.go("overview")
    parts_tab.go(CASE)
    parts_tab.until(f"document.getElementById({CASE!r})?.checkVisibility()")


@needs_browser
def test_long_table_is_shortened_until_all_rows_are_requested(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "ROWS", 4)
    path = tmp_path / "index.html"
    write_report(path, results())
    count = len(results().cases)
    with browser.tab() as tab:
        tab.open(path.as_uri())
        assert len(rows(tab)) == 4
        assert tab.run("document.getElementById('matching').textContent") == f"{count} cases"
        assert tab.run("document.querySelectorAll('.matrix .cell.faded').length") == 0
        worst = "document.querySelector('#cases th button').click()"
        tab.run(worst)
        first = rows(tab)
        tab.run(worst)
        assert len(rows(tab)) == 4
        assert rows(tab) != first, "another order puts other cases first"
        tab.run("document.getElementById('all').click()")
        assert len(rows(tab)) == count
        assert not tab.run("document.getElementById('all').checkVisibility()")
    with browser.tab(scripts=False) as tab:
        tab.send("Page.navigate", url=path.as_uri())
        tab.until("document.readyState === 'complete'")
        assert len(tab.run(ALL)) == count, "nobody without scripts could ask for more"


def test_second_report_removes_files_of_the_first(
    written: Path, troubled: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {file.name for file in folder_of(written).iterdir()}
    (folder_of(written) / "notes.txt").write_text("somebody's own")
    write_report(written, troubled)
    assert {file.name for file in folder_of(written).glob("*.js")} == before
    write_report(written, results(3))
    after = {file.name for file in folder_of(written).glob("*.js")}
    assert after
    assert not after & before
    monkeypatch.setattr(report, "WHOLE", 500)
    write_report(written, troubled)
    assert not list(folder_of(written).glob("*.js"))
    assert (folder_of(written) / "notes.txt").read_text() == "somebody's own"


def test_failed_write_keeps_the_old_page_and_files(
    written: Path, troubled: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> str:
        raise ValueError("not to be drawn")

    page, files = written.read_text("utf-8"), sorted(folder_of(written).iterdir())
    monkeypatch.setattr(report, "_script", refuse)
    with pytest.raises(ValueError, match="not to be drawn"):
        write_report(written, results(3))
    assert written.read_text("utf-8") == page
    assert set(files) <= set(folder_of(written).iterdir())
    assert [one.name for one in written.parent.iterdir() if one.name.startswith(".")] == []
