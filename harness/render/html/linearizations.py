"""The view of linearizations: the exact one, and each engine's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from physics_crosscheck.harness.records.model import (
    DiscreteLinearization,
    EngineLinearization,
    EnginePole,
    Model,
)
from physics_crosscheck.harness.records.system import (
    Linearization,
    Mode,
    Pole,
    Symbol,
    SystemResult,
    TransferFunction,
)
from physics_crosscheck.harness.render.html.maths import mathml
from physics_crosscheck.harness.render.html.text import NOTHING, complex_number, sci, shown

RIGID = 1e-6
"""Poles below this share of the largest belong to a rigid mode.

Such a mode is a double root, and rounding moves its poles by the square root of epsilon.
"""


@dataclass(frozen=True, kw_only=True)
class EngineLinearView:
    """An engine's own linearization of a model, compared with the exact one.

    Attributes:
        errors: errors of A, B, transfer functions, mode shapes and one step, and that step's
            spectral radius.
        poles: each pole with its distance from the exact one.
    """

    model: str
    engine: str
    errors: tuple[str, ...]
    poles: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class LinearView:
    """The linearizations about one equilibrium: exact poles, then each engine's.

    Attributes:
        equations: the linear equations.
        transfers: transfer functions.
        modes: undamped modes, (rad/s, Hz, shape, remark).
    """

    equilibrium: str
    equations: Markup
    transfers: tuple[Markup, ...]
    modes: tuple[tuple[str, ...], ...]
    poles: tuple[tuple[str, str], ...]
    engines: tuple[EngineLinearView, ...]


def linear_views(system: SystemResult, models: Sequence[Model]) -> tuple[LinearView, ...]:
    """Return the views of a system's linearizations, with those of its models."""
    if system.derivation is None:
        names = dict.fromkeys(one.equilibrium for model in models for one in model.linearizations)
        return tuple(_poles_alone(name, models) for name in names)
    return tuple(_linear_view(one, system, models) for one in system.derivation.linearizations)


def _poles_alone(equilibrium: str, models: Sequence[Model]) -> LinearView:
    """Return the view of a linearization without formulas, as of a robot."""
    of_models = _of_models(equilibrium, models)
    exact = of_models[0][1].taylor_poles
    return LinearView(
        equilibrium=shown(equilibrium),
        equations=Markup(""),
        transfers=(),
        modes=(),
        poles=_exact_poles(exact),
        engines=tuple(_engine(model, one) for model, one in of_models),
    )


def _of_models(
    equilibrium: str, models: Sequence[Model]
) -> list[tuple[Model, EngineLinearization]]:
    return [
        (model, one)
        for model in models
        for one in model.linearizations
        if one.equilibrium == equilibrium
    ]


def _exact_poles(poles: Sequence[Pole | EnginePole]) -> tuple[tuple[str, str], ...]:
    size = _largest(poles)
    return tuple((_pole(poles[i], size), _pace(poles[i], size)) for i in _shown_poles(poles))


def _linear_view(about: Linearization, system: SystemResult, models: Sequence[Model]) -> LinearView:
    of_models = _of_models(about.equilibrium, models)
    taylor: Sequence[Pole | EnginePole] = about.poles
    if of_models:
        taylor = of_models[0][1].taylor_poles
    return LinearView(
        equilibrium=shown(about.equilibrium),
        equations=mathml(about.formula.latex, block=True),
        transfers=tuple(_transfer(one, system) for one in about.transfer_functions),
        modes=tuple(_mode(mode, system.coordinates) for mode in about.modes),
        poles=_exact_poles(taylor),
        engines=tuple(_engine(model, one) for model, one in of_models),
    )


def _transfer(transfer: TransferFunction, system: SystemResult) -> Markup:
    output = next(each.formula.latex for each in system.outputs if each.name == transfer.output)
    source = next(each.latex for each in system.inputs if each.name == transfer.input)
    return mathml(rf"\frac{{{output}}}{{{source}}} = {transfer.formula.latex}", block=True)


def _mode(mode: Mode, coordinates: Sequence[Symbol]) -> tuple[str, ...]:
    shape = ", ".join(
        f"{shown(coordinate.name)} {_entry(value)}"
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


def _engine(model: Model, linearization: EngineLinearization) -> EngineLinearView:
    poles, taylor = linearization.poles, linearization.taylor_poles
    size = _largest(taylor)
    alike = linearization.mode_similarity
    return EngineLinearView(
        model=shown(model.model),
        engine=shown(model.engine),
        errors=(
            sci(linearization.a_error),
            sci(linearization.b_error),
            sci(linearization.transfer_error),
            NOTHING if alike is None else sci(max(0.0, 1.0 - alike)),
            NOTHING if linearization.one_step is None else sci(linearization.one_step.error),
            NOTHING if linearization.one_step is None else _radius(linearization.one_step),
        ),
        poles=tuple(
            (_pole(poles[i], size), sci(abs(_complex(poles[i]) - _complex(taylor[i])) / size))
            for i in _shown_poles(taylor)
        ),
    )


def _radius(linearization: DiscreteLinearization) -> str:
    """Return the largest growth factor of a state in one step."""
    return NOTHING if linearization.radius is None else f"{linearization.radius:.6f}"


def _complex(pole: Pole | EnginePole) -> complex:
    missing = float("nan")
    return complex(
        missing if pole.real is None else pole.real,
        missing if pole.imaginary is None else pole.imaginary,
    )


def _shown_poles(poles: Sequence[Pole | EnginePole]) -> list[int]:
    """Return the indices of one pole per conjugate pair and of every real pole."""
    return [i for i, pole in enumerate(poles) if (pole.imaginary or 0.0) >= 0.0]


def _largest(poles: Sequence[Pole | EnginePole]) -> float:
    return max((abs(_complex(pole)) for pole in poles), default=0.0) or 1.0


def _pole(pole: Pole | EnginePole, size: float) -> str:
    if abs(_complex(pole)) < RIGID * size:
        return "0"
    return complex_number(pole.real, pole.imaginary, bool(pole.imaginary))


def _pace(pole: Pole | EnginePole, size: float) -> str:
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
