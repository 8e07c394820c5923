"""Tables, formulas and matrices of a page: for a terminal, and in LaTeX."""

from __future__ import annotations

import textwrap
from abc import ABC, abstractmethod
from collections.abc import Sequence

WIDTH = 100
"""Width of a terminal in columns."""


class Table(ABC):
    """A table that a template fills row by row; its text omits empty columns."""

    def __init__(self, *header: str) -> None:
        self.header = header
        self.rows: list[tuple[str, ...]] = []

    def row(self, *cells: str) -> None:
        """Add a row, with as many cells as the header has."""
        self.rows.append(cells)

    def __str__(self) -> str:
        columns = zip(*(self.header, *self.rows), strict=True)
        used = [column for column in columns if any(column)]
        return self._text([list(row) for row in zip(*used, strict=True)])

    @abstractmethod
    def _text(self, rows: list[list[str]]) -> str: ...


class TextTable(Table):
    """A table that fits the terminal's width."""

    def _text(self, rows: list[list[str]]) -> str:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        while sum(widths) + 2 * len(widths) > WIDTH:
            widths[widths.index(max(widths))] -= 1
        lines = []
        for row in rows:
            # Cells wider than their column continue below.
            parts = [textwrap.wrap(c, w) or [""] for c, w in zip(row, widths, strict=True)]
            for i in range(max(map(len, parts))):
                line = "  ".join(
                    (part[i] if i < len(part) else "").ljust(width)
                    for part, width in zip(parts, widths, strict=True)
                )
                lines.append(f"  {line}".rstrip())
        lines.insert(1, "  " + "  ".join("-" * width for width in widths))
        return "\n".join(lines)


class LatexTable(Table):
    """A `tabular` whose columns with long texts are paragraphs."""

    def _text(self, rows: list[list[str]]) -> str:
        share = 0.7 if len(rows[0]) < 3 else 0.45
        columns = "".join(
            rf"p{{{share}\linewidth}}" if max(map(len, column)) > 40 else "l"
            for column in zip(*rows, strict=True)
        )
        lines = [" & ".join(row) + r" \\" for row in rows]
        lines[0] += r" \hline"
        body = "\n".join(lines)
        return f"\\noindent\\begin{{tabular}}{{{columns}}}\n{body}\n\\end{{tabular}}"


class Formulas(ABC):
    """Formulas that a template adds one by one, each `left = right`, or `left` alone."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, str]] = []

    def row(self, lhs: str, right: str = "") -> None:
        """Add a formula."""
        self.rows.append((lhs, right))

    @abstractmethod
    def __str__(self) -> str: ...


class TextFormulas(Formulas):
    """Formulas in a terminal, one per line; long ones continue below."""

    def __str__(self) -> str:
        return "\n".join(
            line
            for left, right in self.rows
            for line in textwrap.wrap(
                f"{left} = {right}" if right else left,
                WIDTH,
                initial_indent="  ",
                subsequent_indent="      ",
                break_long_words=False,
                break_on_hyphens=False,
            )
        )


class LatexFormulas(Formulas):
    """Formulas aligned at their equals signs."""

    def __str__(self) -> str:
        lines = [f"{left} &= {right}" if right else f"&{left}" for left, right in self.rows]
        return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}"


def heading(text: str, line: str) -> str:
    """Return an underlined heading."""
    return f"{text}\n{line * len(text)}"


def text_matrix(name: str, forms: Sequence[Sequence[Sequence[str]]]) -> str:
    """Return `name = matrix = matrix`; forms that are too wide are omitted except the last.

    Args:
        name: name of the matrix.
        forms: each is rows of formulas, all of the same size.
    """
    blocks = [_block(form) for form in forms]
    lines = []
    for i in range(len(forms[0])):
        joint = " = " if i == 0 else "   "
        lead = f"  {name if i == 0 else ' ' * len(name)}"
        lines.append(lead + "".join(joint + block[i] for block in blocks))
    if max(map(len, lines)) > WIDTH and len(forms) > 1:
        return text_matrix(name, forms[1:])
    return "\n".join(lines)


def _block(form: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*form, strict=True)]
    return [
        "[ " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " ]"
        for row in form
    ]
