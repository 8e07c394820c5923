"""Fast, picklable numeric functions compiled from symbolic expressions."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from .rotations import Array as Array

Rows = NDArray[np.intp]
"""Row indices of an array."""


@dataclass(frozen=True)
class NumericFunction:
    """A vector-valued function of vectors, compiled from generated source.

    Call it with one array per argument group, each of shape (..., group size). It returns an array
    of shape (..., size). It is pickled as source text, so workers do not need sympy.

    Attributes:
        source: source text of the function.
        groups: sizes of the argument groups.
        size: size of the value.
        last: fixed values of the last argument group; see `bind`.
    """

    source: str
    groups: tuple[int, ...]
    size: int
    last: tuple[float, ...] = ()

    def __call__(self, *arguments: Array) -> Array:
        """Evaluate the function; arrays broadcast against each other in all but their last axis."""
        columns: list[Any] = []
        for argument, count in zip(arguments, self.groups, strict=True):
            columns += [argument[..., i] for i in range(count)]
        values = self._function(*columns, *self.last)
        shapes = {a.shape[:-1] for a in arguments}
        shape = shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)
        out = np.empty((*shape, self.size))
        for i, value in enumerate(values):
            out[..., i] = value
        return out

    @cached_property
    def scalar(self) -> Callable[..., Sequence[float]]:
        """The same function of plain numbers, one per column: fastest for a single point."""
        function, last = self._function, self.last
        return (lambda *columns: function(*columns, *last)) if last else function

    def bind(self, values: Sequence[float]) -> NumericFunction:
        """Return the function with its last group fixed, without compiling again."""
        return replace(self, groups=self.groups[:-1], last=tuple(map(float, values)))

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return _executed(self.source)

    def __getstate__(self) -> dict[str, object]:
        return {
            "source": self.source,
            "groups": self.groups,
            "size": self.size,
            "last": self.last,
        }


@lru_cache(maxsize=256)
def _executed(source: str) -> Callable[..., Any]:
    """Execute source that sympy generated from a parsed expression; return its function."""
    namespace: dict[str, Any] = dict(vars(np))
    exec(source, namespace)
    function: Callable[..., Any] = namespace["_lambdifygenerated"]
    return function


def compile_function(
    expressions: Sequence[sp.Expr], *groups: Sequence[sp.Symbol]
) -> NumericFunction:
    """Return a numeric function of the given argument groups.

    Raises:
        ValueError: if an expression contains a symbol that is not an argument.
    """
    return _compiled(tuple(map(sp.sympify, expressions)), tuple(map(tuple, groups)))


@lru_cache(maxsize=512)  # each task of a worker compiles the same maps and terms
def _compiled(
    expressions: tuple[sp.Expr, ...], groups: tuple[tuple[sp.Symbol, ...], ...]
) -> NumericFunction:
    """Compile expressions; equal ones have equal digits, since `sp.Float` compares precisions."""
    arguments = [symbol for group in groups for symbol in group]
    wanted = set[sp.Basic]().union(*(e.free_symbols for e in expressions))
    unknown = wanted - set(arguments)
    if unknown:
        names = ", ".join(sorted(str(symbol) for symbol in unknown))
        raise ValueError(f"{names}: no value given")
    plain = [sp.Symbol(f"x{i}_") for i in range(len(arguments))]
    swap = dict(zip(arguments, plain, strict=True))
    renamed = [e.xreplace(swap) for e in expressions]
    function = sp.lambdify(plain, renamed, modules="numpy", cse=True)
    source = inspect.getsource(function)
    return NumericFunction(source, tuple(len(g) for g in groups), len(expressions))
