"""A parsed page."""

import html.parser
import re

Attributes = dict[str, str | None]

BLOCKS = {
    "article", "button", "div", "dt", "footer", "h1", "h2", "h3", "h4", "header", "label", "li",
    "main", "nav", "noscript", "p", "pre", "section", "summary", "table", "title", "tr",
}  # fmt: skip
"""Elements that start a line of text."""


class Page(html.parser.HTMLParser):
    """A page taken apart: its elements, its text by lines and views, its packed numbers."""

    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.source = source
        self.elements: list[tuple[str, Attributes]] = []
        self.text = ""
        self.contents: dict[str, list[str]] = {"script": [], "style": []}
        self.packs: dict[str, str] = {}
        self._views = {"": [""]}
        self._lines = self._views[""]
        self._links: list[str] = []
        self._within: tuple[str, Attributes] | None = None
        self.feed(source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        self._within = (tag, attributes) if tag in self.contents else None
        classes = (attributes.get("class") or "").split()
        if "view" in classes:
            self._lines = self._views.setdefault(str(attributes["id"]), [])
        if tag in BLOCKS or "view" in classes:
            self._lines.append("> " if "marked" in classes else "")
        if tag in ("td", "th", "dd"):
            self._lines[-1] += " | "
        if tag == "li" and "value" in attributes:
            self._lines[-1] += f"{attributes['value']}: "
        if "data-copy" in attributes:
            self._lines += [f"copies {line}" for line in str(attributes["data-copy"]).splitlines()]
            self._lines.append("")
        if tag == "a":
            self._links.append(str(attributes["href"]))

    def handle_endtag(self, tag: str) -> None:
        self._within = None
        if tag == "a":
            self._lines[-1] += f" ({self._links.pop()})"

    def handle_data(self, data: str) -> None:
        if self._within is None:
            self.text += data
            self._lines[-1] += data
            return
        tag, attrs = self._within
        if attrs.get("type") == "text/plain":
            self.packs[str(attrs["id"])] = data
        else:
            self.contents[tag].append(data)

    def ids(self) -> list[str]:
        return [str(attrs["id"]) for _, attrs in self.elements if "id" in attrs]

    def lines(self, views: str) -> list[str]:
        """Return the text of the views whose ids match a pattern, with the targets of links."""
        names = [name for name in self._views if re.fullmatch(views, name)]
        lines = (line for name in names for line in (f"## {name}", *self._views[name]))
        return [" ".join(line.split()) for line in lines if line.strip()]
