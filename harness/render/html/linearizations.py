"""The view of linearizations: the exact one, and each engine's own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from physics_crosscheck.harness.records.model import (
    EngineLinearization,
    EnginePole,
    Model,
)
from physics_crosscheck.harness.records.system import (
    Mode,
    Symbol,
    SystemResult,
    TransferFunction,
)
from physics_crosscheck.harness.render.html.text import NOTHING, complex_number, sci

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


def mode_row(mode: Mode, coordinates: Sequence[Symbol]) -> tuple[str, ...]:
    """Return an undamped mode: rad/s, Hz, shape, and a remark."""
    shape = ", ".join(
        f"{coordinate.name} {_entry(value)}"
        for coordinate, value in zip(coordinates, mode.shape, strict=True)
    )
    if mode.rigid:
        return "0", "0", shape, "rigid body"
    if mode.growth:
        return NOTHING, NOTHING, shape, f"grows, {mode.growth:.5g} 1/s"
    if mode.frequency is None:
        return NOTHING, NOTHING, shape, ""
    return f"{mode.frequency:.6g}", f"{mode.frequency / (2 * math.pi):.5g}", shape, ""


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
