"""An invented system for the report's tests, in the form that a run writes."""

from __future__ import annotations

from physics_crosscheck.harness.records.system import (
    ConstantValue,
    Derivation,
    Erratum,
    Formula,
    Linearity,
    Linearization,
    Mode,
    OutputFormula,
    Pole,
    ReferenceMotion,
    Shape,
    Sketch,
    SketchTree,
    Symbol,
    TransferFunction,
)
from physics_crosscheck.records import SystemResult

SCENARIOS = ("free", "driven", "large")


def formula(text: str) -> Formula:
    return Formula(text=text, latex=rf"\text{{{text}}}")


def sketch(coordinates: int) -> Sketch:
    """Return a sketch of blocks on springs, the first one rotated."""
    shapes = [
        Shape(kind="wall", label="", start=[-1.0, 0.5], end=[-1.0, -0.5]),
        Shape(kind="measure", label="q0", start=[0.0, 0.4], end=[["q", 0], 0.4]),
        Shape(
            kind="angle",
            label="theta",
            center=[0.0, 0.0],
            radius=0.3,
            start=0.0,
            end=["*", 2.0, ["q", 0]],
        ),
    ]
    for i in range(coordinates):
        here: SketchTree = ["+", ["q", i], float(i)]
        shapes += [
            Shape(kind="spring", label="k", start=[i - 1.0, 0.0], end=[here, 0.0]),
            Shape(
                kind="block",
                label=f"m_{i}",
                center=[here, ["sin", ["*", 0.5, ["q", i]]]],
                width=0.3,
                height=0.2,
                angle=["^", ["q", i], 2.0],
            ),
        ]
    return Sketch(pose=(0.5,) * coordinates, shapes=tuple(shapes))


def taylor_pole(real: float, imaginary: float) -> Pole:
    size = abs(complex(real, imaginary))
    damping = -real / size
    return Pole(real=real, imaginary=imaginary, multiplicity=1, frequency=size, damping=damping)


def system(name: str, coordinates: int) -> SystemResult:
    names = [f"q{i}" for i in range(coordinates)]
    return SystemResult(
        name=name,
        folder=f"/models/{name}",
        title=f"The {name}",
        source="Example 9.1",
        kind="SIMO",
        coordinates=tuple(
            Symbol(name=n, unit="m", description=f"displacement {n}", latex=f"q_{{{i}}}")
            for i, n in enumerate(names)
        ),
        constants=(
            ConstantValue(
                name="k",
                unit="N/m",
                description="stiffness",
                latex="k",
                value=38.25,
                source="chosen",
            ),
        ),
        inputs=(Symbol(name="f", unit="N", description="force", latex="f"),),
        outputs=tuple(
            OutputFormula(name=n, unit="m", description=f"displacement {n}", formula=formula(n))
            for n in names
        ),
        scenarios=tuple(
            ReferenceMotion(
                name=scenario,
                description=f"a {scenario} motion",
                duration=12.0,
                inputs={"f": "sin(t)"},
                segments=300,
                method="exactly",
                bound=1e-16,
                global_bound=1e-13,
            )
            for scenario in SCENARIOS
        ),
        derivation=derivation(names),
        sketch=sketch(coordinates),
        seconds=1.0,
    )


def derivation(names: list[str]) -> Derivation:
    return Derivation(
        energies={
            "T": formula("m*q0_dot**2/2"),
            "V": formula("k*q0**2/2"),
            "D": formula("0"),
        },
        equations=tuple(formula(f"Eq(m*{n}_ddot, f*max(0, 1) - k*{n})") for n in names),
        linearizations=(
            Linearization(
                equilibrium="rest",
                position=(0.0,) * len(names),
                formula=formula("M*q0_ddot + K*q0 = F*f"),
                matrices={},
                poles=(taylor_pole(-0.1, 3.0),),
                modes=(Mode(frequency=3.0, growth=0.0, shape=(1.0,) * len(names), rigid=False),),
                transfer_functions=(
                    TransferFunction(output="q0", input="f", formula=formula("1/(k + m*s**2)")),
                ),
            ),
        ),
        linearity=(
            Linearity(
                equilibrium="rest",
                mode=0,
                period=2.0,
                amplitudes=(0.01, 0.1, 1.0),
                errors=(1e-5, 1e-3, 0.1),
            ),
        ),
        errata=(
            Erratum(
                number="9.2",
                published="k*q0 + k*q0",
                verdict="differs",
                derived="k*q0",
                difference="k*q0",
                note="twice",
            ),
        ),
    )
