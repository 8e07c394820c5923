"""A page on the changes of engine upgrades, in the report's style, without a script."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.versions import Upgrade, VersionCase, Versions
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.text import percent, sci, shown
from physics_crosscheck.harness.render.terminal.versions import advice, counts


@dataclass(frozen=True, kw_only=True)
class Row:
    """A case that changes."""

    name: str
    kinds: str
    before: str
    after: str
    apart: str
    uncertainty: str
    errors: tuple[str, str]
    messages: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Beside:
    """A model that changes, apart from its cases."""

    name: str
    kinds: str
    messages: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Section:
    """An upgrade."""

    title: str
    counts: str
    rows: tuple[Row, ...]
    models: tuple[Beside, ...]
    same: tuple[Row, ...]


@dataclass(frozen=True, kw_only=True)
class Page:
    """The page; `reports` has each version's number and the path of its report."""

    title: str
    advice: str
    left_out: tuple[str, ...]
    reports: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]


def write_versions(path: Path, found: Versions) -> None:
    """Write the page, with relative links to each version's report."""
    write_whole(path, render_versions(found, path.parent))


def render_versions(found: Versions, place: Path) -> str:
    """Return the page as HTML, to be saved in a folder."""
    page = Page(
        title=shown(f"{found.engine} {' -> '.join(one.version for one in found.versions)}"),
        advice=shown(advice(found).partition(";")[0]),
        left_out=tuple(map(shown, found.left_out)),
        reports=tuple(_reports(found, place)),
        sections=tuple(_section(found.engine, one) for one in found.upgrades),
    )
    return template("versions.html", page=page)


def _reports(found: Versions, place: Path) -> Iterator[tuple[str, str]]:
    for one in found.versions:
        where = Path(os.path.relpath(one.report, place)) / "index.html"
        yield shown(f"{found.engine} {one.version}"), where.as_posix()


def _section(engine: str, one: Upgrade) -> Section:
    return Section(
        title=shown(f"{engine} {one.before} -> {one.after}"),
        counts=shown(counts(one)),
        rows=tuple(_row(case) for case in one.cases if case.kinds),
        models=tuple(
            Beside(
                name=shown(model.id),
                kinds=", ".join(model.kinds),
                messages=tuple(map(shown, model.messages)),
            )
            for model in one.models
        ),
        same=tuple(map(_row, one.same)),
    )


def _row(case: VersionCase) -> Row:
    return Row(
        name=shown(case.id),
        kinds=", ".join(case.kinds),
        before=case.before or "none",
        after=case.after or "none",
        apart=sci(case.apart),
        uncertainty=sci(case.uncertainty),
        errors=(percent(case.global_error_before), percent(case.global_error_after)),
        messages=tuple(map(shown, case.messages)),
    )
