"""The page of derived equations that `crosscheck derive` prints."""

from __future__ import annotations

import math
import re
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from itertools import chain
from typing import Any, Literal

import jinja2
import sympy as sp

from physics_crosscheck.harness.records import system as records
from physics_crosscheck.harness.records.base import Number
from .console import LOG_COLUMNS, wrapped
from .primes import primed
from .typeset import Latex, Style, Text, latex_name, latex_words


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


@dataclass(frozen=True, kw_only=True)
class Matrix:
    """A matrix of the linear equations.

    Attributes:
        symbolic: entries with symbols; None without symbols, or if too long to read.
        numbers: entries with numeric values.
    """

    name: str
    symbolic: sp.Matrix | None
    numbers: Sequence[Sequence[float]]


@dataclass(frozen=True, kw_only=True)
class DerivedPage:
    """The content of a page of derived equations.

    Attributes:
        name: name of its templates, without their endings.
        symbols: positions, velocities and accelerations.
        coordinates: names of the coordinates.
        values: variables of the templates.
    """

    name: Literal["derive", "bodies"]
    symbols: tuple[tuple[sp.Symbol, ...], ...]
    coordinates: Sequence[str]
    values: Mapping[str, Any]


def describe(
    derived: DerivedPage, style: Literal["text", "latex"] = "text", width: int = LOG_COLUMNS
) -> str:
    """Return everything derived from a system, as a page of text of some width, or of LaTeX."""
    if style == "latex":
        latex = Latex(*derived.symbols)
        environment = jinja2.Environment(**_SETTINGS, **_SIGNS)
        environment.filters |= {
            "symbol": latex_name,
            "words": latex_words,
            "inline": "${}$".format,
            "equation": latex.equation,
            "matrix": latex.matrix,
        }
        environment.globals |= {
            "table": partial(LatexTable, width=width),
            "formulas": partial(LatexFormulas, width),
        }
        return _page(environment, latex, f"{derived.name}.tex", derived)
    environment = jinja2.Environment(**_SETTINGS)
    environment.filters |= {"heading": partial(heading, width=width)}
    environment.globals |= {
        "table": partial(TextTable, width=width),
        "formulas": partial(TextFormulas, width),
        "matrix": partial(text_matrix, width=width),
    }
    lines = _page(environment, Text(*derived.symbols), f"{derived.name}.txt", derived).split("\n")
    # Formulas and tables, which are indented, are laid out already.
    broken = ([line] if line.startswith(" ") else wrapped(line, width) for line in lines)
    return "\n".join(chain.from_iterable(broken))


def _page(
    environment: jinja2.Environment, style: Style, template: str, derived: DerivedPage
) -> str:
    filters: dict[str, Callable[..., Any]] = {
        "math": style.math,
        "number": style.number,
        "sum": style.sum,
        "polar": style.polar,
        "complex": style.complex_number,
        "pole": lambda pole: style.complex_number(complex(pole.real, pole.imaginary), pair=True),
        "forms": partial(_forms, style),
        "hertz": lambda frequency: style.number(frequency / (2 * math.pi)),
        "share": lambda value: style.number(0.0 if abs(value) < 1e-12 else value),
        "primed": partial(primed, coordinates=derived.coordinates),
        "pole_remark": _pole_remark,
        "mode_remark": _mode_remark,
        "percent": lambda value: f"{100 * value:.3g} %",
        "by_amplitude": _by_amplitude,
        "powers": lambda values: ", ".join(map(style.number, values)),
        "limits": lambda limits: list(map(style.number, limits or ())) or ["", ""],
    }
    environment.filters |= filters
    environment.globals |= {"fraction": style.fraction, "rational": style.rational}
    text = environment.get_template(template).render(derived.values)
    # Omitted parts leave blank lines.
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def _forms(style: Style, matrix: Matrix) -> list[list[list[str]]]:
    """Return a matrix with symbols, if it has any, and with numbers: rows of formulas."""
    forms = [[[style.number(value + 0.0) for value in row] for row in matrix.numbers]]
    if matrix.symbolic is not None:
        forms.insert(0, [[style.math(e) for e in row] for row in matrix.symbolic.tolist()])
    return forms


def _pole_remark(pole: records.Pole) -> str:
    if pole.frequency == 0:
        return "rigid body" if pole.multiplicity > 1 else "drifts"
    real = pole.real or 0.0
    if pole.imaginary == 0 and pole.multiplicity > 1 and real < 0:
        return "critically damped"
    return "grows" if real > 0 else ""


def _mode_remark(mode: records.Mode) -> str:
    if mode.rigid:
        return "rigid body"
    return f"grows, {mode.growth:.6g} 1/s" if mode.growth else ""


def _by_amplitude(linearity: Sequence[records.Linearity]) -> list[tuple[Number, ...]]:
    """Return rows of an amplitude and each mode's error at it."""
    return list(zip(linearity[0].amplitudes, *(mode.errors for mode in linearity), strict=True))


def _template(name: str) -> str:
    return resources.files(__package__).joinpath(f"pages/{name}").read_text("utf-8")


_SETTINGS: dict[str, Any] = {
    "loader": jinja2.FunctionLoader(_template),
    "extensions": ["jinja2.ext.do"],
    "trim_blocks": True,
    "lstrip_blocks": True,
    "undefined": jinja2.StrictUndefined,
}

_SIGNS: dict[str, Any] = {  # LaTeX itself is full of braces
    "variable_start_string": "<<",
    "variable_end_string": ">>",
    "block_start_string": "<%",
    "block_end_string": "%>",
    "comment_start_string": "<#",
    "comment_end_string": "#>",
}
