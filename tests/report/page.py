"""A parsed page."""

from __future__ import annotations

import html
import html.parser
import re


class Page(html.parser.HTMLParser):
    """A page taken apart: its elements, its text, its packed numbers."""

    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.source = source
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.contents: dict[str, list[str]] = {"script": [], "style": []}
        self.packs: dict[str, str] = {}
        self._within: tuple[str, dict[str, str | None]] | None = None
        self.feed(source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._within = (tag, dict(attrs)) if tag in self.contents else None

    def handle_endtag(self, tag: str) -> None:
        self._within = None

    def handle_data(self, data: str) -> None:
        if self._within is None:
            self.text += data
            return
        tag, attrs = self._within
        if attrs.get("type") == "text/plain":
            self.packs[str(attrs["id"])] = data
        else:
            self.contents[tag].append(data)

    def ids(self) -> list[str]:
        return [str(attrs["id"]) for _, attrs in self.elements if "id" in attrs]


def plain(markup: str) -> str:
    """Return the text of a part of a page, with single spaces."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", markup)).replace("\u00a0", " ").split())


def view_of(source: str, identity: str) -> str:
    """Return the part of a page that an id names, up to the next view."""
    return re.split(r'<(?:section|details) class="view', source.split(f' id="{identity}"')[1])[0]


def table_rows(source: str, label: str) -> list[list[str]]:
    """Return the cells of a table by its label, without its header."""
    body = source.split(f'aria-label="{label}"')[1].split("</table>")[0].split("<tbody>")[1]
    rows = body.split("<tr")[1:]
    return [[plain("<" + one) for one in re.split(r"<t[dh]", row)[1:]] for row in rows]


def facts_of(source: str) -> dict[str, str]:
    """Return the terms of a part of a page with their descriptions."""
    pairs = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", source, re.DOTALL)
    return {plain(term): plain(text) for term, text in pairs}
