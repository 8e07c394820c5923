"""Equations of motion of a small tree as polynomials of sines, cosines and velocities.

They come from the same recursion as the numeric equations, over polynomials with sin^2 replaced by
1 - cos^2. Their size is thus known before they are printed, without open-ended simplification.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from sympy.polys.domains import RR
from sympy.polys.rings import PolyRing

from physics_crosscheck.reference.mechanism.rotations import Scalars, objects
from physics_crosscheck.reference.mechanism.tree import Tree
from .tree_dynamics import Dynamics

MAX_JOINTS = 3
"""With more joints the formulas are too long to read."""

MAX_TERMS = 80
"""Largest number of products in M and f: about a page."""

ZERO_COEFFICIENT = 1e-9
"""Relative to an equation's largest coefficient: smaller ones come from rounded angles."""


@dataclass(frozen=True, kw_only=True)
class SymbolicEquations:
    """M(q) a = f(q, v) of n coordinates.

    Attributes:
        mass: rows of M.
        force: terms of each row of f.
    """

    mass: tuple[tuple[sp.Expr, ...], ...]
    force: tuple[tuple[sp.Expr, ...], ...]


def formulas(
    tree: Tree, q: tuple[sp.Symbol, ...], v: tuple[sp.Symbol, ...]
) -> SymbolicEquations | str:
    """Return the equations without joint forces, or the reason why they can't be printed.

    Args:
        tree: the bodies.
        q, v: symbols of its positions and velocities.
    """
    if len(tree.links) > MAX_JOINTS:
        return f"they are too long for {len(tree.links)} joints"
    other = next((one for one in tree.links if one.kind not in ("hinge", "slide")), None)
    if other is not None:
        return f"joint {other.name!r} is a {other.kind} joint"
    if tree.pulls or tree.couplings or tree.fluid:
        return "they are not written for tendons, actuators, joint couplings and fluids"
    return _written(tree, q, v)


def _written(
    tree: Tree, q: tuple[sp.Symbol, ...], v: tuple[sp.Symbol, ...]
) -> SymbolicEquations | str:
    n = tree.nv
    names = [f"{letter}{i}" for letter in "scqv" for i in range(n)]
    ring = PolyRing(names, RR, "lex")
    sines, cosines, positions, velocities = (ring.gens[k * n : (k + 1) * n] for k in range(4))
    index = {gen: i for i, gen in enumerate(positions)}
    field = objects(lambda x: sines[index[x]], lambda x: cosines[index[x]], ring.ground_new)
    dynamics = Dynamics(tree, field)
    coordinates, rates = _array(positions), _array(velocities)
    circles = [s**2 + c**2 - 1 for s, c in zip(sines, cosines, strict=True)]
    mass = dynamics.mass(coordinates)
    force = dynamics.force(coordinates, rates, 0 * rates)
    rows = [[_short(x, circles) for x in (*mass[i, :, 0], force[i, 0])] for i in range(n)]
    rows = [_without_nothing(row) for row in rows]
    count = sum(len(x) for row in rows for x in row)
    if count > MAX_TERMS:
        return f"they have {count} terms; more than {MAX_TERMS} are too long"
    symbols = [*map(sp.sin, q), *map(sp.cos, q), *q, *v]
    written = [[_products(x, symbols) for x in row] for row in rows]
    return SymbolicEquations(
        mass=tuple(tuple(sp.Add(*x) for x in row[:-1]) for row in written),
        force=tuple(row[-1] for row in written),
    )


def _array(values: Any) -> Scalars:
    """Return a batch of one, (n, 1)."""
    result = np.empty((len(values), 1), dtype=object)
    result[:, 0] = values
    return result


def _short(polynomial: Any, circles: list[Any]) -> Any:
    """Substitute sin^2 + cos^2 = 1."""
    return polynomial.rem(circles)


def _without_nothing(row: list[Any]) -> list[Any]:
    """Return a row of M and f without coefficients that are rounded zeros."""
    largest = max((abs(c) for one in row for c in one.values()), default=0)
    return [
        type(one)(one.ring, {m: c for m, c in one.items() if abs(c) > ZERO_COEFFICIENT * largest})
        for one in row
    ]


def _products(polynomial: Any, symbols: list[sp.Expr]) -> tuple[sp.Expr, ...]:
    return tuple(
        sp.Mul(sp.Float(float(c), 15), *(x**k for x, k in zip(symbols, powers, strict=True)))
        for powers, c in polynomial.terms()
    )
