"""The HTML report, drawn from results alone.

results --view--> strings and charts --template, Bokeh--> one HTML file
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from harness.report.plots import bokeh_script, draw
from harness.report.view import report
from harness.results import write_whole


def write_report(path: Path, found: Mapping[str, Any]) -> None:
    """Write the report of results as one HTML file that asks for nothing else."""
    write_whole(path, render(found))


def render(found: Mapping[str, Any]) -> str:
    """The report of results as HTML; the same results give the same text."""
    shown = report(found)
    scripts = [_inline(text) for text in (_resource("script.js"), bokeh_script())]
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_resource), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("template.html").render(
        report=shown,
        style=Markup(_resource("style.css")),
        scripts=[Markup(text) for text in scripts],
        policy=_policy(scripts),
        plots=draw({case.plots: case.charts for case in shown.cases if case.charts}),
    )


def _resource(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text("utf-8")


def _inline(script: str) -> str:
    """A script as the content of a script element, which it must not end."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _policy(scripts: list[str]) -> str:
    """What the page may do: run these scripts, style itself, and load nothing from anywhere."""
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{each}'" for each in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline';"
        " img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
