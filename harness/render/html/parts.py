"""Cases of a report that has many of them, in files beside the page that it reads when wanted.

A page of ten thousand cases would be some 300 MB, of which a reader looks at a few. Where there are
many, the page keeps the overview, a file each has the page of a folder with its diagnoses, and one
the cases of a folder and a scenario, so many at most: those are drawn over each other.
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
from physics_crosscheck.harness.render.html.view import Beside, Group, ModelGroup

WHOLE = 500
"""Cases up to which a page is one file: 15 MB, which can be sent to somebody."""

TOGETHER = 40
"""Cases of a file at most: 1 MB, read and shown at once."""


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A case's own page, with what it stands in."""

    case: CaseView
    beside: Beside
    model: ModelGroup
    group: Group


@dataclass(frozen=True, kw_only=True)
class Part:
    """A file of cases, as a script: a page from a disk may read nothing else.

    Attributes:
        name: of the file, by its content.
        text: its content.
        ids: of the cases and the packs that it has.
    """

    name: str
    text: str
    ids: tuple[str, ...]


def divided(groups: Iterable[Group]) -> Iterator[tuple[Shown, ...]]:
    """All cases, as they go into files."""
    for group in groups:
        scenarios: dict[str, list[Shown]] = {}
        for model in group.models:
            for case, beside in model.cases:
                one = Shown(case=case, beside=beside, model=model, group=group)
                scenarios.setdefault(case.scenario, []).append(one)
        for cases in scenarios.values():
            rest = iter(cases)
            while some := tuple(islice(rest, TOGETHER)):
                yield some


def part_of_cases(cases: Sequence[Shown], html: str, packs: Mapping[str, str]) -> Part:
    """The file of some cases: their pages as HTML, and their packs."""
    own = {one.case.pack: packs[one.case.pack] for one in cases if one.case.pack}
    return _part(html, own, [one.case.id for one in cases])


def part_of_group(group: Group, html: str, packs: Mapping[str, str]) -> Part:
    """The file of a folder: its page, which has the sketch of its motions, and its diagnoses."""
    diagnoses = [model.diagnosis for model in group.models if model.diagnosis]
    own = {name: packs[name] for name in group.packs}
    return _part(html, own, [group.id, *(diagnosis.id for diagnosis in diagnoses)])


def _part(html: str, own: Mapping[str, str], views: Sequence[str]) -> Part:
    content = compressed({"html": html})
    name = hashlib.sha256("".join((content, *own.values())).encode()).hexdigest()[:16] + ".js"
    given = msgspec.json.encode([name, content, own]).decode()
    return Part(name=name, text=f"crosscheckPart(...{given});\n", ids=(*views, *own))


def folder_of(page: Path) -> Path:
    """Where the files of a page's cases are."""
    return page.with_name(f"{page.stem}.parts")


def write_parts(page: Path, parts: Iterable[Part]) -> tuple[str, frozenset[str]]:
    """Write the files of a page's cases: JSON of where each id is, and the files' names.

    Files of the page that was there stay: whoever has it open finds them until the new one is there
    and `forget_parts` is asked to.

    Args:
        page: the page's path.
        parts: one after the other, none of which is kept.

    Raises:
        OSError: as the file system has it; the page that was there is as it was.
    """
    folder = folder_of(page)
    page.parent.mkdir(parents=True, exist_ok=True)
    places: dict[str, int] = {}
    names: list[str] = []
    with tempfile.TemporaryDirectory(dir=page.parent, prefix=f".{folder.name}.") as temporary:
        for one in parts:
            Path(temporary, one.name).write_text(one.text, encoding="utf-8")
            places |= dict.fromkeys(one.ids, len(names))
            names.append(one.name)
        folder.mkdir(exist_ok=True)
        for name in names:
            Path(temporary, name).replace(folder / name)
    given = {"folder": folder.name, "names": names, "places": places}
    return msgspec.json.encode(given).decode(), frozenset(names)


def forget_parts(page: Path, kept: Collection[str]) -> None:
    """Remove files that a page has no longer, and their folder where that was all."""
    folder = folder_of(page)
    for old in folder.glob("*.js"):
        if old.name not in kept:
            old.unlink()
    with contextlib.suppress(OSError):  # there is none, or there are files in it
        folder.rmdir()
