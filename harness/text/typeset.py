"""Mathematics as a page: the same headings, tables and formulas as plain text or as LaTeX."""

from __future__ import annotations

import cmath
import math
import re
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Literal

import sympy as sp
from sympy.printing.str import StrPrinter

from reference.system import System

WIDTH = 100
"""Columns of a terminal."""

Row = Sequence[str]


class Style(ABC):
    """How a page is written. Strings that `math` and its kin return go into `inline` or `display`.

    Args:
        names: how to write a symbol, where that is not its name: derivatives, deviations.
    """

    times: str
    plus_minus: str
    imaginary: str
    phase: str
    linear: str
    first_order: str

    def __init__(self, names: Mapping[sp.Symbol, str]) -> None:
        self.names = dict(names)

    @abstractmethod
    def math(self, expression: sp.Expr) -> str:
        """Return an expression as it stands in a formula."""

    @abstractmethod
    def words(self, text: str) -> str:
        """Return words that must come out as they are."""

    @abstractmethod
    def code(self, text: str) -> str:
        """Return an equation that was given as plain text."""

    @abstractmethod
    def inline(self, formula: str) -> str:
        """Return a formula within words or a table."""

    @abstractmethod
    def subscript(self, name: str, index: str) -> str:
        """Return a name with an index."""

    @abstractmethod
    def fraction(self, above: str, below: str) -> str:
        """Return a quotient of two sums."""

    @abstractmethod
    def heading(self, text: str, level: int) -> str:
        """Return a heading; level 1 is the page's title."""

    def table(self, header: Row, rows: Sequence[Row]) -> str:
        """Return a table whose cells are words or inline formulas; an empty column is left out."""
        used = [i for i, name in enumerate(header) if name or any(row[i] for row in rows)]
        return self._table([header[i] for i in used], [[row[i] for i in used] for row in rows])

    @abstractmethod
    def _table(self, header: Row, rows: Sequence[Row]) -> str: ...

    @abstractmethod
    def display(self, formulas: Sequence[tuple[str, str]]) -> str:
        """Return formulas `left = right`, one a line."""

    @abstractmethod
    def matrix(self, name: str, forms: Sequence[Sequence[Row]]) -> str:
        """Return `name = matrix = matrix`; each is rows of formulas."""

    def number(self, value: float) -> str:
        """Return a number with six digits, as a formula."""
        return f"{value:.6g}"

    def complex_number(self, value: complex, pair: bool = False) -> str:
        """Return a complex number, or the pair of it and its conjugate."""
        if value.imag == 0:
            return self.number(value.real)
        imaginary = f"{self.number(value.imag)} {self.imaginary}"
        sign = self.plus_minus if pair else "+"
        if value.real == 0:
            return f"{sign} {imaginary}" if pair else imaginary
        return f"{self.number(value.real)} {sign} {imaginary}"

    def polar(self, value: complex) -> str:
        """Return a complex number by its size and phase."""
        size = abs(value)
        if size < 1e-9:  # a share of nothing has no phase
            return "0"
        degrees = round(math.degrees(cmath.phase(value)), 2) + 0.0
        return self.number(size) + self.phase.replace("#", f"{degrees:g}")

    def sum(self, terms: Sequence[tuple[sp.Expr, sp.Expr]]) -> str:
        """Return a sum of coefficient times factor, in the order given."""
        text = ""
        for coefficient, factor in terms:
            if coefficient == 0:
                continue
            negative = coefficient.could_extract_minus_sign()
            product = self._product(-coefficient if negative else coefficient, factor)
            if text:
                text += f" {'-' if negative else '+'} {product}"
            else:
                text = f"-{product}" if negative else product
        return text or "0"

    def _product(self, coefficient: sp.Expr, factor: sp.Expr) -> str:
        if coefficient == 1:
            return self.math(factor)
        left = self.math(coefficient)
        if coefficient.is_Add:
            left = self.bracket(left)
        return left if factor == 1 else f"{left}{self.times}{self.math(factor)}"

    def bracket(self, formula: str) -> str:
        """Return a formula in parentheses."""
        return f"({formula})"

    def polynomial(self, expression: sp.Expr, variable: sp.Symbol) -> str:
        """Return a polynomial in falling powers of a variable, its coefficients factored."""
        terms = sp.Poly(expression, variable).terms()
        return self.sum([(sp.factor(c), variable**power) for (power,), c in terms])


