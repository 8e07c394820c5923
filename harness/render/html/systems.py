"""The view of one system: equations, constants, errata, scenarios, files.

A sketch from results as SVG: shapes in their own coordinates, each placed by a matrix.

The page only changes matrices, so shapes such as springs are defined only here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.model import EngineLinearization, EnginePole, Model
from physics_crosscheck.harness.records.system import (
    Linearization,
    Shape,
    Sketch,
    SketchTree,
    SystemResult,
    TransferFunction,
)
from ..terminal.primes import primed
from .maths import mathml
from .text import NOTHING, complex_number, quantity, sci

ANNOTATIONS = ("measure", "angle")
"""Shapes that explain the sketch and do not move with it."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A sketch with y down, as in SVG.

    Attributes:
        box: the view box.
        size: font size.
        shapes: number, kind, path along (0, 0) to (1, 0) or about (0, 0), and matrix.
        labels: x, y, letter and subscript.
        description: description in words.
    """

    box: str
    size: str
    shapes: tuple[tuple[int, str, str, str], ...]
    labels: tuple[tuple[str, str, str, str], ...]
    description: str


_NAMES = """alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma
tau phi chi psi omega"""
GREEK = dict(zip(_NAMES.split(), "αβγδεζηθικλμνξπρστφχψω", strict=True))


def evaluate(tree: SketchTree | None, q: Sequence[float]) -> float:
    """Evaluate a tree at positions q.

    Raises:
        ValueError: for a missing tree or an unknown operation.
    """
    if tree is None:
        raise ValueError("a shape lacks a place or a size")
    if isinstance(tree, (int, float)):
        return float(tree)
    name, *operands = tree
    if name == "q":
        return float(q[operands[0]])
    values = [evaluate(operand, q) for operand in operands]
    match name:
        case "+":
            return math.fsum(values)
        case "*":
            return math.prod(values)
        case "^":
            return float(values[0] ** values[1])
        case "sin" | "cos" | "tan":
            return float(getattr(math, name)(values[0]))
    raise ValueError(f"unknown operation {name!r}")


def drawing(sketch: Sketch, coordinates: Sequence[str]) -> Drawing:
    """Draw a sketch in its pose."""
    pose = _pose(sketch)
    points = [p for shape in sketch.shapes for p in _extent(shape, pose)]
    low_x, right = min(x for x, _ in points), max(x for x, _ in points)
    low, high = min(y for _, y in points), max(y for _, y in points)
    size = max(right - low_x, high - low) or 1.0
    margin = 0.09 * size
    box = (low_x - margin, -high - margin, right - low_x + 2 * margin, high - low + 2 * margin)
    kinds = ", ".join(
        f"{shape.kind} {shape.label}".strip()
        for shape in sketch.shapes
        if shape.kind not in (*ANNOTATIONS, "line")
    )
    where = ", ".join(f"{n} = {v:.3g}" for n, v in zip(coordinates, pose, strict=True))
    return Drawing(
        box=" ".join(_n(v) for v in box),
        size=_n(0.062 * size),
        shapes=tuple(
            (number, shape.kind, _path(shape, pose, size), _matrix(shape, pose))
            for number, shape in enumerate(sketch.shapes)
        ),
        labels=tuple(_label(shape, pose, size) for shape in sketch.shapes if shape.label),
        description=f"Sketch of the mechanism at {where}: {kinds}.",
    )


def _pose(sketch: Sketch) -> list[float]:
    return [0.0 if value is None else value for value in sketch.pose]


def _coordinates(point: SketchTree | None, q: Sequence[float]) -> tuple[float, float]:
    if not isinstance(point, list) or len(point) != 2:
        raise ValueError(f"{point!r} is not a point")
    return evaluate(point[0], q), evaluate(point[1], q)


def _extent(shape: Shape, q: Sequence[float]) -> list[tuple[float, float]]:
    if shape.center is None:
        return [_coordinates(shape.start, q), _coordinates(shape.end, q)]
    x, y = _coordinates(shape.center, q)
    if shape.kind == "angle":
        r = evaluate(shape.radius, q)
        return [(x, y), *((x + r * math.cos(a), y + r * math.sin(a)) for a in _arc(shape, q))]
    w, h = evaluate(shape.width, q) / 2, evaluate(shape.height, q) / 2
    return [(x - w, y - h), (x + w, y + h)]


def _arc(shape: Shape, q: Sequence[float]) -> tuple[float, float, float]:
    start, end = evaluate(shape.start, q), evaluate(shape.end, q)
    return start, (start + end) / 2, end


def _matrix(shape: Shape, q: Sequence[float]) -> str:
    """Return the matrix of a shape from its places, as in script/motion.js."""
    if shape.kind == "angle":
        x, y = _coordinates(shape.center, q)
        values = (1.0, 0.0, 0.0, 1.0, x, y)
    elif shape.center is not None:
        x, y = _coordinates(shape.center, q)
        w, h, a = (evaluate(tree, q) for tree in (shape.width, shape.height, shape.angle))
        values = (w * math.cos(a), w * math.sin(a), -h * math.sin(a), h * math.cos(a), x, y)
    else:
        (x, y), (x2, y2) = _coordinates(shape.start, q), _coordinates(shape.end, q)
        length = math.hypot(x2 - x, y2 - y) or 1.0
        dx, dy = x2 - x, y2 - y
        values = (dx, dy, -dy / length, dx / length, x, y)
    return " ".join(_n(v) for v in values)


def _path(shape: Shape, q: Sequence[float], size: float) -> str:
    w = 0.028 * size
    match shape.kind:
        case "spring":
            turns = "".join(
                f"L{_n(0.14 + 0.72 * (i + 0.5) / 10)},{_n(w if i % 2 else -w)}" for i in range(10)
            )
            return f"M0,0L.14,0{turns}L.86,0L1,0"
        case "damper":
            v = 1.5 * w
            cup = f"M.36,{_n(-v)}L.64,{_n(-v)}L.64,{_n(v)}L.36,{_n(v)}"
            return f"M0,0L.48,0M.48,{_n(-w)}L.48,{_n(w)}{cup}M.64,0L1,0"
        case "wall":
            marks = "".join(f"M{_n((i + 0.5) / 12)},0l-.03,{_n(-0.8 * w)}" for i in range(12))
            return f"M0,0L1,0{marks}"
        case "measure":
            length = math.dist(_coordinates(shape.start, q), _coordinates(shape.end, q)) or 1.0
            tip = _n(1 - w / length)
            return f"M0,0L1,0M{tip},{_n(0.5 * w)}L1,0L{tip},{_n(-0.5 * w)}"
        case "block":
            return "M-.5,-.5H.5V.5H-.5Z"
        case "disc":
            return "M.5,0A.5,.5 0 1 1 -.5,0A.5,.5 0 1 1 .5,0M0,0L.5,0"
        case "spiral":
            steps = [(0.5 * i / 48, 5 * math.pi * i / 48) for i in range(49)]
            return "M" + "L".join(f"{_n(r * math.cos(a))},{_n(r * math.sin(a))}" for r, a in steps)
        case "angle":
            return _arc_path(shape, q, w)
    return "M0,0L1,0"


def _arc_path(shape: Shape, q: Sequence[float], w: float) -> str:
    r = evaluate(shape.radius, q)
    start, _, end = _arc(shape, q)
    tip = end - math.copysign(min(w / r, abs(end - start)) if r else 0.0, end - start)
    steps = [start + (end - start) * i / 24 for i in range(25)]
    arc = "M" + "L".join(f"{_n(r * math.cos(a))},{_n(r * math.sin(a))}" for a in steps)
    ends = [(r + s * 0.5 * w) for s in (1, -1)]
    x, y = r * math.cos(end), r * math.sin(end)
    head = "".join(
        f"M{_n(e * math.cos(tip))},{_n(e * math.sin(tip))}L{_n(x)},{_n(y)}" for e in ends
    )
    return arc + head


def _label(shape: Shape, q: Sequence[float], size: float) -> tuple[str, str, str, str]:
    if shape.kind == "angle":
        x, y = _coordinates(shape.center, q)
        r = 1.18 * evaluate(shape.radius, q)
        middle = _arc(shape, q)[1]
        x, y = x + r * math.cos(middle), y + r * math.sin(middle)
    elif shape.center is not None:
        x, y = _coordinates(shape.center, q)
        if shape.kind == "disc":
            # Below the centre, off the mark on the radius; next to a disc that is too small.
            h = evaluate(shape.height, q)
            x, y = (x, y - 0.22 * h) if h > 0.2 * size else (x + 0.5 * h + 0.05 * size, y)
        elif shape.kind == "spiral":
            x, y = x - 0.6 * evaluate(shape.width, q), y + 0.6 * evaluate(shape.height, q)
    else:
        (x, y), (x2, y2) = _coordinates(shape.start, q), _coordinates(shape.end, q)
        length = math.hypot(x2 - x, y2 - y) or 1.0
        off = (0.045 if shape.kind == "measure" else 0.075) * size
        nx, ny = -(y2 - y) / length * off, (x2 - x) / length * off
        # Above a horizontal part, right of a hanging one; below a damper, as springs lie above it.
        sign = -1 if (ny < -1e-9 or (abs(ny) <= 1e-9 and nx < 0)) else 1
        sign = -sign if shape.kind == "damper" else sign
        x, y = (x + x2) / 2 + sign * nx, (y + y2) / 2 + sign * ny
    letter, _, index = shape.label.partition("_")
    if not index and len(letter) > 1 and letter[-1].isdigit():
        letter, index = letter.rstrip("0123456789"), letter[len(letter.rstrip("0123456789")) :]
    return _n(x), _n(-y), GREEK.get(letter, letter), GREEK.get(index, index)


def _n(value: float) -> str:
    return f"{value:.4g}"


VERDICTS = {"agrees": "✓", "agrees up to signs": "±", "differs": "≠"}


def symbols(system: SystemResult) -> Iterator[tuple[object, ...]]:
    """Yield coordinates, inputs, and outputs with the expression of each."""
    for what, quantities in (("coordinate", system.coordinates), ("input", system.inputs)):
        for entry in quantities:
            yield mathml(entry.latex), what, entry.unit, entry.description
    for output in system.outputs:
        yield mathml(output.formula.latex), "output", output.unit, output.description


def constants(system: SystemResult) -> Iterator[tuple[object, ...]]:
    """Yield the symbol of each constant, its value, unit, meaning and source."""
    for constant in system.constants:
        yield (
            mathml(constant.latex),
            repr(constant.value),
            constant.unit,
            constant.description,
            constant.source,
        )


def errata(system: SystemResult) -> Iterator[tuple[str, ...]]:
    """Yield each published equation with the derived erratum and their difference."""
    names = [coordinate.name for coordinate in system.coordinates]
    for erratum in system.derivation.errata if system.derivation else ():
        yield (
            erratum.number,
            erratum.published,
            primed(erratum.derived, names),
            f"{VERDICTS[erratum.verdict]} {erratum.verdict}",
            primed(erratum.difference, names) or NOTHING,
            erratum.note,
        )


def scenarios(system: SystemResult) -> Iterator[tuple[str, ...]]:
    """Yield each scenario with its inputs and the bounds of its reference."""
    for scenario in system.scenarios:
        yield (
            scenario.name,
            scenario.description,
            quantity(scenario.duration, "s"),
            "; ".join(f"{name} = {text}" for name, text in scenario.inputs.items()),
            str(scenario.segments),
            scenario.method,
            sci(scenario.bound),
            sci(scenario.global_bound),
        )


def acting(models: Iterable[Model]) -> list[tuple[str, ...]]:
    """Return what the numbers of models act as, in each engine."""
    return [
        (model.engine, row.subject, row.quantity, quantity(row.value, row.unit), row.rule)
        for model in models
        for row in model.acting
    ]


def advice(models: Iterable[Model]) -> list[tuple[str, ...]]:
    """Return implausible numbers: code, place, message, and the reason for accepting each."""
    rows = (
        (one.code, str(one.location or "").rpartition("/")[2], one.message, one.accepted)
        for model in models
        for one in model.audit or ()
        if one.severity == "advice"
    )
    return list(dict.fromkeys(rows))


RIGID = 1e-6
"""Poles below this share of the largest belong to a rigid mode.

