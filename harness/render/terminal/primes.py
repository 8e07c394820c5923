"""Equations as a source writes them: primes and carets for the names that sympy has."""

from __future__ import annotations

from collections.abc import Iterable


def primed(text: str, coordinates: Iterable[str]) -> str:
    """What sympy prints of a system's equations, with x' for x_dot and ^ for **.

    Args:
        text: as sympy prints it.
        coordinates: their names.
    """
    for name in sorted(coordinates, key=len, reverse=True):
        text = text.replace(f"{name}_ddot", f"{name}''").replace(f"{name}_dot", f"{name}'")
    return text.replace("**", "^")
