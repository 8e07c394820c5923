"""Expressions in sidecars: arithmetic of declared names, read exactly and never executed."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping

import sympy as sp

from harness.files.sidecar import SidecarError

_FUNCTIONS: dict[str, Callable[..., sp.Expr]] = {
    name: getattr(sp, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log")
}
_OPERATORS: dict[type, Callable[..., sp.Expr]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow, ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}  # fmt: skip


def parse(text: str, symbols: Mapping[str, sp.Symbol], place: str) -> sp.Expr:
    """Read an expression of `symbols`, whose names may have dots; decimals are taken exactly.

    It may hold numbers, pi, `+ - * / **`, and sin, cos, tan, asin, acos, atan, atan2, sqrt, exp
    and log.

    Raises:
        SidecarError: beginning with `place`, naming what can't be read or is unknown.
    """
    plain, known = text.strip(), dict(symbols)
    for index, name in enumerate(sorted(symbols, key=len, reverse=True)):
        # A body may be called "left arm", its coordinate "left arm.x".
        if "." in name and not all(map(str.isidentifier, name.split("."))):
            plain = plain.replace(name, f"dotted_{index}_")
            known[f"dotted_{index}_"] = symbols[name]
    try:
        return sp.sympify(_read(ast.parse(plain, mode="eval").body, plain, known, place))
    except SidecarError:
        raise
    except Exception as error:
        raise SidecarError(f"{place}: can't read {text!r}: {error}") from None


def _read(node: ast.expr, text: str, symbols: Mapping[str, sp.Symbol], place: str) -> sp.Expr:
    def read(part: ast.expr) -> sp.Expr:
        return _read(part, text, symbols, place)

    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            # From its text: a decimal such as 0.3 is no double.
            return sp.Rational((ast.get_source_segment(text, node) or "").replace("_", ""))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](read(operand))
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](read(left), read(right))
        case ast.BinOp(op=ast.BitXor()):
            raise ValueError("a power is written **")
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](*map(read, arguments))
        case ast.Name() | ast.Attribute() if (name := ast.unparse(node)) in symbols:
            return symbols[name]
        case ast.Name(id="pi"):
            return sp.pi
        case ast.Name(id=name):
            raise SidecarError(f"{place}: {name} is neither a coordinate nor a constant")
    unread = ast.get_source_segment(text, node)
    raise ValueError(f"{unread!r} is neither a number, a declared name nor arithmetic of these")
