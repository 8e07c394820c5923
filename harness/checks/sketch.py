"""A system's sketch as plain data: shapes whose places are expression trees.

A tree is a number, `["q", i]` for the i-th position, or an operation and its operands: `+`, `*`,
`^`, `sin`, `cos`, `tan`. Drawing it needs neither symbols nor constants.
"""

from __future__ import annotations

from typing import Literal, TypeAlias, cast

import sympy as sp

from physics_crosscheck.harness.records import system as records
from physics_crosscheck.harness.records.base import numbers
from physics_crosscheck.reference.mechanism.sketch import Angle, Body, Link, Shape, expressions
from physics_crosscheck.reference.mechanism.system import System

Kind: TypeAlias = Literal[
    "spring", "damper", "rod", "line", "wall", "measure", "block", "disc", "spiral"
]
"""Kinds of declared shapes, besides an angle."""


def sketch_record(system: System) -> records.Sketch | None:
    """Return the sketch of a system at the start of its first scenario; None if it has no
    sketch.
    """
    if not system.sketch:
        return None
    start = system.scenarios[0].q
    pose = [float(sp.sympify(start[c]).xreplace(system.values)) for c in system.coordinates]
    return records.Sketch(
        pose=numbers(pose), shapes=tuple(_shape(shape, system) for shape in system.sketch)
    )


def _shape(shape: Shape, system: System) -> records.Shape:
    trees = {name: tree(e, system) for name, e in expressions(shape).items()}
    match shape:
        case Link():
            return records.Shape(
                kind=cast(Kind, shape.kind),
                label=shape.label,
                start=[trees["start x"], trees["start y"]],
                end=[trees["end x"], trees["end y"]],
            )
        case Body():
            return records.Shape(
                kind=cast(Kind, shape.kind),
                label=shape.label,
                at=[trees["at x"], trees["at y"]],
                width=trees["width"],
                height=trees["height"],
                angle=trees["angle"],
            )
        case Angle():
            return records.Shape(
                kind="angle",
                label=shape.label,
                at=[trees["at x"], trees["at y"]],
                radius=trees["radius"],
                start=trees["start"],
                end=trees["end"],
            )


def tree(expression: sp.Expr, system: System) -> records.SketchTree:
    """Convert an expression of positions and constants to a tree, with the constants
    substituted.
    """
    places = {q: i for i, q in enumerate(system.q)}

    def walk(e: sp.Expr) -> records.SketchTree:
        if e in places:
            return ["q", places[e]]
        if e.is_number:
            return float(f"{float(e):.9g}")
        names = {sp.Add: "+", sp.Mul: "*", sp.Pow: "^", sp.sin: "sin", sp.cos: "cos", sp.tan: "tan"}
        return [names[e.func], *map(walk, e.args)]

    return walk(sp.sympify(expression).xreplace(system.values))
