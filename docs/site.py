"""Hooks of the site: folders in the navigation, notebooks as pages, links that leave `docs/`."""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]*)(#[^)\s]*)?\)")
NOTEBOOKS = Path(__file__).parents[1] / "examples"


def on_config(config: Any, **_: Any) -> Any:
    """Replace each `folder/*` of the navigation by the pages of that folder."""
    config.nav = _expand(config.nav, Path(config.docs_dir))
    return config


def on_files(files: Files, *, config: Any, **_: Any) -> Files:
    """Add a page for each notebook."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        page = File.generated(config, f"examples/{path.stem}.md", content=notebook_page(path))
        files.append(page)
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

    return _LINK.sub(inside, markdown)


def notebook_page(path: Path) -> str:
    """Return a notebook's cells as Markdown; outputs are not stored in the repository."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join(map(_cell, cells)) + "\n"


def _cell(cell: dict[str, Any]) -> str:
    source = "".join(cell["source"])
    return f"```python\n{source}\n```" if cell["cell_type"] == "code" else source


def _expand(nav: list[Any], docs: Path) -> list[Any]:
    """Return the entries of a navigation; a section without pages is left out."""
    entries: list[Any] = []
    for entry in nav:
        if isinstance(entry, str):
            entries += _pages(entry, docs)
            continue
        ((title, inner),) = entry.items()
        expanded = _expand(inner, docs) if isinstance(inner, list) else inner
        if expanded:
            entries.append({title: expanded})
    return entries


def _pages(entry: str, docs: Path) -> list[str]:
    if not entry.endswith("/*"):
        return [entry]
    folder = entry.removesuffix("/*")
    if folder == "examples":
        return [f"examples/{path.stem}.md" for path in sorted(NOTEBOOKS.glob("*.ipynb"))]
    names = [path.name for path in (docs / folder).glob("*.md")]
    names.sort(key=lambda name: (name not in ("index.md", "README.md"), name))
    return [f"{folder}/{name}" for name in names]