Such a mode is a double root, and rounding moves its poles by the square root of epsilon.
"""


def equilibria(system: SystemResult, models: Iterable[Model]) -> Iterable[str]:
    """Return the equilibria of a system; those of its models without formulas, as of a robot."""
    if system.derivation is None:
        return dict.fromkeys(one.equilibrium for model in models for one in model.linearizations)
    return [one.equilibrium for one in system.derivation.linearizations]


def linearized(
    equilibrium: str, models: Iterable[Model]
) -> list[tuple[Model, EngineLinearization]]:
    """Return the models with their linearizations about an equilibrium."""
    return [
        (model, one)
        for model in models
        for one in model.linearizations
        if one.equilibrium == equilibrium
    ]


def transfer_formula(transfer: TransferFunction, system: SystemResult) -> str:
    """Return the LaTeX of a transfer function."""
    output = next(each.formula.latex for each in system.outputs if each.name == transfer.output)
    source = next(each.latex for each in system.inputs if each.name == transfer.input)
    return rf"\frac{{{output}}}{{{source}}} = {transfer.formula.latex}"


def mode_rows(linearization: Linearization, system: SystemResult) -> Iterator[tuple[str, ...]]:
    """Yield each undamped mode: rad/s, Hz, shape, and a remark."""
    for mode in linearization.modes:
        shape = ", ".join(
            f"{coordinate.name} {_entry(value)}"
            for coordinate, value in zip(system.coordinates, mode.shape, strict=True)
        )
        if mode.rigid:
            yield "0", "0", shape, "rigid body"
        elif mode.growth:
            yield NOTHING, NOTHING, shape, f"grows, {mode.growth:.5g} 1/s"
        elif mode.frequency is None:
            yield NOTHING, NOTHING, shape, ""
        else:
            hertz = mode.frequency / (2 * math.pi)
            yield f"{mode.frequency:.6g}", f"{hertz:.5g}", shape, ""


def _entry(value: float | None) -> str:
    if value is None:
        return NOTHING
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}"


def exact_poles(linearization: EngineLinearization) -> list[tuple[str, str]]:
    """Return the exact poles, one per conjugate pair, with their frequency and damping."""
    poles = linearization.taylor_poles
    size = _largest(poles)
    return [(_pole(poles[i], size), _pace(poles[i], size)) for i in _shown_poles(poles)]


def engine_poles(linearization: EngineLinearization) -> list[tuple[str, str]]:
    """Return the poles of an engine, each with its relative distance from the exact one."""
    poles, taylor = linearization.poles, linearization.taylor_poles
    size = _largest(taylor)
    return [
        (_pole(poles[i], size), sci(abs(_complex(poles[i]) - _complex(taylor[i])) / size))
        for i in _shown_poles(taylor)
    ]


def linear_errors(linearization: EngineLinearization) -> tuple[str, ...]:
    """Return the errors of A, B, transfer functions, mode shapes and a step, and its radius."""
    alike, step = linearization.mode_similarity, linearization.one_step
    return (
        sci(linearization.a_error),
        sci(linearization.b_error),
        sci(linearization.transfer_error),
        NOTHING if alike is None else sci(max(0.0, 1.0 - alike)),
        sci(None if step is None else step.error),
        NOTHING if step is None or step.radius is None else f"{step.radius:.6f}",
    )


def _complex(pole: EnginePole) -> complex:
    missing = float("nan")
    return complex(
        missing if pole.real is None else pole.real,
        missing if pole.imaginary is None else pole.imaginary,
    )


def _shown_poles(poles: Sequence[EnginePole]) -> list[int]:
    """Return the indices of one pole per conjugate pair and of every real pole."""
    return [i for i, pole in enumerate(poles) if (pole.imaginary or 0.0) >= 0.0]


def _largest(poles: Sequence[EnginePole]) -> float:
    return max((abs(_complex(pole)) for pole in poles), default=0.0) or 1.0


def _pole(pole: EnginePole, size: float) -> str:
    if abs(_complex(pole)) < RIGID * size:
        return "0"
    return complex_number(pole.real, pole.imaginary, bool(pole.imaginary))


def _pace(pole: EnginePole, size: float) -> str:
    if abs(_complex(pole)) < RIGID * size:
        return "rigid"
    if pole.real is None or not pole.frequency:
        return NOTHING
    if not pole.imaginary:
        goes = "grows" if pole.real > 0 else "decays"
        return f"{goes} in {1 / pole.frequency:.4g} s"
    damping = pole.damping or 0.0
    ratio = f"damping ratio {damping:.4g}" if abs(damping) > 1e-9 else "undamped"
    return f"{pole.frequency:.5g} rad/s, {ratio}"
