"""A page on the changes of engine upgrades, in the report's style, without a script."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.diff import Diff
from physics_crosscheck.harness.records.versions import Upgrade, Versions
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.text import percent, sci, shown
from physics_crosscheck.harness.render.terminal.versions import advice, counts


@dataclass(frozen=True, kw_only=True)
class VersionRow:
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
class ModelChangeView:
    """A model that changes, apart from its cases."""

    name: str
    kinds: str
    messages: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Section:
    """An upgrade."""

    title: str
    counts: str
    rows: tuple[VersionRow, ...]
    models: tuple[ModelChangeView, ...]
    same: tuple[VersionRow, ...]


@dataclass(frozen=True, kw_only=True)
class VersionsPage:
    """The page; `reports` has each version's number and the path of its report."""

    title: str
    advice: str
    left_out: tuple[str, ...]
    reports: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]


def write_versions(path: Path, result: Versions) -> None:
    """Write the page, with relative links to each version's report."""
    write_whole(path, render_versions(result, path.parent))


def render_versions(result: Versions, place: Path) -> str:
    """Return the page as HTML, to be saved in a folder."""
    page = VersionsPage(
        title=shown(f"{result.engine} {' -> '.join(one.version for one in result.versions)}"),
        advice=shown(advice(result).partition(";")[0]),
        left_out=tuple(map(shown, result.left_out)),
        reports=tuple(_reports(result, place)),
        sections=tuple(_section(result.engine, one) for one in result.upgrades),
    )
    return template("versions.html", page=page)


def _reports(result: Versions, place: Path) -> Iterator[tuple[str, str]]:
    for version in result.versions:
        where = Path(os.path.relpath(version.report, place)) / "index.html"
        yield shown(f"{result.engine} {version.version}"), where.as_posix()


def _section(engine: str, upgrade: Upgrade) -> Section:
    return Section(
        title=shown(f"{engine} {upgrade.before} -> {upgrade.after}"),
        counts=shown(counts(upgrade)),
        rows=tuple(map(_row, (*upgrade.not_compared, *upgrade.changed))),
        models=tuple(
            ModelChangeView(
                name=shown(model.id),
                kinds=", ".join(model.kinds),
                messages=tuple(map(shown, model.messages)),
            )
            for model in upgrade.models
        ),
        same=tuple(map(_row, upgrade.same)),
    )


def _row(case: Diff) -> VersionRow:
    before, after = case.outcomes
    then, now = case.global_errors
    return VersionRow(
        name=shown(case.id),
        kinds=case.summary,
        before=before or "none",
        after=after or "none",
        apart=sci(case.moved),
        uncertainty=sci(case.uncertainty),
        errors=(percent(then), percent(now)),
        messages=tuple(map(shown, case.messages)),
    )
