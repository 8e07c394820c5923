"""The view of one system: equations, constants, errata, scenarios, files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.system import (
    Derivation,
    Erratum,
    ReferenceMotion,
    SystemResult,
)
from physics_crosscheck.harness.render.html.drawing import Drawing, drawing
from physics_crosscheck.harness.render.html.linearizations import LinearView, linear_views
from physics_crosscheck.harness.render.html.maths import mathml
from physics_crosscheck.harness.render.html.text import NOTHING, quantity, sci, shown
from physics_crosscheck.harness.render.terminal.primes import primed
from physics_crosscheck.harness.results.coverage import coverage_line

VERDICTS = {"agrees": "✓", "agrees up to signs": "±", "differs": "≠"}


@dataclass(frozen=True, kw_only=True)
class ModelFile:
    """A model file of the run.

    Attributes:
        covers: what a verdict on it covers, in each engine.
        failures: why its linearization or its audit is missing, in each engine.
        acting: what its numbers act as: engine, subject, quantity, value, rule.
    """

    model: str
    engines: str
    text: str
    covers: tuple[str, ...]
    failures: tuple[str, ...]
    acting: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, kw_only=True)
class SystemView:
    """The view of one system; tables are rows of strings in column order.

    Attributes:
        drawing: its sketch; None without.
        lagrangian: L = T - V, and the other terms. This field, the equations, the errata and the
            linearizations are empty if nothing was derived.
        equations: equations of motion.
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
    linearizations: tuple[LinearView, ...]
    scenarios: tuple[tuple[str, ...], ...]
    files: tuple[ModelFile, ...]
    pack: str


NOT_DERIVED = Derivation(energies={}, equations=(), linearizations=(), linearity=(), errata=())


def system_view(system: SystemResult, models: Sequence[Model], pack: str) -> SystemView:
    """Return the view of a system and of the models in its folder.

    Args:
        pack: id of its numbers and plots.
    """
    derived = system.derivation or NOT_DERIVED
    names = [coordinate.name for coordinate in system.coordinates]
    return SystemView(
        title=shown(system.title),
        source=shown(system.source),
        kind=system.kind,
        drawing=None if system.sketch is None else drawing(system.sketch, names),
        symbols=tuple(_symbols(system)),
        lagrangian=tuple(
            (name, mathml(formula.latex, block=True))
            for name, formula in sorted(derived.energies.items(), key=lambda e: "LTVD".find(e[0]))
        ),
        equations=tuple(mathml(one.latex, block=True) for one in derived.equations),
        constants=tuple(
            (
                mathml(constant.latex),
                repr(constant.value),
                shown(constant.unit),
                shown(constant.description),
                shown(constant.source),
            )
            for constant in system.constants
        ),
        errata=tuple(_erratum(erratum, names) for erratum in derived.errata),
        linearizations=linear_views(system, models),
        scenarios=tuple(_scenario(scenario) for scenario in system.scenarios),
        files=_files(models),
        pack=pack,
    )


def _symbols(system: SystemResult) -> Iterator[tuple[Markup | str, ...]]:
    """Yield the outputs with the expression of each."""
    for what, quantities in (("coordinate", system.coordinates), ("input", system.inputs)):
        for entry in quantities:
            yield mathml(entry.latex), what, shown(entry.unit), shown(entry.description)
    for output in system.outputs:
        meaning = shown(output.description)
        yield mathml(output.formula.latex), "output", shown(output.unit), meaning


def _erratum(erratum: Erratum, names: Sequence[str]) -> tuple[str, ...]:
    return (
        shown(erratum.number),
        shown(erratum.published),
        shown(primed(erratum.derived, names)),
        f"{VERDICTS[erratum.verdict]} {erratum.verdict}",
        shown(primed(erratum.difference, names)) or NOTHING,
        shown(erratum.note),
    )


def _scenario(scenario: ReferenceMotion) -> tuple[str, ...]:
    return (
        shown(scenario.name),
        shown(scenario.description),
        quantity(scenario.duration, "s"),
        "; ".join(f"{shown(name)} = {shown(text)}" for name, text in scenario.inputs.items()),
        str(scenario.segments),
        shown(scenario.method),
        sci(scenario.bound),
        sci(scenario.global_bound),
    )


def _files(models: Sequence[Model]) -> tuple[ModelFile, ...]:
    rows = []
    for name in dict.fromkeys(model.model for model in models):
        same = [model for model in models if model.model == name]
        rows.append(
            ModelFile(
                model=shown(name),
                engines=", ".join(shown(model.engine) for model in same),
                text=shown(same[0].text),
                covers=tuple(_covers(model) for model in same if coverage_line(model)),
                failures=tuple(failure for model in same for failure in _failures(model)),
                acting=tuple(row for model in same for row in _acting(model)),
            )
        )
    return tuple(rows)


def _acting(model: Model) -> Iterator[tuple[str, ...]]:
    for row in model.acting:
        value = quantity(row.value, row.unit)
        yield (
            shown(model.engine), shown(row.subject), shown(row.quantity), value, shown(row.rule)
        )  # fmt: skip


def _covers(model: Model) -> str:
    return f"{shown(model.engine)}: {shown(coverage_line(model, examples=True))}."


def _failures(model: Model) -> Iterator[str]:
    for what, failure in (
        ("linearized", model.linearization_failure),
        ("audited", model.audit_failure),
    ):
        if failure:
            yield f"{shown(model.model)} was not {what}. {shown(model.engine)}: {shown(failure)}"
