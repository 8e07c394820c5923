"""Expressions in sidecars: arithmetic of declared names, read exactly and never executed.

What is to be computed is bounded before it is: by the length of the text, by how deep it nests, and
by how large its powers grow. So no expression keeps a worker busy.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from decimal import Decimal

import sympy as sp

from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError

_FUNCTIONS: dict[str, Callable[..., sp.Expr]] = {
    name: getattr(sp, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log")
}
_OPERATORS: dict[type, Callable[..., sp.Expr]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow, ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}  # fmt: skip

_DECIMAL = re.compile(r"[0-9]+\.?[0-9]*(?:[eE][+-]?[0-9]+)?|\.[0-9]+(?:[eE][+-]?[0-9]+)?")

MOST_CHARACTERS = 2000
MOST_DEPTH = 100
"""Operations within operations; a sum of so many terms is as deep."""

MOST_POWER = 64
"""Of an exponent."""

MOST_DIGITS = 400
"""Of a number, and before and after its point: the largest double has 309."""

MOST_SIZE = 5000
"""Of a power: how often its letters and digits are multiplied, as by (x + 1) ** 64."""


def parse(text: str, symbols: Mapping[str, sp.Symbol], place: object) -> sp.Expr:
    """Read an expression of `symbols`, whose names may have dots; decimals are taken exactly.

    It may hold numbers, pi, `+ - * / **`, and sin, cos, tan, asin, acos, atan, atan2, sqrt, exp
    and log. An exponent is a number.

    Raises:
        SidecarError: beginning with `place`, naming what can't be read or is unknown.
    """
    if text in symbols:  # a joint may be called "left arm", or "a - b"
        return symbols[text]
    plain, known = text.strip(), dict(symbols)
    if len(plain) > MOST_CHARACTERS:
        said = f"{len(plain)} characters; at most {MOST_CHARACTERS} are allowed"
        raise SidecarError(f"{place}: {brief(text)} has {said}")
    for index, name in enumerate(sorted(symbols, key=len, reverse=True)):
        # A body may be called "left arm", its coordinate "left arm.x".
        if "." in name and not all(map(str.isidentifier, name.split("."))):
            plain = plain.replace(name, f"dotted_{index}_")
            known[f"dotted_{index}_"] = symbols[name]
    try:
        return sp.sympify(_Reader(plain, known, place).read(_tree(plain), MOST_DEPTH)[0])
    except SidecarError:
        raise
    except Exception as error:
        raise SidecarError(f"{place}: can't read {brief(text)}: {error}") from None


def _tree(text: str) -> ast.expr:
    try:
        return ast.parse(text, mode="eval").body
    except (MemoryError, RecursionError):
        raise ValueError(_TOO_DEEP) from None
    except SyntaxError as error:
        # Python's own words for a number of thousands of digits are about Python.
        long = "integer string conversion" in str(error.msg)
        raise ValueError(_TOO_LONG if long else str(error)) from None


_TOO_DEEP = f"it has more than {MOST_DEPTH} nested operations"
_TOO_LONG = f"a number has more than {MOST_DIGITS} digits"
_TOO_LARGE = "its powers are too large to compute"
_NO_VALUE = (
    "is not a finite real number: it is too large, divides by zero or is outside a "
    "function's domain"
)


class _Reader:
    """Reads a tree to an expression, with a bound on how large its powers may be."""

    def __init__(self, text: str, symbols: Mapping[str, sp.Symbol], place: object) -> None:
        self._text, self._symbols, self._place = text, symbols, place

    def read(self, node: ast.expr, depth: int) -> tuple[sp.Expr, int]:
        """An expression and its size.

        Raises:
            SidecarError, ValueError: for what can't be read.
        """
        if depth == 0:
            raise ValueError(_TOO_DEEP)
        found, size = self._read(node, depth - 1)
        if size > MOST_SIZE:
            raise ValueError(_TOO_LARGE)
        return self._real(found, node), size

    def _read(self, node: ast.expr, depth: int) -> tuple[sp.Expr, int]:
        match node:
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                return _number(ast.get_source_segment(self._text, node) or "")
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                inner, size = self.read(operand, depth)
                return _OPERATORS[type(op)](inner), size
            case ast.BinOp(op=ast.Pow(), left=left, right=right):
                return self._power(self.read(left, depth), self.read(right, depth)[0])
            case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
                (one, size), (other, more) = self.read(left, depth), self.read(right, depth)
                return _OPERATORS[type(op)](one, other), size + more
            case ast.BinOp(op=ast.BitXor()):
                raise ValueError("write a power as **")
            case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in _FUNCTIONS:
                read = [self.read(one, depth) for one in given]
                return _FUNCTIONS[name](*(one for one, _ in read)), sum(size for _, size in read)
        return self._name(node), 1

    def _name(self, node: ast.expr) -> sp.Expr:
        match node:
            case ast.Name() | ast.Attribute() if (name := ast.unparse(node)) in self._symbols:
                return self._symbols[name]
            case ast.Name(id="pi"):
                return sp.pi
            case ast.Name(id=name):
                raise SidecarError(f"{self._place}: {name} is neither a coordinate nor a constant")
        unread = brief(ast.get_source_segment(self._text, node))
        raise ValueError(f"{unread} is not a number, a declared name or arithmetic on these")

    def _power(self, base: tuple[sp.Expr, int], exponent: sp.Expr) -> tuple[sp.Expr, int]:
        """A power, once it is known that it can be computed."""
        if not isinstance(exponent, sp.Rational):
            raise ValueError("an exponent must be a plain number, such as 2")
        if abs(exponent) > MOST_POWER or exponent.q > MOST_POWER:
            raise ValueError(f"an exponent must be at most {MOST_POWER}")
        size = base[1] * max(1, math.ceil(abs(exponent)))
        if size > MOST_SIZE:
            raise ValueError(_TOO_LARGE)
        return base[0] ** exponent, size

    def _real(self, found: sp.Expr, node: ast.expr) -> sp.Expr:
        """The expression, if it has a value: what is divided by zero has none anywhere."""
        broken = found.has(sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I)
        if broken or not (found.free_symbols or _is_real(found)):
            unread = brief(ast.get_source_segment(self._text, node))
            raise ValueError(f"{unread} {_NO_VALUE}")
        return found


def _is_real(number: sp.Expr) -> bool:
    """Whether an expression without names is a finite real number."""
    if isinstance(number, sp.Rational) or number is sp.pi:
        return True
    value = sp.N(number, 15, maxn=MOST_DIGITS)
    return bool(value.is_Float) and math.isfinite(float(value))


def _number(text: str) -> tuple[sp.Expr, int]:
    """A number from its text, and its size: a decimal such as 0.3 is no double."""
    plain = text.replace("_", "")
    if not _DECIMAL.fullmatch(plain):
        raise ValueError(f"{brief(text)}: write numbers as decimals")
    decimal = Decimal(plain)
    if len(plain) > MOST_DIGITS or abs(decimal.adjusted()) > MOST_DIGITS:
        raise ValueError(_TOO_LONG)
    if not math.isfinite(float(decimal)):
        raise ValueError(f"{brief(plain)} {_NO_VALUE}")
    return sp.Rational(plain), 1 + len(plain) + abs(decimal.adjusted())
