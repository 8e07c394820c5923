"""Many cases: the page has the overview, and files beside it the cases, read when looked at."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render import html as report
from physics_crosscheck.harness.render.html import parts, render, write_report
from physics_crosscheck.harness.render.html.parts import folder_of
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
def many(browser: Browser, written: Path) -> Iterator[Tab]:
    with browser.tab() as tab:
        yield tab


def parts_read(tab: Tab) -> list[str]:
    return [one.rpartition("/")[2] for one in tab.requests if ".parts/" in one]


def sound(tab: Tab, path: Path) -> None:
    assert tab.problems == []
    asked = {one.partition("#")[0] for one in tab.requests}
    assert all(one.startswith(path.parent.as_uri()) for one in asked)
    for trouble in ("errors", "blocked"):
        assert tab.run(f"document.documentElement.dataset.{trouble}") is None


def test_the_page_has_no_case_of_its_own_and_every_case_is_in_one_file(
    written: Path, troubled: Results
) -> None:
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
def test_each_kind_of_case_opens_with_its_plots_and_those_of_other_files_over_it(
    many: Tab, written: Path, troubled: Results
) -> None:
    many.window(height=TALL)
    many.open(written.as_uri())
    assert parts_read(many) == []
    ids = many.run("[...document.querySelectorAll('#cases tbody a')].map((a) => a.hash.slice(1))")
    assert len(ids) == len(troubled.cases)
    for case, plots in KINDS.items():
        many.go(case)
        many.until(f"document.getElementById({case!r})?.checkVisibility()")
        many.until(BUILT)
        assert shown(many) == [case]
        assert many.run("document.querySelectorAll('[data-drawn]').length") == plots
    for view, plots in ((SYSTEM, 1), (DIAGNOSIS, 3)):
        many.go(view)
        many.until(f"document.getElementById({view!r})?.checkVisibility()")
        many.until(BUILT)
        assert many.run("document.querySelectorAll('[data-drawn]').length") == plots
    for view in many.run(
        "[...document.querySelectorAll('header nav a')].map((a) => a.hash.slice(1))"
    ):
        many.go(view)
        many.until(f"document.getElementById({view!r})?.checkVisibility()")
    asked = parts_read(many)
    assert len(asked) == len(set(asked))
    assert {*asked} < {file.name for file in folder_of(written).iterdir()}
    sound(many, written)


@needs_browser
def test_a_permalink_reads_its_own_file_and_the_way_back_none(many: Tab, written: Path) -> None:
    many.open(f"{written.as_uri()}#{BOTH}")
    assert shown(many) == [BOTH]
    many.until(BUILT)
    read = parts_read(many)
    assert 1 <= len(read) <= 3, "its own, and those of the engines over it"
    many.go("overview")
    many.until("document.querySelector('#overview').checkVisibility()")
    many.run("history.back()")
    many.until(f"document.getElementById('{BOTH}').checkVisibility()")
    assert parts_read(many) == read
    sound(many, written)


@needs_browser
def test_a_file_that_is_not_there_is_told_and_can_be_put_back(many: Tab, written: Path) -> None:
    folder = folder_of(written)
    folder.rename(folder.with_name("elsewhere"))
    many.open(f"{written.as_uri()}#{CASE}")
    assert shown(many) == ["overview"]
    told = many.run("document.getElementById('missing').innerText")
    assert told.startswith("The file index.parts/")
    assert told.endswith(".js can't be read; keep it together with this page.")
    folder.with_name("elsewhere").rename(folder)
    many.go("overview")
    many.go(CASE)
    many.until(f"document.getElementById({CASE!r})?.checkVisibility()")


@needs_browser
def test_of_many_rows_some_are_shown_until_all_are_asked_for(
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
        assert rows(tab) != first, "others are the first where the order is another"
        tab.run("document.getElementById('all').click()")
        assert len(rows(tab)) == count
        assert not tab.run("document.getElementById('all').checkVisibility()")
    with browser.tab(scripts=False) as tab:
        tab.send("Page.navigate", url=path.as_uri())
        tab.until("document.readyState === 'complete'")
        assert len(tab.run(ALL)) == count, "nobody without scripts could ask for more"


def test_a_second_report_forgets_files_of_the_first(
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


def test_what_can_not_be_written_leaves_the_old_page_and_its_files(
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
