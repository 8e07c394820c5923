"""Expressions in sidecars: arithmetic of declared names, parsed exactly and never executed.

Limits on the text's length, the nesting and the size of powers apply before evaluation, so that no
expression blocks a worker.
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from decimal import Decimal

import sympy as sp

from physics_crosscheck.harness.documents.errors import quote
from .sidecar import SidecarError

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

MAX_CHARACTERS = 2000
MAX_NESTING = 100
"""The deepest nesting of operations; a sum of as many terms has this depth."""

MAX_EXPONENT = 64
"""The largest exponent."""

MAX_NUMBER_DIGITS = 400
"""The most digits of a number, and before and after its point: the largest double has 309."""

MAX_POWER_SIZE = 5000
"""The largest size of a power: how often its letters and digits are multiplied, as by (x + 1) **
64.
"""


def parse(text: str, symbols: Mapping[str, sp.Symbol], place: object) -> sp.Expr:
    """Parse an expression of `symbols`, whose names may have dots and colons; decimals are exact.

    It may contain numbers, pi, `+ - * / **`, and sin, cos, tan, asin, acos, atan, atan2, sqrt, exp
    and log. An exponent is a number.

    Raises:
        SidecarError: beginning with `place`, naming the part that can't be parsed or is unknown.
    """
    if text in symbols:  # a joint may be called "left arm", or "a - b"
        return symbols[text]
    plain, by_name = text.strip(), dict(symbols)
    if len(plain) > MAX_CHARACTERS:
        size = f"{len(plain)} characters; at most {MAX_CHARACTERS} are allowed"
        raise SidecarError(f"{place}: {quote(text)} has {size}")
    for index, name in enumerate(sorted(symbols, key=len, reverse=True)):
        # A body may be called "left arm", its coordinate "left arm.x"; a root's is "block:x".
        if ("." in name or ":" in name) and not all(map(str.isidentifier, name.split("."))):
            plain = plain.replace(name, f"dotted_{index}_")
            by_name[f"dotted_{index}_"] = symbols[name]
    try:
        return sp.sympify(
            _ExpressionReader(plain, by_name, place).read(_tree(plain), MAX_NESTING)[0]
        )
    except SidecarError:
        raise
    except Exception as error:
        raise SidecarError(f"{place}: can't read {quote(text)}: {error}") from None


def _tree(text: str) -> ast.expr:
    try:
        return ast.parse(text, mode="eval").body
    except (MemoryError, RecursionError):
        raise ValueError(_TOO_DEEP) from None
    except SyntaxError as error:
        # Python's own message for a number of thousands of digits is about Python.
        long = "integer string conversion" in str(error.msg)
        raise ValueError(_TOO_LONG if long else str(error)) from None


_TOO_DEEP = f"it has more than {MAX_NESTING} nested operations"
_TOO_LONG = f"a number has more than {MAX_NUMBER_DIGITS} digits"
_TOO_LARGE = "its powers are too large to compute"
_NO_VALUE = (
    "is not a finite real number: it is too large, divides by zero or is outside a "
    "function's domain"
)


class _ExpressionReader:
    """A reader of an expression tree, with a limit on the size of its powers."""

    def __init__(self, text: str, symbols: Mapping[str, sp.Symbol], place: object) -> None:
        self._text, self._symbols, self._place = text, symbols, place

    def read(self, node: ast.expr, depth: int) -> tuple[sp.Expr, int]:
        """Return an expression and its size.

        Raises:
            SidecarError, ValueError: for an expression that is not allowed.
        """
        if depth == 0:
            raise ValueError(_TOO_DEEP)
        expression, size = self._read(node, depth - 1)
        if size > MAX_POWER_SIZE:
            raise ValueError(_TOO_LARGE)
        return self._real(expression, node), size

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
                (first, size), (second, more) = self.read(left, depth), self.read(right, depth)
                return _OPERATORS[type(op)](first, second), size + more
            case ast.BinOp(op=ast.BitXor()):
                raise ValueError("write a power as **")
            case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in _FUNCTIONS:
                read = [self.read(first, depth) for first in given]
                return _FUNCTIONS[name](*(first for first, _ in read)), sum(
                    size for _, size in read
                )
        return self._name(node), 1

    def _name(self, node: ast.expr) -> sp.Expr:
        match node:
            case ast.Name() | ast.Attribute() if (name := ast.unparse(node)) in self._symbols:
                return self._symbols[name]
            case ast.Name(id="pi"):
                return sp.pi
            case ast.Name(id=name):
                raise SidecarError(f"{self._place}: {name} is neither a coordinate nor a constant")
        unread = quote(ast.get_source_segment(self._text, node))
        raise ValueError(f"{unread} is not a number, a declared name or arithmetic on these")

    def _power(self, base: tuple[sp.Expr, int], exponent: sp.Expr) -> tuple[sp.Expr, int]:
        """Return a power after checking that it can be computed."""
        if not isinstance(exponent, sp.Rational):
            raise ValueError("an exponent must be a plain number, such as 2")
        if abs(exponent) > MAX_EXPONENT or exponent.q > MAX_EXPONENT:
            raise ValueError(f"an exponent must be at most {MAX_EXPONENT}")
        size = base[1] * max(1, math.ceil(abs(exponent)))
        if size > MAX_POWER_SIZE:
            raise ValueError(_TOO_LARGE)
        return base[0] ** exponent, size

    def _real(self, expression: sp.Expr, node: ast.expr) -> sp.Expr:
        """Return the expression if it has a value; a division by zero has none."""
        broken = expression.has(sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I)
        if broken or not (expression.free_symbols or _is_real(expression)):
            unread = quote(ast.get_source_segment(self._text, node))
            raise ValueError(f"{unread} {_NO_VALUE}")
        return expression


def _is_real(number: sp.Expr) -> bool:
    """Return whether an expression without names is a finite real number."""
    if isinstance(number, sp.Rational) or number is sp.pi:
        return True
    value = sp.N(number, 15, maxn=MAX_NUMBER_DIGITS)
    return bool(value.is_Float) and math.isfinite(float(value))


def _number(text: str) -> tuple[sp.Expr, int]:
    """Return a number from its text, exactly (0.3 is not a double), and its size."""
    plain = text.replace("_", "")
    if not _DECIMAL.fullmatch(plain):
        raise ValueError(f"{quote(text)}: write numbers as decimals")
    decimal = Decimal(plain)
    if len(plain) > MAX_NUMBER_DIGITS or abs(decimal.adjusted()) > MAX_NUMBER_DIGITS:
        raise ValueError(_TOO_LONG)
    if not math.isfinite(float(decimal)):
        raise ValueError(f"{quote(plain)} {_NO_VALUE}")
    return sp.Rational(plain), 1 + len(plain) + abs(decimal.adjusted())
