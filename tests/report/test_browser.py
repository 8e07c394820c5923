"""The page in a real browser, if there is one."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from harness.report import write_report
from tests.report.test_page import HOSTILE, hostile

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
CHROMIUM = next((found for name in NAMES if (found := shutil.which(name))), None)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason=f"no browser found: {', '.join(NAMES)}")


def opened(tmp_path: Path, found: dict[str, Any], fragment: str) -> str:
    """The page as the browser has it after a while."""
    path = tmp_path / "index.html"
    write_report(path, found)
    done = subprocess.run(
        [
            str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
            "--no-first-run", "--disable-background-networking", "--disable-component-update",
            "--disable-sync", f"--user-data-dir={tmp_path / 'profile'}",
            "--virtual-time-budget=15000", "--dump-dom", f"{path.as_uri()}#{fragment}",
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return done.stdout


def page_tag(dom: str) -> str:
    found = re.search(r"<html[^>]*>", dom)
    assert found
    return found[0]


def drawn(dom: str) -> list[str]:
    return re.findall(r'data-drawn="([^"]*)"', dom)


def test_a_case_opened_by_its_permalink_draws_its_plots_and_no_other(
    tmp_path: Path, troubled: dict[str, Any]
) -> None:
    dom = opened(tmp_path, troubled, "case-system_1/robot.urdf/mujoco/driven")
    assert page_tag(dom) == '<html lang="en">', "an error, or something asked for, is noted there"
    # 2 coordinates: 2 x 2 motions, 4 components x 3 kinds, 3 x 2 of convergence, its slope.
    counts = re.fullmatch(r"(\d+) curves, (\d+) points", *drawn(dom))
    assert counts
    assert int(counts[1]) == 2 * 2 + 4 * 3 + 3 * 2 + 1
    # Every curve has its samples: a plot without data would count next to none.
    assert int(counts[2]) == 16 * 240 + 2 * (8 + 7 + 2) + 2


def test_without_a_permalink_nothing_is_drawn(tmp_path: Path, troubled: dict[str, Any]) -> None:
    dom = opened(tmp_path, troubled, "")
    assert page_tag(dom) == '<html lang="en">'
    assert drawn(dom) == []


def test_a_case_that_blew_up_is_drawn(tmp_path: Path, troubled: dict[str, Any]) -> None:
    dom = opened(tmp_path, troubled, "case-system_0/robot.urdf/mujoco/driven")
    assert page_tag(dom) == '<html lang="en">'
    assert len(drawn(dom)) == 1


def test_hostile_names_neither_run_nor_break_the_plots(
    tmp_path: Path, troubled: dict[str, Any]
) -> None:
    spoiled = hostile("".join(HOSTILE), troubled)
    write_report(tmp_path / "index.html", spoiled)
    ids = re.findall(r'id="(case-[^"]*)"', (tmp_path / "index.html").read_text("utf-8"))
    dom = opened(tmp_path, spoiled, ids[0])
    assert page_tag(dom) == '<html lang="en">'
    assert len(drawn(dom)) == 1
    assert "curves" in drawn(dom)[0]
