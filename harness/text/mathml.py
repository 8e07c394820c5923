"""Mathematics as presentation MathML: what a browser sets as a book would."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter

from reference.system import System

DOTS = ("", "\u02d9", "\u00a8")
"""What stands above a coordinate, its velocity, its acceleration."""

INVISIBLE_TIMES = "\u2062"

Write = Callable[[Any], str]


def writer(system: System) -> Write:
    """A function that writes expressions of a system's symbols, derivatives with dots above.

    It gives one element without its `math` around it: well-formed XML without entities.
    """
    dotted = {c.v: (c.q, 1) for c in system.coordinates}
    dotted |= {c.a: (c.q, 2) for c in system.coordinates}
    printer = _Printer(dotted)

    def write(expression: Any) -> str:
        text = str(printer.doprint(sp.sympify(expression)))
        text = text.replace("&InvisibleTimes;", INVISIBLE_TIMES).replace("<mo>-</mo>", "<mo>−</mo>")
        return f"<mrow>{text}</mrow>"

    return write


def equal(*sides: str) -> str:
    """Written sides with equals signs between them."""
    return f"<mrow>{'<mo>=</mo>'.join(sides)}</mrow>"


def quotient(above: str, below: str) -> str:
    """A fraction of two written terms."""
    return f"<mfrac>{above}{below}</mfrac>"


def matrix(write: Write, rows: Sequence[Sequence[Any]]) -> str:
    """A matrix in brackets."""
    cells = ("".join(f"<mtd>{write(entry)}</mtd>" for entry in row) for row in rows)
    body = "".join(f"<mtr>{row}</mtr>" for row in cells)
    return f"<mrow><mo>[</mo><mtable>{body}</mtable><mo>]</mo></mrow>"


def polynomial(write: Write, expression: sp.Expr, variable: sp.Symbol) -> str:
    """A polynomial in falling powers of a variable, its coefficients factored."""
    parts: list[str] = []
    for (power,), coefficient in sp.Poly(expression, variable).terms():
        factored = sp.factor(coefficient)
        negative = factored.could_extract_minus_sign()
        sign = "-" if negative else "+" if parts else ""
        if sign:
            parts.append(f"<mo>{'−' if negative else '+'}</mo>")
        parts.append(_product(write, -factored if negative else factored, variable**power))
    return f"<mrow>{''.join(parts) or '<mn>0</mn>'}</mrow>"


def rational(write: Write, expression: sp.Expr, variable: sp.Symbol) -> str:
    """A quotient of polynomials, the highest power below with a positive coefficient."""
    above, below = sp.fraction(sp.together(expression))
    if sp.Poly(below, variable).LC().could_extract_minus_sign():
        above, below = -above, -below
    if above == 0:
        return "<mn>0</mn>"
    top, bottom = (polynomial(write, sp.expand(part), variable) for part in (above, below))
    return top if sp.expand(below) == 1 else quotient(top, bottom)


def _product(write: Write, coefficient: sp.Expr, factor: sp.Expr) -> str:
    if factor == 1:
        return write(coefficient)
    if coefficient == 1:
        return write(factor)
    left = write(coefficient)
    if coefficient.is_Add:
        left = f"<mrow><mo>(</mo>{left}<mo>)</mo></mrow>"
    return f"{left}<mo>{INVISIBLE_TIMES}</mo>{write(factor)}"


class _Printer(MathMLPresentationPrinter):  # type: ignore[misc]  # sympy ships no types
    def __init__(self, dotted: Mapping[sp.Symbol, tuple[sp.Symbol, int]]) -> None:
        super().__init__()
        self.dotted = dotted

    def _print_Symbol(self, sym: sp.Symbol, style: str = "plain") -> Any:  # noqa: N802  # its hook
        symbol, dots = self.dotted.get(sym, (sym, 0))
        element = super()._print_Symbol(symbol, style)
        if not dots:
            return element
        # The dot belongs above the letter, not above its index.
        letter = element.firstChild if element.tagName.startswith("msu") else element
        above = self.dom.createElement("mover")
        above.setAttribute("accent", "true")
        if letter is not element:
            element.replaceChild(above, letter)
        above.appendChild(letter)
        sign = self.dom.createElement("mo")
        sign.appendChild(self.dom.createTextNode(DOTS[dots]))
        above.appendChild(sign)
        return above if letter is element else element

    def _print_Float(self, expr: sp.Float) -> Any:  # noqa: N802  # sympy's hook
        return super()._print_Float(sp.Float(float(f"{float(expr):.6g}"), 6))
