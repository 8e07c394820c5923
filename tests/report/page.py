"""A parsed page."""

from __future__ import annotations

import html.parser


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
