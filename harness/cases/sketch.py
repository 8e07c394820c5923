"""A system's sketch as plain data: shapes whose places are small trees of numbers and positions.

A tree is a number, `["q", i]` for the i-th position, or an operation and its operands: `+`, `*`,
`^`, `sin`, `cos`, `tan`. Whoever draws it needs to know neither symbols nor constants.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from reference.sketch import Angle, Link, Shape, expressions
from reference.system import System

Tree = float | list[Any]


def sketch_record(system: System) -> dict[str, Any] | None:
    """The sketch of a system in results.json, posed as its first scenario starts; None without."""
    if not system.sketch:
        return None
    start = system.scenarios[0].q
    pose = [float(sp.sympify(start[c]).xreplace(system.values)) for c in system.coordinates]
    return {"pose": pose, "shapes": [_shape(shape, system) for shape in system.sketch]}


def _shape(shape: Shape, system: System) -> dict[str, Any]:
    kind = "angle" if isinstance(shape, Angle) else shape.kind
    found = {name: tree(e, system) for name, e in expressions(shape).items()}
    record: dict[str, Any] = {"kind": kind, "label": shape.label}
    if isinstance(shape, Link):
        record["start"] = [found["start x"], found["start y"]]
        record["end"] = [found["end x"], found["end y"]]
        return record
    record["at"] = [found.pop("at x"), found.pop("at y")]
    return record | found


def tree(expression: sp.Expr, system: System) -> Tree:
    """An expression of positions and constants as a tree, the constants put in."""
    places = {q: i for i, q in enumerate(system.q)}

    def walk(e: sp.Expr) -> Tree:
        if e in places:
            return ["q", places[e]]
        if e.is_number:
            return float(f"{float(e):.9g}")
        names = {sp.Add: "+", sp.Mul: "*", sp.Pow: "^", sp.sin: "sin", sp.cos: "cos", sp.tan: "tan"}
        return [names[e.func], *map(walk, e.args)]

    return walk(sp.sympify(expression).xreplace(system.values))
