"""Candidate hypotheses on a model: numbers that might be wrong, and how to change them."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np

from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.modelfiles.bindings import Binding, bindings
from physics_crosscheck.harness.modelfiles.locations import find, numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.variants import Variants
from .fit import Hypothesis, Perturbation

_ORDER: tuple[CauseKind, ...] = (
    "default", "law", "axis", "exchange", "literal", "literals", "unbound literal", "gravity",
    "constant",
)  # fmt: skip
"""Kinds of causes, the most specific first.

A switch that leaves nothing cannot be a coincidence. A literal is more specific than a constant,
and a constant than a missing term of the equations.
"""


def everything(
    system: System,
    sidecar: Sidecar,
    model: LoadedModel,
    coordinates: CoordinateMap,
    variants: Variants,
) -> tuple[Hypothesis, ...]:
    """Return all candidates of a model."""
    return (
        *_parameters(variants),
        *_exchanges(variants),
        *_axes(model),
        *_zeros(model, coordinates),
        *_gravity(model),
        *_defaults(model),
        *literals(system, sidecar),
    )


def rank(kind: CauseKind) -> int:
    """Return the rank of a kind of cause, the most specific first; it breaks ties."""
    return _ORDER.index(kind) if kind in _ORDER else len(_ORDER)


def _parameters(variants: Variants) -> Iterator[Hypothesis]:
    for index, p in enumerate(variants.parameters):
        cause = CauseId(kind=p.kind, subject=(p.name,))
        repair = Perturbation(parameters={index: 1.0})
        yield Hypothesis(id=cause, value=p.nominal, size=p.size, rank=rank(p.kind), repair=repair)


def _switch(cause: CauseId, perturbation: Perturbation) -> Hypothesis:
    order = rank(cause.kind)
    return Hypothesis(id=cause, value=0.0, size=1.0, rank=order, switch=True, repair=perturbation)


def _exchanges(variants: Variants) -> Iterator[Hypothesis]:
    constants = [(i, p) for i, p in enumerate(variants.parameters) if p.kind == "constant"]
    for (i, constant_a), (j, constant_b) in combinations(constants, 2):
        if constant_a.unit == constant_b.unit and constant_a.nominal != constant_b.nominal:
            apart = constant_b.nominal - constant_a.nominal
            yield _switch(
                CauseId(kind="exchange", subject=(constant_a.name, constant_b.name)),
                Perturbation(parameters={i: apart, j: -apart}),
            )


def _axes(model: LoadedModel) -> Iterator[Hypothesis]:
    for index, name in enumerate(model.coordinates):
        yield _switch(CauseId(kind="axis", subject=(name,)), Perturbation(reversed=index))


def _zeros(model: LoadedModel, coordinates: CoordinateMap) -> Iterator[Hypothesis]:
    """Yield each engine coordinate with a moved zero: a `ref`, a rest offset, a rotated body.

    Engine coordinates that joints couple have no zero of their own.
    """
    if len(model.coordinates) > coordinates.back.size:
        return
    for index, name in enumerate(model.coordinates):
        cause = CauseId(kind="zero", subject=(name,))
        repair = Perturbation(zero=index)
        yield Hypothesis(id=cause, value=0.0, size=1.0, rank=rank("zero"), repair=repair)


def _gravity(model: LoadedModel) -> Iterator[Hypothesis]:
    """Yield each component of gravity, if the model reports it: its size and direction."""
    if not model.gravity:
        return
    vector = [float(component) for component in model.gravity]
    size = float(np.linalg.norm(vector)) or 9.81
    for axis, value in enumerate(vector):
        # A nonzero component may be wrong; a zero one rarely is.
        order = rank("gravity") if value else len(_ORDER) + 1
        added = [0.0, 0.0, 0.0]
        added[axis] = -1.0
        cause = CauseId(kind="gravity", subject=("xyz"[axis],))
        repair = Perturbation(gravity=(added[0], added[1], added[2]))
        yield Hypothesis(
            id=cause, value=value, size=size, rank=order, correction=-1.0, repair=repair
        )


def _defaults(model: LoadedModel) -> Iterator[Hypothesis]:
    """Yield the engine's own assumptions, which the model's `corrective_settings` switch off."""
    for cause, settings in model.corrective_settings.items():
        yield _switch(CauseId(kind="default", subject=(cause,)), Perturbation(settings=settings))


def literals(system: System, sidecar: Sidecar) -> Iterator[Hypothesis]:
    """Yield literals: bound ones alone, bound ones of one expression together, and unbound ones."""
    bound = tuple(_bound(system, sidecar))
    # A number can move an event out of its segment, where slopes are wrong.
    from_bound = bool(system.interactions)
    for b in bound:
        yield _literal("literal", (b,), from_bound=from_bound)
    for expression in dict.fromkeys(b.expression for b in bound):
        alike = tuple(b for b in bound if b.expression == expression)
        # Copies of one number that share a mistake.
        if len(alike) > 1 and len({b.value for b in alike}) == 1:
            yield _literal("literals", alike, from_bound=from_bound)
    yield from _unbound(sidecar, bound)


def _literal(kind: CauseKind, moved: Sequence[Binding], *, from_bound: bool) -> Hypothesis:
    """Return a candidate that changes bound literals of one value together.

    Args:
        from_bound: whether its fit starts at the bound value, not at the present one.
    """
    value, expected = moved[0].value, moved[0].expected
    return Hypothesis(
        id=CauseId(kind=kind, subject=tuple(b.address for b in moved)),
        value=value,
        size=abs(value) or abs(expected) or 1.0,
        rank=rank(kind),
        where=tuple(dict.fromkeys(line_of(b.place) for b in moved)),
        correction=-1.0,
        expected=expected,
        start=value - expected if from_bound else 0.0,
        repair=Perturbation(literals={b.address: -1.0 for b in moved}),
    )


def line_of(place: Number) -> SourceLine:
    """Return the line and the bytes of a number."""
    return SourceLine(file=place.file.name, line=place.line, span=place.span, text=place.text)


def _bound(system: System, sidecar: Sidecar) -> Iterator[Binding]:
    """Yield the bindings whose literal exists; a missing one is a cause in the equations."""
    for address, expression in sidecar.bindings.items():
        with suppress(LocationError):
            yield from bindings(system, replace(sidecar, bindings={address: expression}))


_MECHANICS = (
    r"(joint|inertial|option|fixed|dynamics|mass|inertia|origin|mimic|body)@"
    r"(?!timestep|tolerance|range|axis|limit|lower|upper)\w+|\w*[sS]pring\w*|implicitSpringDamper"
    r"|mass|i[xyz]{2}|pose|damping|friction|multiplier|offset"
)
"""Numbers of XML that may belong to the mechanism, not to visual geometry or the solver."""

_LAWS = r"\w+@sol(ref|imp)\w*"
"""Numbers of soft laws of contacts, limits and friction. Fits start nearby: zero is invalid."""


def _unbound(sidecar: Sidecar, bound: tuple[Binding, ...]) -> Iterator[Hypothesis]:
    bound_places = {(b.place.file, b.place.start) for b in bound}
    with suppress(LocationError):
        addresses = numbers(sidecar.model, f"{_MECHANICS}|{_LAWS}" if sidecar.laws else _MECHANICS)
        for address, place in find(sidecar.model, addresses).items():
            looks = re.search(r"(^|/)(visual|collision)[/\[]", address)
            if place.value and not looks and (place.file, place.start) not in bound_places:
                yield Hypothesis(
                    id=CauseId(kind="unbound literal", subject=(address,)),
                    value=place.value,
                    size=abs(place.value),
                    rank=rank("unbound literal"),
                    where=(line_of(place),),
                    correction=-1.0,
                    start=0.0 if re.search("@sol(ref|imp)", address) else place.value,
                    repair=Perturbation(literals={address: -1.0}),
                )
