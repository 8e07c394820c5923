"""Hooks of the site: folders in the navigation, notebooks as pages, links that leave `docs/`.

If the gallery has been made, the site contains it, and the first page its table.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
import shutil
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

from physics_crosscheck.harness.interfaces.cli.reference import generated_pages

_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]*)(#[^)\s]*)?\)")
NOTEBOOKS = Path(__file__).parents[1] / "examples"
GALLERY = Path(__file__).parents[1] / "reports/gallery-site"
"""Pages of `python -m gallery`."""

PLACE = "<!-- gallery -->"
"""Place of the gallery's table in a page."""


def on_config(config: Any, **_: Any) -> Any:
    """Replace each `folder/*` of the navigation by the pages of that folder."""
    config.nav = _expand(config.nav, Path(config.docs_dir), generated_pages())
    return config


def on_files(files: Files, *, config: Any, **_: Any) -> Files:
    """Add the generated pages and schemas, and a page for each notebook.

    `EXECUTE_NOTEBOOKS=false` leaves out the outputs of notebooks.
    """
    for path, text in generated_pages().items():
        files.append(File.generated(config, path, content=text))
    paths = sorted(NOTEBOOKS.glob("*.ipynb"))
    notebooks = [nbformat.read(path, 4) for path in paths]
    if config.extra["execute_notebooks"]:
        with ThreadPoolExecutor() as pool:
            list(pool.map(execute, notebooks))
    for path, notebook in zip(paths, notebooks, strict=True):
        text = "\n\n".join(map(_cell, notebook.cells)) + "\n"
        files.append(File.generated(config, f"examples/{path.stem}.md", content=text))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Point links to notebooks at their pages; replace other links that leave the pages by text."""
    folder = posixpath.dirname(page.file.src_uri)

    def inside(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, link[2]))
        if not target.startswith("../"):
            return link[0]
        if target.startswith("../examples/"):
            to = posixpath.relpath(target[3:].replace(".ipynb", ".md"), folder or ".")
            return f"[{link[1]}]({to})"
        return link[1]

    return _LINK.sub(inside, markdown.replace(PLACE, gallery_table(GALLERY)))


def gallery_table(gallery: Path) -> str:
    """Return robots by engines as Markdown: digits, or what goes wrong; empty without a gallery."""
    if not (gallery / "gallery.json").is_file():
        return ""
    cells = json.loads((gallery / "gallery.json").read_bytes())["cells"]
    engines = sorted({cell["engine"] for cell in cells} - {"-"})
    rows: dict[str, dict[str, str]] = {}
    for cell in cells:
        suffix = cell["file"].rpartition(".")[2]
        name = f"[{cell['robot']}](gallery/{cell['page']}) {suffix}"
        rows.setdefault(name, {})[cell["engine"]] = cell["text"]
    lines = [f"| robot | {' | '.join(engines)} |", "|---" * (len(engines) + 1) + "|"]
    lines += [
        f"| {name} | {' | '.join(row.get(one, '') for one in engines)} |"
        for name, row in rows.items()
    ]
    head = "[The gallery](gallery/index.html): digits to which each engine follows the file."
    return "\n".join([head, "", *lines, ""])


def on_post_build(*, config: Any, **_: Any) -> None:
    """Copy the gallery into the site."""
    if GALLERY.is_dir():
        shutil.copytree(GALLERY, Path(config.site_dir, "gallery"), dirs_exist_ok=True)


def execute(notebook: Any) -> None:
    """Add the outputs to a notebook's cells; the files that it writes are deleted."""
    with TemporaryDirectory() as scratch:
        client = NotebookClient(
            notebook,
            timeout=300,
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": scratch}},
        )
        client.execute(env=os.environ | {"TMPDIR": scratch, "IPYTHONDIR": scratch})


def _cell(cell: Any) -> str:
    """Return a cell as Markdown, with formulas as MathML and outputs below the code."""
    if cell.cell_type == "markdown":
        return re.sub(r"\$([^$]+)\$", lambda formula: convert(formula[1]), cell.source)
    return "\n\n".join([f"```python\n{cell.source}\n```", *map(_output, cell.outputs)])


def _output(output: Any) -> str:
    """Return an output as Markdown: a picture, a table or text; a warning is an error."""
    if output.get("name") == "stderr":
        raise ValueError(output.text)
    data = output.get("data", {})
    if "image/png" in data:
        return f"![output](data:image/png;base64,{data['image/png'].strip()})"
    if "text/html" in data:
        html = re.sub(r"<style.*?</style>", "", data["text/html"], flags=re.DOTALL)
        return f"<div>{' '.join(html.split())}</div>"
    return f"```text\n{(data.get('text/plain') or output.text).rstrip()}\n```"


def _expand(nav: list[Any], docs: Path, generated: Collection[str]) -> list[Any]:
    """Return the entries of a navigation; a section without pages is left out."""
    entries: list[Any] = []
    for entry in nav:
        if isinstance(entry, str):
            entries += _pages(entry, docs, generated)
            continue
        ((title, inner),) = entry.items()
        expanded = _expand(inner, docs, generated) if isinstance(inner, list) else inner
        if expanded:
            entries.append({title: expanded})
    return entries


def _pages(entry: str, docs: Path, generated: Collection[str]) -> list[str]:
    if not entry.endswith("/*"):
        return [entry]
    folder = entry.removesuffix("/*")
    if folder == "examples":
        return [f"examples/{path.stem}.md" for path in sorted(NOTEBOOKS.glob("*.ipynb"))]
    names = [path.name for path in (docs / folder).glob("*.md")]
    names += [path.rpartition("/")[2] for path in generated if path.startswith(f"{folder}/")]
    names.sort(key=lambda name: (name not in ("index.md", "README.md"), name))
    return [f"{folder}/{name}" for name in names]
