"""Files with the cases of a large report, which the page loads on demand.

A page of ten thousand cases would take about 300 MB, of which a reader views little. For many
cases, the page keeps the overview only. Each folder has a file with its page and diagnoses. The
cases of a folder and a scenario share files with a maximum number of cases, since they are drawn
together.
"""

from __future__ import annotations

import contextlib
import hashlib
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import msgspec

from physics_crosscheck.harness.render.html.cases import CaseView
from physics_crosscheck.harness.render.html.packs import compressed
from physics_crosscheck.harness.render.html.view import Content, FolderView, Report

WHOLE = 500
"""Maximum number of cases in a single-file page: 15 MB, small enough to send."""

TOGETHER = 40
"""Maximum number of cases per file: 1 MB, loaded and shown at once."""


@dataclass(frozen=True, kw_only=True)
class CaseFile:
    """A file of cases as a script, the only type that a page on disk can load.

    Attributes:
        name: file name, by its content.
        text: its content.
        ids: ids of its cases and packs.
    """

    name: str
    text: str
    ids: tuple[str, ...]


def divided(folder: FolderView) -> Iterator[tuple[CaseView, ...]]:
    """Yield the cases of a folder, divided into files by scenario."""
    for cases in folder.by_scenario.values():
        rest = iter(cases)
        while some := tuple(islice(rest, TOGETHER)):
            yield some


def part_of_cases(cases: Sequence[CaseView], html: str, content: Content) -> CaseFile:
    """Return the file of some cases: their pages as HTML, and their packs."""
    own_packs = {name: content.text(name) for view in cases for name in view.packs}
    return _part(html, own_packs, [view.id for view in cases])


def part_of_folder(folder: FolderView, html: str, report: Report) -> CaseFile:
    """Return the file of a folder: its page with the sketch of its motions, and its diagnoses."""
    own_packs = {name: report.content.text(name) for name in folder.packs}
    diagnoses = [report.diagnoses[key].id for key in folder.by_model if key in report.diagnoses]
    return _part(html, own_packs, [folder.id, *diagnoses])


def _part(html: str, own_packs: Mapping[str, str], views: Sequence[str]) -> CaseFile:
    content = compressed({"html": html})
    name = hashlib.sha256("".join((content, *own_packs.values())).encode()).hexdigest()[:16] + ".js"
    given = msgspec.json.encode([name, content, own_packs]).decode()
    return CaseFile(name=name, text=f"crosscheckPart(...{given});\n", ids=(*views, *own_packs))


def folder_of(page: Path) -> Path:
    """Return the folder of the files of a page's cases."""
    return page.with_name(f"{page.stem}.parts")


def write_parts(page: Path, parts: Iterable[CaseFile]) -> tuple[str, frozenset[str]]:
    """Write the files of a page's cases; return JSON with the file of each id, and the file names.

    Files of the previous page stay for its open windows until `forget_parts` removes them.

    Args:
        page: the page's path.
        parts: files, consumed one at a time.

    Raises:
        OSError: if a file can't be written; the existing page stays unchanged.
    """
    folder = folder_of(page)
    page.parent.mkdir(parents=True, exist_ok=True)
    places: dict[str, int] = {}
    names: list[str] = []
    with tempfile.TemporaryDirectory(dir=page.parent, prefix=f".{folder.name}.") as temporary:
        for part in parts:
            Path(temporary, part.name).write_text(part.text, encoding="utf-8")
            places |= dict.fromkeys(part.ids, len(names))
            names.append(part.name)
        folder.mkdir(exist_ok=True)
        for name in names:
            Path(temporary, name).replace(folder / name)
    given = {"folder": folder.name, "names": names, "places": places}
    return msgspec.json.encode(given).decode(), frozenset(names)


def forget_parts(page: Path, kept: Collection[str]) -> None:
    """Remove files that a page no longer uses, and the folder if it is empty."""
    folder = folder_of(page)
    for old in folder.glob("*.js"):
        if old.name not in kept:
            old.unlink()
    with contextlib.suppress(OSError):  # missing, or not empty
        folder.rmdir()
