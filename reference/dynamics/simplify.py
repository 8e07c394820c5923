"""Bounded simplification: sympy's own for short expressions, none for long ones."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

LONG_OPERATIONS = 80
"""Operations above which `simplify` takes seconds per expression, and minutes for an arm."""


def simplify_bounded(expression: sp.Expr) -> sp.Expr:
    """Return an equal expression: simplified if short, unchanged if long.

    A long expression is not expanded either: an arm's nested kinematics are shorter. Expressions
    with floats, such as a position found by a search, count as long earlier, since factoring floats
    may not end.
    """
    has_floats = expression.has(sp.Float)
    if sp.count_ops(expression) > LONG_OPERATIONS // (4 if has_floats else 1):
        return expression
    return sp.simplify(expression) if has_floats else _simplify_exact(expression)


@lru_cache(maxsize=1024)
def _simplify_exact(expression: sp.Expr) -> sp.Expr:
    """Simplify an expression without floats once: modes and scenarios of a system share terms."""
    return sp.simplify(expression)


def solved(matrix: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """Return matrix^-1 right for a symmetric n x n matrix and an n x 1 column, by minors.

    sympy's own `det` expands intermediate results, which takes minutes for an arm and rounds worse.
    """
    n = matrix.rows
    minors: dict[tuple[tuple[int, ...], tuple[int, ...]], sp.Expr] = {((), ()): sp.Integer(1)}

    def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> sp.Expr:
        if (rows, columns) not in minors:
            minors[rows, columns] = sp.Add(
                *(
                    (-1) ** k
                    * matrix[rows[0], column]
                    * minor(rows[1:], columns[:k] + columns[k + 1 :])
                    for k, column in enumerate(columns)
                    if matrix[rows[0], column] != 0
                )
            )
        return minors[rows, columns]

    every = tuple(range(n))

    def without(i: int) -> tuple[int, ...]:
        return every[:i] + every[i + 1 :]

    determinant = minor(every, every)
    return sp.Matrix(
        [
            sp.Add(*((-1) ** (i + j) * minor(without(j), without(i)) * right[j] for j in every))
            / determinant
            for i in every
        ]
    )
