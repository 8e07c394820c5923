"""A system as a page to read: what is declared, and what is derived from it."""

from __future__ import annotations

from typing import Any, Literal

from physics_crosscheck.harness.records.base import Count, Number, Numbers, Record, Rows

SketchTree = float | list[Any]
"""A number, `["q", i]` for the i-th position, or an operation (+ * ^ sin cos tan) with operands."""


class Formula(Record, frozen=True, kw_only=True):
    """An expression, kept once.

    Attributes:
        text: as sympy reads it.
        latex: as everything shows it.
    """

    text: str
    latex: str


class Quantity(Record, frozen=True, kw_only=True):
    """A coordinate or an input.

    Attributes:
        name: as the declaration has it.
        unit: in SI, empty for none.
        description: a few words.
        latex: of its symbol.
    """

    name: str
    unit: str
    description: str
    latex: str


class Constant(Record, frozen=True, kw_only=True):
    """A constant of the equations.

    Attributes:
        name, unit, description, latex: as in `Quantity`.
        value: in its unit.
        source: where it comes from.
    """

    name: str
    unit: str
    description: str
    latex: str
    value: float
    source: str


class Output(Record, frozen=True, kw_only=True):
    """An output.

    Attributes:
        name, unit, description: as in `Quantity`.
        formula: of the states.
    """

    name: str
    unit: str
    description: str
    formula: Formula


class Pole(Record, frozen=True, kw_only=True):
    """An eigenvalue of the linear equations.

    Attributes:
        real, imaginary: 1/s.
        multiplicity: how often it is one.
        frequency: its magnitude, rad/s.
        damping: ratio; None at zero.
    """

    real: Number
    imaginary: Number
    multiplicity: Count
    frequency: Number
    damping: Number


class Mode(Record, frozen=True, kw_only=True):
    """A mode without damping.

    Attributes:
        frequency: rad/s; 0 where it grows.
        growth: 1/s, where the stiffness is negative.
        shape: by coordinate, largest entry 1.
        rigid: whether it has neither frequency nor growth.
    """

    frequency: Number
    growth: Number
    shape: Numbers
    rigid: bool


class TransferFunction(Record, frozen=True, kw_only=True):
    """From an input to an output.

    Attributes:
        output, input: their names.
        formula: of the Laplace variable s.
    """

    output: str
    input: str
    formula: Formula


class Linearization(Record, frozen=True, kw_only=True):
    """Taylor's linearization about an equilibrium.

    Attributes:
        equilibrium: its name.
        position: of it.
        formula: the linear equations, M a + C v + K q = F u.
        matrices: M, C, K, F and A, B, Cy, D.
        poles: of A.
        modes: of M and K.
        transfer_functions: one for each output and input.
    """

    equilibrium: str
    position: Numbers
    formula: Formula
    matrices: dict[str, Rows]
    poles: tuple[Pole, ...]
    modes: tuple[Mode, ...]
    transfer_functions: tuple[TransferFunction, ...]


class Linearity(Record, frozen=True, kw_only=True):
    """How far the linear equations hold: their error over amplitude, in one mode.

    Attributes:
        equilibrium: about which they are taken.
        mode: its index, slowest first.
        period: of the mode, seconds.
        amplitudes: of its shape's largest entry.
        errors: largest over a period, relative to the amplitude.
    """

    equilibrium: str
    mode: Count
    period: Number
    amplitudes: Numbers
    errors: Numbers


class Erratum(Record, frozen=True, kw_only=True):
    """A published equation held against the derivation.

    Attributes:
        number: of the equation in the source.
        published: as transcribed.
        verdict: whether it agrees with the derivation.
        derived: what the derivation has in its place.
        difference: published less derived under the signs that leave least; empty where it agrees.
        note: of who transcribed it.
    """

    number: str
    published: str
    verdict: Literal["agrees", "agrees up to signs", "differs"]
    derived: str
    difference: str
    note: str


class Scenario(Record, frozen=True, kw_only=True):
    """A scenario, and how its reference motion was solved.

    Attributes:
        name, description: as the declaration has them.
        duration: seconds.
        inputs: expressions of t, by name.
        segments: of the motion.
        method: of the solution.
        bound: of the solution's error at the end of a segment, largest, in units of the states.
        global_bound: of its error from the start of the motion on, likewise; None where an error
            may grow to anything, as in chaos.
    """

    name: str
    description: str
    duration: float
    inputs: dict[str, str]
    segments: Count
    method: str
    bound: Number
    global_bound: Number


