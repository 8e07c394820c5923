"""What the report shows of one system: equations, constants, errata, linearizations, files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from harness.report.drawing import Drawing, drawing
from harness.report.maths import maths
from harness.report.text import NOTHING, complex_number, equation, quantity, sci, shown

VERDICTS = {"agrees": "✓", "agrees up to signs": "±", "differs": "≠"}

RIGID = 1e-6
"""Poles below this share of the largest are those of a rigid mode, which is a double root: rounding
moves such a pole by the square root of epsilon."""


@dataclass(frozen=True)
class EngineLinearization:
    """A model's own linearization beside Taylor's: errors, and its poles with theirs."""

    model: str
    engine: str
    errors: tuple[str, ...]
    poles: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Linearization:
    """The linearizations about one equilibrium: Taylor's poles, then every model's.

    Attributes:
        equations: the linear equations; empty where they are not recorded.
        transfers: transfer functions.
        modes: (rad/s, Hz, shape) without damping.
    """

    equilibrium: str
    equations: Markup
    transfers: tuple[Markup, ...]
    modes: tuple[tuple[str, ...], ...]
    poles: tuple[tuple[str, str], ...]
    twins: tuple[EngineLinearization, ...]


@dataclass(frozen=True)
class ModelFile:
    """A model file as it was run, or why its linearization is missing."""

    model: str
    engines: str
    text: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class SystemView:
    """One system; tables are rows of strings in the order of their columns.

    Attributes:
        drawing: its sketch; None without.
        lagrangian: L = T - V, and what is not in it.
        equations: of motion.
        pack: id of its numbers and plots.
    """

    title: str
    source: str
    kind: str
    drawing: Drawing | None
    symbols: tuple[tuple[Markup | str, ...], ...]
    lagrangian: tuple[tuple[str, Markup], ...]
    equations: tuple[Markup, ...]
    constants: tuple[tuple[Markup | str, ...], ...]
    errata: tuple[tuple[str, ...], ...]
    linearizations: tuple[Linearization, ...]
    scenarios: tuple[tuple[str, ...], ...]
    files: tuple[ModelFile, ...]
    pack: str


def system_view(
    system: Mapping[str, Any], models: Sequence[Mapping[str, Any]], pack: str
) -> SystemView:
    """The view of a system and of the models in its folder.

    Args:
        pack: id of its numbers and plots.
    """
    sketch = system.get("sketch")
    return SystemView(
        title=shown(system["title"]),
        source=shown(system["source"]),
        kind=shown(system["kind"]),
        drawing=sketch and drawing(sketch, [c["name"] for c in system["coordinates"]]),
        symbols=tuple(
            (maths(e.get("mathml"), e["name"]), what, shown(e["unit"]), shown(e["description"]))
            for what in ("coordinate", "input", "output")
            for e in system[f"{what}s"]
        ),
        lagrangian=tuple(
            (name, maths(found.get("mathml"), found["text"], block=True))
            for name, found in sorted(system["energies"].items(), key=lambda e: "LTVD".find(e[0]))
        ),
        equations=tuple(
            maths(one.get("mathml"), equation(one["text"]), block=True)
            for one in system["equations"]
        ),
        constants=tuple(
            (
                maths(c.get("mathml"), c["name"]),
                repr(c["value"]),
                shown(c["unit"]),
                shown(c["description"]),
                shown(c["source"]),
            )
            for c in system["constants"]
        ),
        errata=tuple(
            (
                shown(e["number"]),
                shown(e["printed"]),
                _as_published(e["derived"], system),
                f"{VERDICTS.get(e['verdict'], '')} {shown(e['verdict'])}",
                _as_published(e["difference"], system) or NOTHING,
                shown(e["note"]),
            )
            for e in system["errata"]
        ),
        linearizations=_linearizations(system, models),
        scenarios=tuple(
            (
                shown(s["name"]),
                shown(s["description"]),
                quantity(s["duration"], "s"),
                "; ".join(f"{shown(name)} = {shown(text)}" for name, text in s["inputs"].items()),
                str(s["segments"]),
                shown(s["method"]),
                sci(s["bound"]),
            )
            for s in system["scenarios"]
        ),
        files=_files(models),
        pack=pack,
    )


def _as_published(text: str, system: Mapping[str, Any]) -> str:
    """A derived equation with primes and carets, as the published one beside it has them."""
    for name in sorted((c["name"] for c in system["coordinates"]), key=len, reverse=True):
        text = text.replace(f"{name}_ddot", f"{name}''").replace(f"{name}_dot", f"{name}'")
    return shown(text.replace("**", "^"))


def _linearizations(
    system: Mapping[str, Any], models: Sequence[Mapping[str, Any]]
) -> tuple[Linearization, ...]:
    found = []
    for about in system["linearizations"]:
        name = about["equilibrium"]
        of_models = [
            (model, one)
            for model in models
            for one in model["linearization"]
            if one["equilibrium"] == name
        ]
        taylor = of_models[0][1]["taylor_poles"] if of_models else about["poles"]
        size = _largest(taylor)
        poles = tuple(
            (_pole(taylor[i], size), _pace(taylor[i], size)) for i in _shown_poles(taylor)
        )
        linear = about.get("mathml")
        found.append(
            Linearization(
                shown(name),
                maths(linear, "", block=True) if linear else Markup(""),
                tuple(_transfer(one) for one in about["transfer_functions"]),
                tuple(_mode(mode, system["coordinates"]) for mode in about["modes"]),
                poles,
                tuple(_twin(model, one) for model, one in of_models),
            )
        )
    return tuple(found)


def _transfer(one: Mapping[str, Any]) -> Markup:
    text = f"{shown(one['output'])} / {shown(one['input'])} = {one['text']}"
    return maths(one.get("mathml"), text, block=True)


def _mode(mode: Mapping[str, Any], coordinates: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    shape = ", ".join(
        f"{shown(c['name'])} {0.0 if abs(value) < 1e-12 else value:.4g}"
        for c, value in zip(coordinates, mode["shape"], strict=True)
    )
    if mode["rigid"]:
        return "0", "0", shape, "rigid body"
    if mode["growth"]:
        return NOTHING, NOTHING, shape, f"grows, {mode['growth']:.5g} 1/s"
    pace = mode["frequency"]
    return f"{pace:.6g}", f"{pace / (2 * math.pi):.5g}", shape, ""


def _twin(model: Mapping[str, Any], one: Mapping[str, Any]) -> EngineLinearization:
    poles, taylor = one["poles"], one["taylor_poles"]
    size = _largest(taylor)
    shapes = one["shapes"]
    return EngineLinearization(
        shown(model["model"]),
        shown(model["engine"]),
        (
            sci(one["A_error"]),
            sci(one["B_error"]),
            sci(one["transfer_error"]),
            NOTHING if shapes is None else sci(max(0.0, 1.0 - shapes)),
        ),
        tuple(
            (_pole(poles[i], size), sci(abs(_complex(poles[i]) - _complex(taylor[i])) / size))
            for i in _shown_poles(taylor)
        ),
    )


def _complex(pole: Mapping[str, Any]) -> complex:
    missing = float("nan")
    real, imaginary = pole["real"], pole["imaginary"]
    return complex(missing if real is None else real, missing if imaginary is None else imaginary)


def _shown_poles(poles: Sequence[Mapping[str, Any]]) -> list[int]:
    """One of each conjugate pair, and every real pole."""
    return [i for i, pole in enumerate(poles) if (pole["imaginary"] or 0.0) >= 0.0]


def _largest(poles: Sequence[Mapping[str, Any]]) -> float:
    return max((abs(_complex(pole)) for pole in poles), default=0.0) or 1.0


def _pole(pole: Mapping[str, Any], size: float) -> str:
    if abs(_complex(pole)) < RIGID * size:
        return "0"
    return complex_number(pole["real"], pole["imaginary"], bool(pole["imaginary"]))


def _pace(pole: Mapping[str, Any], size: float) -> str:
    if abs(_complex(pole)) < RIGID * size:
        return "rigid"
    if not pole["imaginary"]:
        goes = "grows" if pole["real"] > 0 else "decays"
        return f"{goes} in {1 / pole['frequency']:.4g} s"
    damping = pole["damping"] or 0.0
    told = f"damping ratio {damping:.4g}" if abs(damping) > 1e-9 else "undamped"
    return f"{pole['frequency']:.5g} rad/s, {told}"


def _files(models: Sequence[Mapping[str, Any]]) -> tuple[ModelFile, ...]:
    names = dict.fromkeys(model["model"] for model in models)
    found = []
    for name in names:
        same = [model for model in models if model["model"] == name]
        reasons = tuple(
            f"{shown(m['engine'])}: {shown(m['reason'])}" for m in same if m.get("reason")
        )
        engines = ", ".join(shown(model["engine"]) for model in same)
        found.append(ModelFile(shown(name), engines, shown(same[0]["text"]), reasons))
    return tuple(found)
