"""The HTML report, drawn from results alone.

results --view--> strings, tables and packed plots --templates--> one HTML file. With many cases,
the page has the overview only and loads the other cases on demand from files next to it.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.results import coverage, next_steps
from physics_crosscheck.harness.results.next_steps import DEFAULT_OUT
from physics_crosscheck.harness.results.places import shown_path
from ..terminal.comparison import values_of
from ..terminal.table import summary
from . import overview, remedies, systems
from .cases import SYMBOLS, CaseView
from .diagnoses import short_places
from .maths import mathml
from .parts import (
    WHOLE,
    CaseFile,
    divided,
    forget_parts,
    part_of_cases,
    part_of_folder,
    write_parts,
)
from .scenes import three_code
from .text import exact, percent, quantity, sci, shown
from .view import FolderView, Report, worst_scene

PLOTTING = ("looks", "axes", "plots", "gestures", "legends", "tabs", "figures", "motion")
"""Files of `script/` that draw plots, omitted from a page without plots."""

SCENES = ("kinematics", "outlines", "solids", "marks", "scene")
"""Files of `script/` that draw bodies, omitted from a page without bodies."""

SCRIPTS = ("packs", "parts", *PLOTTING, *SCENES, "overview", "copying", "routes", "start")
"""Files of `script/`, in the order in which they are joined into one function."""

ROWS = 500
"""Initial rows in the list of cases; ten thousand rows take seconds to lay out."""

EARLY = 'document.documentElement.classList.add("js");'
"""Script that runs before rendering; without it, everything stays readable."""


HEAD = 4096
"""Number of bytes of a page in which its marker is searched."""

_MARKERS = (b'<meta name="generator" content="physics-crosscheck">', b"<title>crosscheck: ")
"""Marker of a page of this program, and of older pages without a generator."""


def is_own_page(path: Path) -> bool:
    """Return whether a file is a page of this program, by its marker.

    Raises:
        OSError: if the file can't be read.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    return any(marker in head for marker in _MARKERS)


def write_report(path: Path, results: Results) -> None:
    """Write the report of results: one self-contained HTML file.

    With more than `WHOLE` cases, the pages of the cases are in a folder next to it, `index.parts`
    for `index.html`.

    Raises:
        OSError: if the file can't be written; an existing page stays unchanged.
    """
    report = Report(results, path.parent)
    places, names = "", frozenset[str]()
    if len(results.cases) > WHOLE:
        places, names = write_parts(path, _parts(report))
    write_whole(path, page_of_report(report, places))
    forget_parts(path, names)


def _parts(report: Report) -> Iterator[CaseFile]:
    """Yield the files of a report's folders and cases."""
    page = environment().get_template("part.html")

    def render_views(folder: FolderView, views: Sequence[CaseView]) -> str:
        return page.render(report=report, group=folder, cases=views)

    for folder in report.folders.values():
        yield part_of_folder(folder, render_views(folder, ()), report)
    for folder in report.folders.values():
        for views in divided(folder):
            yield part_of_cases(views, render_views(folder, views), report.content)


def render(results: Results, out: Path = DEFAULT_OUT) -> str:
    """Return the report of results as HTML; the same results give the same text.

    Args:
        results: results of a run.
        out: folder of the report, as its commands name it.
    """
    return page_of_report(Report(results, out))


def page_of_report(
    report: Report, places: str = "", /, name: str = "report.html", **more: Any
) -> str:
    """Return the page of a report by a template, as `page_of` does.

    Args:
        report: its content.
        places: JSON with the file of each case; empty if the page contains all cases.
        name: name of the template.
        more: other variables of the template, such as `sentence`, its headline.
    """
    content, folders = report.content, report.folders.values()
    elsewhere: set[str] = set()
    if places:
        elsewhere = {name for view in report.cases for name in view.packs}
        elsewhere.update(name for folder in folders for name in folder.packs)
    packs = ((name, content.text(name)) for name in content.names if name not in elsewhere)
    values = {"sentence": report.sentences[0], "report": report, "folders": folders, "most": ROWS}
    drawn = {"plots": bool(content.names), "scenes": any(view.scene for view in report.cases)}
    return page_of(name, packs, places, **{**values, **drawn, **more})