class _Printer(StrPrinter):  # type: ignore[misc]  # sympy ships no types
    def __init__(self, names: Mapping[sp.Symbol, str]) -> None:
        super().__init__()
        self.given = names

    def _print_Symbol(self, expr: sp.Symbol) -> str:  # noqa: N802  # sympy's hook
        return self.given.get(expr, str(expr.name))

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802  # sympy's hook
        return f"{float(expr):.6g}"


class _Text(Style):
    """Plain text for a terminal, 100 columns wide."""

    times = "*"
    plus_minus = "±"
    imaginary = "j"
    phase = " at # deg"
    linear = "M q'' + C q' + K q = Q"
    first_order = "y' = A y + B u"

    def math(self, expression: sp.Expr) -> str:
        return str(_Printer(self.names).doprint(expression)).replace("**", "^")

    def words(self, text: str) -> str:
        return text

    def code(self, text: str) -> str:
        return text

    def inline(self, formula: str) -> str:
        return formula

    def subscript(self, name: str, index: str) -> str:
        return f"{name}_{index}"

    def fraction(self, above: str, below: str) -> str:
        if below == "1":
            return above
        above = f"({above})" if " " in above else above
        below = f"({below})" if any(sign in below for sign in " */") else below
        return f"{above}/{below}" if " " not in above + below else f"{above} / {below}"

    def heading(self, text: str, level: int) -> str:
        return f"{text}\n{'=-'[level - 1] * len(text)}" if level < 3 else text

    def _table(self, header: Row, rows: Sequence[Row]) -> str:
        cells = [list(header), *(list(row) for row in rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(header))]
        while sum(widths) + 2 * len(widths) > WIDTH:
            widths[widths.index(max(widths))] -= 1
        lines = []
        for row in cells:
            # Whatever is too wide for its column goes on below.
            parts = [textwrap.wrap(c, w) or [""] for c, w in zip(row, widths, strict=True)]
            for i in range(max(map(len, parts))):
                line = "  ".join(
                    (part[i] if i < len(part) else "").ljust(width)
                    for part, width in zip(parts, widths, strict=True)
                )
                lines.append(f"  {line}".rstrip())
        lines.insert(1, "  " + "  ".join("-" * width for width in widths))
        return "\n".join(lines)

    def display(self, formulas: Sequence[tuple[str, str]]) -> str:
        lines = []
        for left, right in formulas:
            lines += textwrap.wrap(
                f"{left} = {right}" if right else left,
                WIDTH,
                initial_indent="  ",
                subsequent_indent="      ",
                break_long_words=False,
                break_on_hyphens=False,
            )
        return "\n".join(lines)

    def matrix(self, name: str, forms: Sequence[Sequence[Row]]) -> str:
        height = len(forms[0])
        blocks = []
        for form in forms:
            widths = [max(len(row[i]) for row in form) for i in range(len(form[0]))]
            blocks.append(
                [
                    "[ " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " ]"
                    for row in form
                ]
            )
        lines = []
        for i in range(height):
            joint = " = " if i == 0 else "   "
            lead = f"  {name if i == 0 else ' ' * len(name)}"
            lines.append(lead + "".join(joint + block[i] for block in blocks))
        if max(map(len, lines)) > WIDTH and len(forms) > 1:
            return self.matrix(name, forms[1:])  # the numbers alone
        return "\n".join(lines)


