"""Equations in a source's notation: primes and carets instead of sympy's names."""

from __future__ import annotations

from collections.abc import Iterable


def primed(text: str, coordinates: Iterable[str]) -> str:
    """Rewrite sympy's output with x' for x_dot and ^ for **.

    Args:
        text: output of sympy.
        coordinates: names of the coordinates.
    """
    for name in sorted(coordinates, key=len, reverse=True):
        text = text.replace(f"{name}_ddot", f"{name}''").replace(f"{name}_dot", f"{name}'")
    return text.replace("**", "^")
