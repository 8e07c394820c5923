"""Typeset expressions as text and as LaTeX, with common conventions.

Derivatives of coordinates have primes or dots, sums keep their given order, numbers have six
digits, and polynomials have falling powers.
"""

from __future__ import annotations

import cmath
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import sympy as sp
from sympy.printing.conventions import split_super_sub
from sympy.printing.latex import LatexPrinter, greek_letters_set, tex_greek_dictionary
from sympy.printing.str import StrPrinter

SumTerms: TypeAlias = Sequence[tuple[sp.Expr, sp.Expr]]
"""A sum: coefficient and factor of each term, in order."""


class Style(ABC):
    """Format of a system's expressions.

    Args:
        q, v, a: symbols of its positions, velocities and accelerations.
    """

    times: str
    plus_minus: str
    imaginary: str
    phase: str

    def __init__(
        self, q: Sequence[sp.Symbol], v: Sequence[sp.Symbol], a: Sequence[sp.Symbol]
    ) -> None:
        names: dict[sp.Symbol, str] = {}
        for position, velocity, acceleration in zip(q, v, a, strict=True):
            names[velocity] = self.derivative(position.name, 1)
            names[acceleration] = self.derivative(position.name, 2)
            names[deviation(position)] = self.deviation(position.name)
        self._printer = self._printer_of(names)

    @abstractmethod
    def _printer_of(self, names: Mapping[sp.Symbol, str]) -> _TextPrinter | _LatexPrinter: ...

    @abstractmethod
    def derivative(self, name: str, order: int) -> str:
        """Format a time derivative of a coordinate, of order 0 to 2."""

    @abstractmethod
    def deviation(self, name: str) -> str:
        """Format a coordinate's distance from an equilibrium."""

    @abstractmethod
    def fraction(self, above: str, below: str) -> str:
        """Format a quotient of two sums."""

    def math(self, expression: sp.Expr) -> str:
        """Format an expression for a formula."""
        return str(self._printer.doprint(_six_digits(sp.sympify(expression))))

    def number(self, value: float) -> str:
        """Format a number with six digits."""
        return f"{value:.6g}"

    def bracket(self, formula: str) -> str:
        """Put a formula in parentheses."""
        return f"({formula})"

    def complex_number(self, value: complex, pair: bool = False) -> str:
        """Format a complex number, or a conjugate pair."""
        if value.imag == 0:
            return self.number(value.real)
        imaginary = f"{self.number(value.imag)} {self.imaginary}"
        sign = self.plus_minus if pair else "+"
        if value.real == 0:
            return f"{sign} {imaginary}" if pair else imaginary
        return f"{self.number(value.real)} {sign} {imaginary}"

    def polar(self, value: complex) -> str:
        """Format a complex number by magnitude and phase."""
        size = abs(value)
        if size < 1e-9:  # the phase of zero is undefined
            return "0"
        degrees = round(math.degrees(cmath.phase(value)), 2) + 0.0
        return self.number(size) + self.phase.replace("#", f"{degrees:g}")

    def sum(self, addends: SumTerms) -> str:
        """Format a sum in the given order."""
        text = ""
        for coefficient, factor in addends:
            if _is(coefficient, 0):
                continue
            negative = coefficient.could_extract_minus_sign()
            product = self._product(-coefficient if negative else coefficient, factor)
            if text:
                text += f" {'-' if negative else '+'} {product}"
            else:
                text = f"-{product}" if negative else product
        return text or "0"

    def _product(self, coefficient: sp.Expr, factor: sp.Expr) -> str:
        if _is(coefficient, 1):
            return self.math(factor)
        formula = self.math(coefficient)
        if coefficient.is_Add:
            formula = self.bracket(formula)
        return formula if factor == 1 else f"{formula}{self.times}{self.math(factor)}"

    def polynomial(self, expression: sp.Expr, variable: sp.Symbol) -> str:
        """Format a polynomial in falling powers of a variable, with factored coefficients."""
        monomials = sp.Poly(expression, variable).terms()
        return self.sum([(sp.factor(c), variable**power) for (power,), c in monomials])

    def rational(self, expression: sp.Expr, variable: sp.Symbol) -> str:
        """Format a quotient of polynomials with a positive leading coefficient below."""
        above, below = sp.fraction(sp.together(expression))
        if sp.Poly(below, variable).LC().could_extract_minus_sign():
            above, below = -above, -below
        top, bottom = (self.polynomial(sp.expand(part), variable) for part in (above, below))
        return top if bottom == "1" or top == "0" else self.fraction(top, bottom)


class Text(Style):
    """Plain text."""

    times = "*"
    plus_minus = "±"
    imaginary = "j"
    phase = " at # deg"

    def _printer_of(self, names: Mapping[sp.Symbol, str]) -> _TextPrinter:
        return _TextPrinter(names)

    def math(self, expression: sp.Expr) -> str:
        """Format an expression, with carets for powers."""
        return super().math(expression).replace("**", "^")

    def derivative(self, name: str, order: int) -> str:
        """Format a derivative with primes."""
        return name + "'" * order

    def deviation(self, name: str) -> str:
        """Format a deviation, such as dx."""
        return f"d{name}"

    def fraction(self, above: str, below: str) -> str:
        """Format a quotient in one line."""
        above = f"({above})" if " " in above else above
        below = f"({below})" if any(sign in below for sign in " */") else below
        return f"{above}/{below}" if " " not in above + below else f"{above} / {below}"


