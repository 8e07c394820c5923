"""The HTML report, drawn from results alone.

results --view--> strings, tables and packed plots --templates--> one HTML file
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import jinja2
from bokeh.resources import Resources
from markupsafe import Markup

from harness.records.history import Past
from harness.records.results import Results
from harness.records.write import write_whole
from harness.report.view import report
from harness.text.next_steps import DEFAULT_OUT

SCRIPTS = (
    "packs",
    "looks",
    "plots",
    "legends",
    "figures",
    "motion",
    "overview",
    "copying",
    "routes",
    "start",
)
"""Files of `script/`, in the order in which they follow each other in one function."""

EARLY = 'document.documentElement.classList.add("js");'
"""What runs before anything is shown: without it, everything stays readable."""


def write_report(path: Path, results: Results, history: Sequence[Past] = ()) -> None:
    """Write the report of results as one HTML file that asks for nothing else."""
    write_whole(path, render(results, path.parent, history))


def render(results: Results, out: Path = DEFAULT_OUT, history: Sequence[Past] = ()) -> str:
    """The report of results as HTML; the same results and history give the same text.

    Args:
        results: of a run.
        out: folder that it lies in, as its commands name it.
        history: cases in past runs.
    """
    scripts = [_inline(text) for text in (_bokeh(), _own())]
    return template(
        "report.html",
        scripts,
        report=report(results, out, history),
        early=Markup(EARLY),
        scripts=[Markup(text) for text in scripts],
    )


def template(name: str, running: Sequence[str] = (), **values: object) -> str:
    """A page in the report's style.

    Args:
        name: of its template.
        running: scripts that it runs, beside the early one; none: it runs nothing at all.
        values: what it shows.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _resource(f"pages/{name}")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(name).render(
        style=Markup(_resource("style.css")),
        policy=_policy([EARLY, *running] if running else []),
        **values,
    )


def _bokeh() -> str:
    """BokehJS from the installed wheel: models and their programming interface, no widgets.

    Measured: 1.4 MB inlined; Plotly's is 4.8 MB, and is slower to start by its size.
    """
    return "\n".join(Resources(mode="inline", components=["bokeh", "bokeh-api"]).js_raw)


def _own() -> str:
    parts = "\n".join(_resource(f"script/{name}.js") for name in SCRIPTS)
    return f'"use strict";\n(() => {{\n{parts}\n}})();\n'


def _resource(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text("utf-8")


def _inline(script: str) -> str:
    """A script as the content of a script element, which it must not end."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _policy(scripts: list[str]) -> str:
    """What the page may do: run these scripts, style itself, and load nothing from anywhere."""
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{each}'" for each in hashes) or "'none'"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline';"
        " img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
