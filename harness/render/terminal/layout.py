"""Tables, formulas and matrices of a page: for a terminal, and in LaTeX."""

from __future__ import annotations

import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence


class Table(ABC):
    """A table that a template fills row by row; its text omits empty columns.

    Args:
        header: names of the columns.
        width: of a terminal, in columns.
    """

    def __init__(self, *header: str, width: int) -> None:
        self.header, self.width = header, width
        self.rows: list[tuple[str, ...]] = []

    def row(self, *cells: str) -> None:
        """Add a row, with as many cells as the header has."""
        self.rows.append(cells)

    def __str__(self) -> str:
        columns = zip(*(self.header, *self.rows), strict=True)
        used = [column for column in columns if any(column[1:])]
        return self._text([list(row) for row in zip(*used, strict=True)])

    @abstractmethod
    def _text(self, rows: list[list[str]]) -> str: ...


class TextTable(Table):
    """A table that fits the terminal's width."""

    def _text(self, rows: list[list[str]]) -> str:
        columns = list(zip(*rows, strict=True))
        widths = [max(map(len, column)) for column in columns]
        words = [max(len(word) for cell in c for word in cell.split() or [""]) for c in columns]
        spare = [w - least for w, least in zip(widths, words, strict=True)]
        while sum(widths) + 2 * len(widths) > self.width and any(spare):
            i = max((i for i, left in enumerate(spare) if left), key=widths.__getitem__)
            widths[i], spare[i] = widths[i] - 1, spare[i] - 1
        # No word is cut: where even words are too wide, the gaps shrink.
        gap = "  " if sum(widths) + 2 * len(widths) <= self.width else " "
        lines = []
        for row in rows:
            # Cells wider than their column continue below.
            parts = [textwrap.wrap(c, w) or [""] for c, w in zip(row, widths, strict=True)]
            for i in range(max(map(len, parts))):
                line = gap.join(
                    (part[i] if i < len(part) else "").ljust(width)
                    for part, width in zip(parts, widths, strict=True)
                )
                lines.append(f"  {line}".rstrip())
        lines.insert(1, "  " + gap.join("-" * width for width in widths))
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
    """Formulas that a template adds one by one, each `left = right`, or `left` alone.

    Args:
        width: of a terminal, in columns.
    """

    def __init__(self, width: int) -> None:
        self.rows: list[tuple[str, str]] = []
        self.width = width

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
                self.width,
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


def heading(text: str, line: str, width: int) -> str:
    """Return an underlined heading; the line has at most `width` columns."""
    return f"{text}\n{line * min(len(text), width)}"


def text_matrix(name: str, forms: Sequence[Sequence[Sequence[str]]], width: int) -> str:
    """Return `name = matrix = matrix`; forms that are too wide are omitted except the last.

    The last is printed in parts of its columns if it is too wide.

    Args:
        name: name of the matrix.
        forms: each is rows of formulas, all of the same size.
        width: of a terminal, in columns.
    """
    blocks = [_block(form) for form in forms]
    lines = []
    for i in range(len(forms[0])):
        joint = " = " if i == 0 else "   "
        lead = f"  {name if i == 0 else ' ' * len(name)}"
        lines.append(lead + "".join(joint + block[i] for block in blocks))
    if max(map(len, lines)) <= width:
        return "\n".join(lines)
    if len(forms) > 1:
        return text_matrix(name, forms[1:], width)
    return "\n".join(_in_parts(name, forms[0], width))


def _in_parts(name: str, form: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Yield the lines of a matrix in as many of its columns as fit at a time."""
    sizes = [max(map(len, column)) + 2 for column in zip(*form, strict=True)]
    first = 0
    while first < len(sizes):
        last = first + 1
        while last < len(sizes) and sum(sizes[first : last + 1]) + 6 <= width:
            last += 1
        columns = f"column {last}" if last == first + 1 else f"columns {first + 1} to {last}"
        yield f"  {name}, {columns} of {len(sizes)}:"
        yield from (f"    {line}" for line in _block([row[first:last] for row in form]))
        first = last


def _block(form: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*form, strict=True)]
    return [
        "[ " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " ]"
        for row in form
    ]
