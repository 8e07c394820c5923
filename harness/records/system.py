"""A system as a page to read: what is declared, and what is derived from it."""

from __future__ import annotations

from typing import Any, Literal

from harness.records.base import Number, Numbers, Record, Rows

SketchTree = float | list[Any]
"""A number, `["q", i]` for the i-th position, or an operation (+ * ^ sin cos tan) with operands."""


class Formula(Record, frozen=True, kw_only=True):
    """An expression, kept once: as text that sympy reads, and as LaTeX that everything shows."""

    text: str
    latex: str


class Quantity(Record, frozen=True, kw_only=True):
    """A coordinate or an input.

    Attributes:
        latex: of its symbol.
    """

    name: str
    unit: str
    description: str
    latex: str


class Constant(Record, frozen=True, kw_only=True):
    """A constant of the equations, with its value in SI units and where it comes from."""

    name: str
    unit: str
    description: str
    latex: str
    value: float
    source: str


class Output(Record, frozen=True, kw_only=True):
    """An output, an expression of the states."""

    name: str
    unit: str
    description: str
    formula: Formula


class Pole(Record, frozen=True, kw_only=True):
    """An eigenvalue of the linear equations, of `multiplicity`; 1/s, and rad/s."""

    real: Number
    imaginary: Number
    multiplicity: int
    frequency: Number
    damping: Number


class Mode(Record, frozen=True, kw_only=True):
    """A mode without damping: rad/s, growth in 1/s, its shape by coordinate, largest entry 1."""

    frequency: Number
    growth: Number
    shape: Numbers
    rigid: bool


class TransferFunction(Record, frozen=True, kw_only=True):
    """From an input to an output, of the Laplace variable s."""

    output: str
    input: str
    formula: Formula


class Linearization(Record, frozen=True, kw_only=True):
    """Taylor's linearization about an equilibrium.

    Attributes:
        position: of the equilibrium.
        formula: the linear equations, M a + C v + K q = F u.
        matrices: M, C, K, F and A, B, Cy, D.
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
        period: of the mode, seconds.
        amplitudes: of its shape's largest entry.
        errors: largest over a period, relative to the amplitude.
    """

    equilibrium: str
    mode: int
    period: Number
    amplitudes: Numbers
    errors: Numbers


class Erratum(Record, frozen=True, kw_only=True):
    """A published equation held against the derivation.

    Attributes:
        number: of the equation in the source.
        published: as transcribed.
        derived: what the derivation has in its place.
        difference: published less derived under the signs that leave least; empty where it agrees.
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
        duration: seconds.
        inputs: expressions of t, by name.
        segments: of the motion.
        method: of the solution.
        bound: of the solution's error at the end of a segment, largest, in units of the states.
    """

    name: str
    description: str
    duration: float
    inputs: dict[str, str]
    segments: int
    method: str
    bound: Number


class Shape(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A shape of a sketch: places are trees of positions; lengths in m, y up, angles in rad.

    Attributes:
        start, end: of a link, points; of an angle, trees.
        at: of a body or an angle.
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


class Sketch(Record, frozen=True, kw_only=True):
    """What the mechanism looks like, and the positions in which to show it."""

    pose: Numbers
    shapes: tuple[Shape, ...]


class Derivation(Record, frozen=True, kw_only=True):
    """What is derived from a declaration, as formulas.

    Attributes:
        energies: T, V, D and L.
        equations: M a = f, a row a coordinate.
    """

    energies: dict[str, Formula]
    equations: tuple[Formula, ...]
    linearizations: tuple[Linearization, ...]
    linearity: tuple[Linearity, ...]
    errata: tuple[Erratum, ...]


class System(Record, frozen=True, kw_only=True):
    """A system.

    Attributes:
        kind: by the number of inputs and outputs.
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
