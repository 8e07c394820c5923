"""A system as the report shows it: its declaration, and everything derived from it."""

from typing import Any, Literal

from .base import Count, Number, Numbers, Record, Rows
from .scene import Scene

SketchTree = float | list[Any]
"""A number, `["q", i]` for the i-th position, or an operation (+ * ^ sin cos tan) with operands."""


class Formula(Record, frozen=True, kw_only=True):
    """An expression in two notations.

    Attributes:
        text: Expression in sympy syntax.
        latex: The same in LaTeX.
    """

    text: str
    latex: str


class Symbol(Record, frozen=True, kw_only=True):
    """A coordinate or an input.

    Attributes:
        name: Declared name.
        unit: SI unit; empty for a pure number.
        description: A few words.
        latex: LaTeX of the symbol.
    """

    name: str
    unit: str
    description: str
    latex: str


class ConstantValue(Record, frozen=True, kw_only=True):
    """A constant of the equations.

    Attributes:
        name: Declared name.
        unit: SI unit; empty for a pure number.
        description: A few words.
        latex: LaTeX of the symbol.
        value: Value in `unit`.
        source: Where the value comes from.
    """

    name: str
    unit: str
    description: str
    latex: str
    value: float
    source: str


class OutputFormula(Record, frozen=True, kw_only=True):
    """An output.

    Attributes:
        name: Declared name.
        unit: SI unit; empty for a pure number.
        description: A few words.
        formula: Expression of the states.
    """

    name: str
    unit: str
    description: str
    formula: Formula


class Pole(Record, frozen=True, kw_only=True):
    """An eigenvalue of the linear equations.

    Attributes:
        real: Real part, 1/s.
        imaginary: Imaginary part, 1/s.
        multiplicity: Multiplicity of the eigenvalue.
        frequency: Magnitude, rad/s.
        damping: Damping ratio; None for a pole at zero.
    """

    real: Number
    imaginary: Number
    multiplicity: Count
    frequency: Number
    damping: Number


class Mode(Record, frozen=True, kw_only=True):
    """An undamped mode.

    Attributes:
        frequency: Frequency, rad/s; 0 for a growing mode.
        growth: Growth rate for a negative stiffness, 1/s.
        shape: Mode shape by coordinate; the largest entry is 1.
        rigid: Whether frequency and growth are both zero.
    """

    frequency: Number
    growth: Number
    shape: Numbers
    rigid: bool


class TransferFunction(Record, frozen=True, kw_only=True):
    """Transfer function from one input to one output.

    Attributes:
        output: Name of the output.
        input: Name of the input.
        formula: Expression of the Laplace variable s.
    """

    output: str
    input: str
    formula: Formula


class Linearization(Record, frozen=True, kw_only=True):
    """Linear equations about an equilibrium, by Taylor expansion.

    Attributes:
        equilibrium: Name of the equilibrium.
        position: Positions at the equilibrium.
        formula: The linear equations M a + C v + K q = F u.
        matrices: Matrices M, C, K, F and A, B, Cy, D.
        poles: Eigenvalues of A.
        modes: Undamped modes of M and K.
        transfer_functions: One for each pair of output and input.
    """

    equilibrium: str
    position: Numbers
    formula: Formula
    matrices: dict[str, Rows]
    poles: tuple[Pole, ...]
    modes: tuple[Mode, ...]
    transfer_functions: tuple[TransferFunction, ...]


class Linearity(Record, frozen=True, kw_only=True):
    """Error of the linear equations against amplitude, for one mode.

    Attributes:
        equilibrium: Name of the equilibrium.
        mode: Index of the mode, slowest first.
        period: Period of the mode, seconds.
        amplitudes: Largest entry of the mode shape.
        errors: Largest error over one period, relative to the amplitude.
    """

    equilibrium: str
    mode: Count
    period: Number
    amplitudes: Numbers
    errors: Numbers


class Erratum(Record, frozen=True, kw_only=True):
    """A published equation compared with the derivation.

    Attributes:
        number: Number of the equation in the source.
        published: Equation as published.
        verdict: Result of the comparison.
        derived: The derived equation.
        difference: Published minus derived, with the best choice of signs; empty if they agree.
        note: Note of the person who transcribed the equation.
    """

    number: str
    published: str
    verdict: Literal["agrees", "agrees up to signs", "differs"]
    derived: str
    difference: str
    note: str