class _Latex(Style):
    """LaTeX for the body of a document with `amsmath`."""

    times = r" \, "
    plus_minus = r"\pm"
    imaginary = r"\mathrm{j}"
    phase = r" \angle #^\circ"
    linear = r"M \ddot{q} + C \dot{q} + K q = Q"
    first_order = r"\dot{y} = A y + B u"

    def math(self, expression: sp.Expr) -> str:
        floats = {f: sp.Float(f, 6) for f in sp.sympify(expression).atoms(sp.Float)}
        return str(sp.latex(expression.xreplace(floats), symbol_names=self.names))

    def words(self, text: str) -> str:
        for sign, written in (
            ("\\", r"\textbackslash "),
            ("&", r"\&"),
            ("%", r"\%"),
            ("$", r"\$"),
            ("#", r"\#"),
            ("_", r"\_"),
            ("{", r"\{"),
            ("}", r"\}"),
            ("^", r"\textasciicircum{}"),
            ("~", r"\textasciitilde{}"),
            ("±", r"$\pm$"),
        ):
            text = text.replace(sign, written)
        return text

    def code(self, text: str) -> str:
        def word(match: re.Match[str]) -> str:
            name, primes = match.groups()
            if name in ("sin", "cos", "tan", "exp"):
                return rf"\{name}"
            accent = ("{}", r"\dot{{{}}}", r"\ddot{{{}}}")[len(primes)]
            return accent.format(sp.latex(sp.Symbol(name)))

        # The d of dL/dx' is none of a name's letters.
        text = re.sub(r"\bd([A-Z]\w*)/d(\w+)", r"d~\1/d~\2", text)
        text = re.sub(r"([A-Za-z]\w*)('{0,2})", word, text).replace("~", "")
        text = re.sub(r"\^(\d+)", r"^{\1}", text)
        return self.inline(text.replace("*", " ").replace("±", r"\pm"))

    def inline(self, formula: str) -> str:
        return f"${formula}$"

    def number(self, value: float) -> str:
        mantissa, _, exponent = f"{value:.6g}".partition("e")
        return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa

    def bracket(self, formula: str) -> str:
        return rf"\left({formula}\right)"

    def subscript(self, name: str, index: str) -> str:
        return f"{name}_{{{index}}}"

    def fraction(self, above: str, below: str) -> str:
        return rf"\frac{{{above}}}{{{below}}}"

    def heading(self, text: str, level: int) -> str:
        command = ("section", "subsection", "subsubsection")[level - 1]
        return rf"\{command}*{{{self.words(text)}}}"

    def _table(self, header: Row, rows: Sequence[Row]) -> str:
        # A column of long words is a paragraph, the others are as wide as they need.
        share = 0.7 if len(header) < 3 else 0.45
        columns = "".join(
            rf"p{{{share}\linewidth}}" if max(len(row[i]) for row in (header, *rows)) > 40 else "l"
            for i in range(len(header))
        )
        lines = [" & ".join(header) + r" \\ \hline"]
        lines += [" & ".join(row) + r" \\" for row in rows]
        body = "\n".join(lines)
        return f"\\noindent\\begin{{tabular}}{{{columns}}}\n{body}\n\\end{{tabular}}"

    def display(self, formulas: Sequence[tuple[str, str]]) -> str:
        lines = [f"{left} &= {right}" if right else f"&{left}" for left, right in formulas]
        return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}"

    def matrix(self, name: str, forms: Sequence[Sequence[Row]]) -> str:
        written = [
            r"\begin{bmatrix} " + r" \\ ".join(" & ".join(row) for row in form) + r" \end{bmatrix}"
            for form in forms
        ]
        return "\\[\n" + " = ".join([name, *written]) + "\n\\]"


def style_of(system: System, style: Literal["text", "latex"]) -> Style:
    """Return a style that writes the derivatives of a system's coordinates as such."""
    names: dict[sp.Symbol, str] = {}
    for c in system.coordinates:
        if style == "latex":
            plain = sp.latex(c.q)
            names |= {c.v: rf"\dot{{{plain}}}", c.a: rf"\ddot{{{plain}}}"}
            names[deviation(c.q)] = rf"\Delta_{{{plain}}}"
        else:
            names |= {c.v: f"{c.name}'", c.a: f"{c.name}''", deviation(c.q): f"d{c.name}"}
    return _Latex(names) if style == "latex" else _Text(names)


def deviation(q: sp.Symbol) -> sp.Symbol:
    """Return the symbol of a coordinate's distance from an equilibrium."""
    return sp.Symbol(f"{q.name}_deviation", real=True)
