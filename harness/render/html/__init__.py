"""The HTML report, drawn from results alone.

results --view--> strings, tables and packed plots --templates--> one HTML file; of many cases, a
file of the overview and, beside it, files of cases, which it reads when they are looked at
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from physics_crosscheck.harness.records.history import Past
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html.parts import (
    WHOLE,
    Part,
    divided,
    forget_parts,
    part_of_cases,
    part_of_group,
    write_parts,
)
from physics_crosscheck.harness.render.html.view import Report, report
from physics_crosscheck.harness.results.next_steps import DEFAULT_OUT

PLOTTING = ("looks", "axes", "plots", "gestures", "legends", "figures", "motion")
"""Files of `script/` that draw plots, which a page without plots does not need."""

SCRIPTS = ("packs", "parts", *PLOTTING, "overview", "copying", "routes", "start")
"""Files of `script/`, in the order in which they follow each other in one function."""

ROWS = 500
"""Of the list of cases at first, until all are asked for: to lay out ten thousand takes seconds."""

EARLY = 'document.documentElement.classList.add("js");'
"""What runs before anything is shown: without it, everything stays readable."""


HEAD = 4096
"""Bytes of a page in which its marker is looked for."""

_MARKERS = (b'<meta name="generator" content="physics-crosscheck">', b"<title>crosscheck: ")
"""Of a page of this program, and of one that it wrote before pages named their generator."""


def is_own_page(path: Path) -> bool:
    """Whether a file is a page of this program, as its marker has it.

    Raises:
        OSError: for a file that can't be read.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    return any(marker in head for marker in _MARKERS)


def write_report(path: Path, results: Results, history: Sequence[Past] = ()) -> None:
    """Write the report of results: one HTML file that asks for nothing else.

    Of more than `WHOLE` cases, the cases' own pages are in a folder beside it, `index.parts` of
    `index.html`, and nothing else is asked for.

    Raises:
        OSError: as the file system has it; the page that was there is as it was.
    """
    found = report(results, path.parent, history)
    places, names = "", frozenset[str]()
    if len(results.cases) > WHOLE:
        places, names = write_parts(path, _parts(found))
    write_whole(path, _page(found, places))
    forget_parts(path, names)


def _parts(found: Report) -> Iterator[Part]:
    """The files of a report's folders, and of its cases."""
    page = _environment().get_template("part.html")
    for group in found.groups:
        yield part_of_group(group, page.render(groups=[group], cases=()), found.packs)
    for cases in divided(found.groups):
        yield part_of_cases(cases, page.render(groups=(), cases=cases), found.packs)


def render(results: Results, out: Path = DEFAULT_OUT, history: Sequence[Past] = ()) -> str:
    """The report of results as one HTML file; the same results and history give the same text.

    Args:
        results: of a run.
        out: folder that it lies in, as its commands name it.
        history: cases in past runs.
    """
    return _page(report(results, out, history))


def _page(found: Report, places: str = "") -> str:
    """The page of a report.

    Args:
        found: what it shows.
        places: JSON of which file each case is in; empty where the page has them itself.
    """
    script = _inline(_script(plots=bool(found.packs)))
    elsewhere: set[str] = set()
    if places:
        elsewhere = {case.pack for case in found.cases}
        elsewhere.update(name for group in found.groups for name in group.packs)
    return template(
        "report.html",
        [script],
        bool(places),
        report=found,
        packs=((name, found.packs[name]) for name in found.packs if name not in elsewhere),
        early=Markup(EARLY),
        script=Markup(script),
        whole=not places,
        most=ROWS,
        places=Markup(_inline(places)),
    )


def template(
    name: str, running: Sequence[str] = (), reads: bool = False, /, **values: object
) -> str:
    """A page in the report's style.

    Args:
        name: of its template.
        running: scripts that it runs, beside the early one; none: it runs nothing at all.
        reads: whether it may read scripts beside it.
        values: what it shows.
    """
    return (
        _environment()
        .get_template(name)
        .render(
            style=Markup(_resource("style.css")),
            policy=_policy([EARLY, *running] if running else [], reads),
            **values,
        )
    )


@cache
def _environment() -> jinja2.Environment:
    """Kept, as compiling its pages takes longer than filling them."""
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _resource(f"pages/{name}")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["unbroken"] = unbroken
    return environment


def unbroken(text: object) -> Markup:
    """Escape text for HTML, and keep each number with an exponent on one line.

    Browsers break a line after the hyphen of `1.2e-10`.
    """
    kept = r'<span class="unbroken">\g<0></span>'
    return Markup(re.sub(r"\d(?:\.\d+)?e[-+]\d+", kept, str(escape(text))))


def _script(plots: bool) -> str:
    """Return the page's script, with what draws plots or without."""
    names = [name for name in SCRIPTS if plots or name not in PLOTTING]
    parts = "\n".join(_resource(f"script/{name}.js") for name in names)
    return f'"use strict";\n(() => {{\n{parts}\n}})();\n'


def _resource(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text("utf-8")


def _inline(script: str) -> str:
    """A script as the content of a script element, which it must not end."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _policy(scripts: list[str], reads: bool) -> str:
    """What the page may do: run these scripts, style itself, and load nothing from anywhere.

    Of a page with files of cases, scripts from where it is itself too: from its server, or where it
    is a file from files, among which no policy tells one from another.
    """
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{each}'" for each in hashes) or "'none'"
    if reads:
        allowed += " 'self' file:"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline';"
        " img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