class Latex(Style):
    """LaTeX with `amsmath`."""

    times = r" \, "
    plus_minus = r"\pm"
    imaginary = r"\mathrm{j}"
    phase = r" \angle #^\circ"

    def _printer_of(self, names: Mapping[sp.Symbol, str]) -> _LatexPrinter:
        return _LatexPrinter(names)

    def derivative(self, name: str, order: int) -> str:
        """Format a derivative with dots."""
        return latex_name(name, order)

    def deviation(self, name: str) -> str:
        """Format a deviation with a Delta."""
        return rf"\Delta_{{{latex_name(name)}}}"

    def fraction(self, above: str, below: str) -> str:
        """Format a quotient with a bar."""
        return rf"\frac{{{above}}}{{{below}}}"

    def number(self, value: float) -> str:
        """Format a number with a power of ten."""
        return latex_number(value)

    def bracket(self, formula: str) -> str:
        """Put a formula in parentheses that grow with it."""
        return rf"\left({formula}\right)"

    def matrix(self, rows: Sequence[Sequence[str]]) -> str:
        """Format a matrix of formulas in brackets."""
        body = r" \\ ".join(" & ".join(row) for row in rows)
        return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"

    def equation(self, text: str) -> str:
        """Format an equation given as plain text with primes and carets."""

        def word(match: re.Match[str]) -> str:
            name, primes = match.groups()
            return rf"\{name}" if name in _FUNCTIONS else latex_name(name, len(primes))

        text = re.sub(r"\bd([A-Za-z]\w*)?/d(?=[A-Za-z])", r"d \1/d ", text)  # the d of a derivative
        text = re.sub(r"([A-Za-z]\w*)('{0,2})", word, text)
        text = re.sub(r"\^(\d+)", r"^{\1}", text)
        return text.replace("*", " ").replace("±", r"\pm")


def deviation(q: sp.Symbol) -> sp.Symbol:
    """Return the symbol of a coordinate's distance from an equilibrium."""
    return sp.Symbol(f"{q.name}_deviation", real=True)


def latex_name(name: str, dots: int = 0) -> str:
    """Format a symbol's name: a Greek or single letter, or an upright word, with indices.

    Args:
        name: declared name, such as `k_theta`, `m1` or `boom_mass`.
        dots: number of dots above the letter, without its index.
    """
    base, above, below = split_super_sub(name)
    letter = ("{}", r"\dot{{{}}}", r"\ddot{{{}}}")[dots].format(_word(base))
    indices = ",".join(_word(index) for index in (*above, *below))
    return f"{letter}_{{{indices}}}" if indices else letter


def latex_number(value: float) -> str:
    """Format a number with six digits."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa


def latex_words(text: str) -> str:
    """Escape words for LaTeX."""
    for sign, written in _SPECIAL:
        text = text.replace(sign, written)
    return text


_FUNCTIONS = ("sin", "cos", "tan", "exp")

_SPECIAL = (
    ("\\", r"\textbackslash "), ("&", r"\&"), ("%", r"\%"), ("$", r"\$"), ("#", r"\#"),
    ("_", r"\_"), ("{", r"\{"), ("}", r"\}"), ("^", r"\textasciicircum{}"),
    ("~", r"\textasciitilde{}"), ("±", r"$\pm$"),
)  # fmt: skip


def _six_digits(expression: sp.Expr) -> sp.Expr:
    """Replace fractions of many digits, which come from numbers of a file, by decimals."""
    fractions = (f for f in expression.atoms(sp.Rational) if f.q > 1)
    long = {f: sp.Float(f, 15) for f in fractions if max(abs(f.p), f.q) >= 10**6}
    return expression.xreplace(long)


def _is(coefficient: sp.Expr, value: int) -> bool:
    """Return whether a coefficient equals a number; sympy's 1.0 does not equal its 1."""
    return bool(coefficient == value or (coefficient.is_Float and float(coefficient) == value))


def _word(word: str) -> str:
    if len(word) == 1 or word.isdecimal():
        return latex_words(word)
    if word in tex_greek_dictionary:
        return str(tex_greek_dictionary[word])
    if word.lower() in greek_letters_set:
        return rf"\{word}"
    return rf"\text{{{latex_words(word)}}}"


class _TextPrinter(StrPrinter):  # type: ignore[misc]  # sympy ships no types
    def __init__(self, names: Mapping[sp.Symbol, str]) -> None:
        super().__init__()
        self.given = names

    def _print_Symbol(self, expr: sp.Symbol) -> str:  # noqa: N802  # sympy's hook
        return self.given.get(expr, str(expr.name))

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802  # sympy's hook
        return f"{float(expr):.6g}"


class _LatexPrinter(LatexPrinter):  # type: ignore[misc]  # sympy ships no types
    def __init__(self, names: Mapping[sp.Symbol, str]) -> None:
        super().__init__()
        self.given = names

    def _print_Symbol(self, expr: sp.Symbol, style: str = "plain") -> str:  # noqa: N802  # its hook
        return self.given.get(expr) or latex_name(expr.name)

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802  # sympy's hook
        return latex_number(float(expr))