def page_of(
    name: str,
    packs: Iterable[tuple[str, str]],
    places: str = "",
    *,
    plots: bool = False,
    scenes: bool = False,
    folders: Iterable[FolderView] = (),
    sentence: str,
    **values: object,
) -> str:
    """Return a page with the report's script, by a template that is or extends `report.html`.

    Args:
        name, values: name and variables of the template.
        packs: ids and texts of its packs.
        places: as in `page_of_report`.
        plots, scenes: whether it has plots, and bodies.
        folders: folders that its header names.
        sentence: headline.
    """
    script, code = _inline(_script(plots=plots, scenes=scenes)), three_code() if scenes else ""
    return template(
        name,
        [script, *([code] if code else [])],
        bool(places),
        title=sentence,
        sentence=sentence,
        folders=folders,
        packs=packs,
        early=Markup(EARLY),
        script=Markup(script),
        whole=not places,
        places=Markup(_inline(places)),
        **values,
    )


def template(
    page: str | jinja2.Template,
    running: Sequence[str] = (),
    reads: bool = False,
    /,
    **values: object,
) -> str:
    """Fill a template in the report's style.

    Args:
        page: the template, or its name.
        running: scripts besides the early one; none: no script at all.
        reads: whether the page may load scripts from its folder.
        values: variables of the template.
    """
    return (
        environment()
        .get_template(page)
        .render(
            style=Markup(_resource("style.css")),
            policy=_policy([EARLY, *running] if running else [], reads),
            **values,
        )
    )


@cache
def environment() -> jinja2.Environment:
    """Return the cached environment, as compiling templates takes longer than filling them."""
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _resource(f"pages/{name}")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=safe,
    )
    environment.filters |= {
        "shown_path": shown_path,
        "exact": exact,
        "mathml": mathml,
        "percent": percent,
        "places": short_places,
        "quantity": quantity,
        "sci": sci,
        "unbroken": unbroken,
        "visible": shown,
    }
    environment.globals |= {
        "summary": summary,
        "symbols": SYMBOLS,
        "worst_scene": worst_scene,
        "values_of": values_of,
    }
    for module in (systems, overview, remedies, coverage, next_steps):
        environment.globals[module.__name__.rpartition(".")[2]] = module
    return environment


def safe(value: object) -> object:
    """Make invisible characters of a value visible; markup of this program stays as it is."""
    return value if isinstance(value, Markup) else shown(value)


def unbroken(text: object) -> Markup:
    """Escape text for HTML, and keep each number with an exponent on one line.

    Browsers break a line after the hyphen of `1.2e-10`.
    """
    kept = r'<span class="unbroken">\g<0></span>'
    return Markup(re.sub(r"\d(?:\.\d+)?e[-+]\d+", kept, str(escape(safe(text)))))


def _script(plots: bool, scenes: bool) -> str:
    """Return the page's script, with or without the code for plots and for bodies."""
    omitted = (*(() if plots else PLOTTING), *(() if scenes else SCENES))
    names = [name for name in SCRIPTS if name not in omitted]
    parts = "\n".join(_resource(f"script/{name}.js") for name in names)
    return f'"use strict";\n(() => {{\n{parts}\n}})();\n'


def _resource(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text("utf-8")


def _inline(script: str) -> str:
    """Escape a script for a script element."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _policy(scripts: list[str], reads: bool) -> str:
    """Return the content security policy: run these scripts, apply own styles, load nothing.

    A page with files of cases also loads scripts from its own server. A page opened from disk loads
    them from files, since no policy distinguishes one file from another.
    """
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{each}'" for each in hashes) or "'none'"
    if reads:
        allowed += " 'self' file:"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline';"
        " img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