class ReferenceMotion(Record, frozen=True, kw_only=True):
    """A scenario and its reference motion.

    Attributes:
        name: Declared name.
        description: Declared description.
        duration: Duration, seconds.
        inputs: Inputs as expressions of time t.
        segments: Number of segments of the motion.
        method: Method that solved the reference motion.
        bound: Largest error bound of the solution at the end of a segment, in state units.
        global_bound: Error bound from the start of the motion; None for chaotic motion.
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
    """A shape of a sketch.

    Lengths are in m, y points up, angles are in rad. Each place is an expression tree of the
    positions.

    Attributes:
        kind: Shape to draw.
        label: Symbol next to the shape; may be empty.
        start: Start point of a link; start angle of an angle.
        end: End point of a link; end angle of an angle.
        center: Center of a body or an angle.
        width: Width of a body.
        height: Height of a body.
        radius: Radius of an angle's arc.
        angle: Rotation of a body.
    """

    kind: Literal[
        "spring", "damper", "rod", "line", "wall", "measure", "block", "disc", "spiral", "angle"
    ]
    label: str
    start: SketchTree | None = None
    end: SketchTree | None = None
    center: list[SketchTree] | None = None
    width: SketchTree | None = None
    height: SketchTree | None = None
    radius: SketchTree | None = None
    angle: SketchTree | None = None


_LINKS = ("spring", "damper", "rod", "line", "wall", "measure")


def _trees(shape: Shape) -> list[SketchTree | None]:
    """Return every place and size of a shape."""
    link = shape.kind in _LINKS
    points = (shape.start, shape.end) if link else (shape.center,)
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
"""Number of operands of an operation; `+` and `*` accept any number."""


def _check(tree: object, positions: int, depth: int = 0) -> None:
    """Reject an invalid tree."""
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
    description = repr(tree)[:40] if not isinstance(tree, list) else f"a list of {len(tree)}"
    raise ValueError(f"{description} in the sketch is neither a number nor a known operation")


class Sketch(Record, frozen=True, kw_only=True):
    """A drawing of the mechanism.

    Attributes:
        pose: Positions to draw it at.
        shapes: Shapes, from back to front.
    """

    pose: Numbers
    shapes: tuple[Shape, ...]

    def __post_init__(self) -> None:
        for shape in self.shapes:
            for tree in _trees(shape):
                _check(tree, len(self.pose))


class Derivation(Record, frozen=True, kw_only=True):
    """Formulas derived from a declaration.

    Attributes:
        energies: T, V, D and L.
        equations: Equations of motion M a = f, one row per coordinate.
        linearizations: Linear equations about every equilibrium.
        linearity: Range of validity of the linear equations.
        errata: Published equations compared with the derivation.
    """

    energies: dict[str, Formula]
    equations: tuple[Formula, ...]
    linearizations: tuple[Linearization, ...]
    linearity: tuple[Linearity, ...]
    errata: tuple[Erratum, ...]


class SystemResult(Record, frozen=True, kw_only=True):
    """A system of equations.

    Attributes:
        name: Declared name.
        folder: Folder of the system.
        title: Declared title.
        source: Publication of the equations.
        kind: Class by the number of inputs and outputs.
        coordinates: Declared coordinates.
        constants: Declared constants.
        inputs: Declared inputs.
        outputs: Declared outputs.
        scenarios: Declared scenarios.
        derivation: Derived formulas; None if not requested.
        sketch: Drawing of the mechanism; None if none is declared.
        scene: Bodies at the compared states; None for declared energies.
        seconds: Time for deriving and solving, seconds.
    """

    name: str
    folder: str
    title: str
    source: str
    kind: Literal["SISO", "SIMO", "MISO", "MIMO", "autonomous"]
    coordinates: tuple[Symbol, ...]
    constants: tuple[ConstantValue, ...]
    inputs: tuple[Symbol, ...]
    outputs: tuple[OutputFormula, ...]
    scenarios: tuple[ReferenceMotion, ...]
    derivation: Derivation | None = None
    sketch: Sketch | None = None
    scene: Scene | None = None
    seconds: float = 0.0