class Shape(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A shape of a sketch: places are trees of positions; lengths in m, y up, angles in rad.

    Attributes:
        kind: what is drawn.
        label: the symbol written at it, or nothing.
        start, end: of a link, points; of an angle, trees.
        at: of a body or an angle.
        width, height, angle: of a body.
        radius: of an angle's arc.
    """

    kind: Literal[
        "spring", "damper", "rod", "line", "wall", "measure", "block", "disc", "spiral", "angle"
    ]
    label: str
    start: SketchTree | None = None
    end: SketchTree | None = None
    at: list[SketchTree] | None = None
    width: SketchTree | None = None
    height: SketchTree | None = None
    radius: SketchTree | None = None
    angle: SketchTree | None = None


_LINKS = ("spring", "damper", "rod", "line", "wall", "measure")


def _trees(shape: Shape) -> list[SketchTree | None]:
    """Every place and size of a shape.

    Raises:
        ValueError: where one is missing.
    """
    link = shape.kind in _LINKS
    points = (shape.start, shape.end) if link else (shape.at,)
    places = [tree for point in points if isinstance(point, list) for tree in point]
    if len(places) != 2 * len(points):
        raise ValueError(f"a {shape.kind} of the sketch has no place")
    if link:
        return places
    if shape.kind == "angle":
        return [*places, shape.radius, shape.start, shape.end]
    return [*places, shape.width, shape.height, shape.angle]


MOST_NESTED = 100

_OPERANDS = {"^": 2, "sin": 1, "cos": 1, "tan": 1}
"""How many an operation has; `+` and `*` have any number."""


def _check(tree: object, positions: int, depth: int = 0) -> None:
    """Refuse what is no tree.

    Raises:
        ValueError: naming it.
    """
    match tree:
        case bool():
            pass
        case int() | float():
            return
        case ["q", int(i)] if 0 <= i < positions:
            return
        case [str(name), *operands] if depth < MOST_NESTED and (
            name in ("+", "*") or len(operands) == _OPERANDS.get(name)
        ):
            for operand in operands:
                _check(operand, positions, depth + 1)
            return
    said = repr(tree)[:40] if not isinstance(tree, list) else f"a list of {len(tree)}"
    raise ValueError(f"{said} in the sketch is neither a number nor a known operation")


class Sketch(Record, frozen=True, kw_only=True):
    """What the mechanism looks like.

    Attributes:
        pose: positions in which to show it.
        shapes: from back to front.
    """

    pose: Numbers
    shapes: tuple[Shape, ...]

    def __post_init__(self) -> None:
        for shape in self.shapes:
            for tree in _trees(shape):
                _check(tree, len(self.pose))


class Derivation(Record, frozen=True, kw_only=True):
    """What is derived from a declaration, as formulas.

    Attributes:
        energies: T, V, D and L.
        equations: M a = f, a row a coordinate.
        linearizations: about every equilibrium.
        linearity: how far they hold.
        errata: what the source prints, held against the derivation.
    """

    energies: dict[str, Formula]
    equations: tuple[Formula, ...]
    linearizations: tuple[Linearization, ...]
    linearity: tuple[Linearity, ...]
    errata: tuple[Erratum, ...]


class System(Record, frozen=True, kw_only=True):
    """A system.

    Attributes:
        name, title: as declared.
        folder: where it was loaded from.
        source: where it is published.
        coordinates, constants: as declared.
        kind: by the number of inputs and outputs.
        inputs, outputs, scenarios: as declared.
        derivation: None where it was not asked for.
        sketch: None where none is declared.
        seconds: that deriving and solving it took.
    """

    name: str
    folder: str
    title: str
    source: str
    kind: Literal["SISO", "SIMO", "MISO", "MIMO", "autonomous"]
    coordinates: tuple[Quantity, ...]
    constants: tuple[Constant, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Output, ...]
    scenarios: tuple[Scenario, ...]
    derivation: Derivation | None = None
    sketch: Sketch | None = None
    seconds: float = 0.0
