"""What might be wrong with a model: literals, settings, constants, axes, and missing terms."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np

from harness.bindings import Binding, bindings, with_literals
from harness.coordinates import CoordinateMap
from harness.diagnose import Hypothesis
from harness.engine import Engine, EngineError, Force, Model, StateForce
from harness.evidence import Sample, quick_ends, reference_ends, variant_ends
from harness.places import PlaceError
from harness.segments import BlownUpError
from harness.sidecar import Sidecar
from reference.integrate import ReferenceError
from reference.numeric import Array
from reference.system import System
from reference.variants import Variants

NUDGE = 1e-4
"""Share of a number's size by which it is moved to learn its slope."""

_ORDER = ("literal", "setting", "constant")


@dataclass(frozen=True)
class Suspects:
    """Hypotheses with their slopes: the change of the defect per unit of fault, (H, N)."""

    hypotheses: tuple[Hypothesis, ...]
    slopes: Array


def rank(kind: str) -> int:
    """How specific a kind of cause is: a literal says more than a constant, that than a term."""
    return _ORDER.index(kind) if kind in _ORDER else len(_ORDER)


def reference_suspects(variants: Variants, samples: Sequence[Sample]) -> Suspects:
    """Every constant, and every term that the equations lack, moved in the equations."""
    nominal, sizes = variants.nominal, variants.sizes
    base = reference_ends(samples)
    steps = NUDGE * sizes
    ends = variant_ends(variants, nominal + np.diag(steps), samples)
    back = variant_ends(variants, nominal - np.diag(steps), samples)
    slopes = (ends - back) / (2 * steps[:, None])

    def shift_of(index: int) -> Callable[[float], Array]:
        @lru_cache(maxsize=64)
        def shift(fault: float) -> Array:
            point = nominal.copy()
            point[index] += fault
            return _variant(variants, point, samples) - base

        return shift

    hypotheses = tuple(
        Hypothesis(
            parameter.name, parameter.kind, parameter.nominal, parameter.size,
            rank(parameter.kind), "", shift_of(i), 1.0,
        )
        for i, parameter in enumerate(variants.parameters)
    )  # fmt: skip
    return Suspects(hypotheses, slopes)


REFUSED = 1e6
"""Stands for the ends that an engine refuses to compute: what explains nothing."""


def _variant(variants: Variants, point: Array, samples: Sequence[Sample]) -> Array:
    """The ends at other parameters, or `REFUSED` where the equations can't be solved there."""
    try:
        with np.errstate(all="ignore"):
            ends: Array = variant_ends(variants, point[None], samples)[0]
    except ReferenceError:
        return np.full(sum(sample.end.size for sample in samples), REFUSED)
    return ends if np.isfinite(ends).all() else np.full_like(ends, REFUSED)


def literal_suspects(
    system: System, sidecar: Sidecar, engine: Engine, coordinates: CoordinateMap,
    samples: Sequence[Sample], base: Array, into: Path, known: Array | None = None,
) -> Suspects:  # fmt: skip
    """Every bound literal, moved in copies of the engine's own model.

    Args:
        base: ends of the segments with the file as it is, scaled and flat.
        into: folder for the copies.
        known: the slopes, where a model close by has shown them already.
    """

    def shift_of(binding: Binding) -> Callable[[float], Array]:
        signs = {np.sign(binding.value), np.sign(binding.expected), 0.0}

        @lru_cache(maxsize=64)
        def shift(fault: float) -> Array:
            moved = binding.value - fault
            if np.sign(moved) not in signs:
                # A mass below zero ends some engines' process.
                return np.full_like(base, REFUSED)
            copy = with_literals(sidecar, {binding.address: moved}, into)
            try:
                model = engine.load(copy.spec(engine.name))
                return base - quick_ends(model, coordinates, samples)
            except (EngineError, BlownUpError):
                return np.full_like(base, REFUSED)

        return shift

    hypotheses: list[Hypothesis] = []
    slopes: list[Array] = []
    for binding in _found(system, sidecar):
        size = abs(binding.value) or abs(binding.expected) or 1.0
        place = f"{binding.place.file.name}:{binding.place.line}"
        shift = shift_of(binding)
        hypotheses.append(
            Hypothesis(
                binding.address, "literal", binding.value, size, rank("literal"), place, shift, -1.0
            )
        )
        slopes.append(_slope(shift, NUDGE * size) if known is None else known[len(slopes)])
    return Suspects(tuple(hypotheses), np.array(slopes).reshape(len(hypotheses), len(base)))


def _found(system: System, sidecar: Sidecar) -> Iterator[Binding]:
    """The bindings whose literal is there: one left out is a cause for the equations to name."""
    for address, expression in sidecar.bindings.items():
        with suppress(PlaceError):
            yield from bindings(system, replace(sidecar, bindings={address: expression}))


def _slope(shift: Callable[[float], Array], step: float) -> Array:
    """Change per unit; from below where the engine refuses the number above."""
    for delta in (step, -step):
        change = shift(delta)
        if np.max(np.abs(change)) < REFUSED:
            slope: Array = change / delta
            return slope
    return np.zeros_like(change)


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder for copies of a model, gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        yield Path(folder)


def together(*parts: Suspects) -> Suspects:
    """All hypotheses of several sources."""
    return Suspects(
        tuple(h for part in parts for h in part.hypotheses),
        np.concatenate([part.slopes for part in parts]),
    )


def at(sidecar: Sidecar, engine: str, **settings: object) -> Sidecar:
    """A sidecar with other settings for one engine."""
    own = {**sidecar.engine_settings.get(engine, {}), **settings}
    return replace(sidecar, engine_settings={**sidecar.engine_settings, engine: own})


def gravity_suspects(
    sidecar: Sidecar, engine: Engine, model: Model, coordinates: CoordinateMap,
    samples: Sequence[Sample], base: Array,
) -> Suspects:  # fmt: skip
    """Each component of the engine's gravity, for models that tell it: its size and direction."""
    gravity = getattr(model, "gravity", None)
    if gravity is None:
        return Suspects((), np.zeros((0, len(base))))
    vector = [float(component) for component in gravity]
    size = float(np.linalg.norm(vector)) or 9.81

    def shift_of(axis: int) -> Callable[[float], Array]:
        @lru_cache(maxsize=64)
        def shift(fault: float) -> Array:
            moved = [*vector, 0.0][:3]  # a planar engine has two components
            moved[axis] -= fault
            changed = at(sidecar, engine.name, gravity=moved)
            return base - quick_ends(engine.load(changed.spec(engine.name)), coordinates, samples)

        return shift

    hypotheses = tuple(
        # A component that the model has may be wrong; one that it lacks is seldom meant.
        Hypothesis(f"gravity along {'xyz'[axis]}", "setting", value, size,
                   rank("setting") if value else len(_ORDER) + 1, "",
                   shift_of(axis), -1.0)
        for axis, value in enumerate(vector)
    )  # fmt: skip
    slopes = [_slope(h.shift, NUDGE * size) for h in hypotheses]
    return Suspects(hypotheses, np.array(slopes))


def _switches(changes: Mapping[str, Array], kind: str, size: int) -> Suspects:
    """Hypotheses that are true or not: a fault of 1 makes the whole change."""

    def shift_of(change: Array) -> Callable[[float], Array]:
        return lambda fault: fault * change

    hypotheses = tuple(
        Hypothesis(cause, kind, 0.0, 1.0, rank(kind), "", shift_of(change), 1.0, True)
        for cause, change in changes.items()
    )
    return Suspects(hypotheses, np.array(list(changes.values())).reshape(len(changes), size))


def flip_suspects(
    model: Model, coordinates: CoordinateMap, samples: Sequence[Sample], base: Array
) -> Suspects:
    """Each joint turned the other way: a fault of 1 is an axis that points backwards."""
    changes = {
        f"axis of {name} reversed": base
        - quick_ends(_Seen(model, index, -1.0, 0.0), coordinates, samples)
        for index, name in enumerate(model.coordinates)
    }
    return _switches(changes, "axis", len(base))


def remedy_suspects(
    sidecar: Sidecar, engine: Engine, model: Model, coordinates: CoordinateMap,
    samples: Sequence[Sample], base: Array,
) -> Suspects:  # fmt: skip
    """What an engine does on its own unless told, each undone as the model's `remedies` say."""
    changes = {}
    for cause, settings in getattr(model, "remedies", {}).items():
        cured = engine.load(at(sidecar, engine.name, **settings).spec(engine.name))
        changes[cause] = base - quick_ends(cured, coordinates, samples)
    return _switches(changes, "default", len(base))


def exchange_suspects(variants: Variants, samples: Sequence[Sample]) -> Suspects:
    """Two constants of one unit, each with the other's value."""
    base = reference_ends(samples)
    constants = [(i, p) for i, p in enumerate(variants.parameters) if p.kind == "constant"]
    changes = {}
    for (i, one), (j, other) in combinations(constants, 2):
        if one.unit == other.unit and one.nominal != other.nominal:
            point = variants.nominal.copy()
            point[i], point[j] = point[j], point[i]
            cause = f"{one.name}, {other.name} exchanged"
            changes[cause] = _variant(variants, point, samples) - base
    return _switches(changes, "exchange", len(base))


def zero_suspects(
    sidecar: Sidecar, engine: Engine, model: Model, coordinates: CoordinateMap,
    samples: Sequence[Sample], base: Array,
) -> Suspects:  # fmt: skip
    """The zero of each engine coordinate moved: a `ref`, a rest offset, a body drawn turned.

    Where engine coordinates are held together by joints, none has a zero of its own.
    """
    if len(model.coordinates) > coordinates.back.size:
        return Suspects((), np.zeros((0, len(base))))

    def shift_of(index: int) -> Callable[[float], Array]:
        @lru_cache(maxsize=64)
        def shift(fault: float) -> Array:
            moved = _Seen(engine.load(sidecar.spec(engine.name)), index, 1.0, -fault)
            return base - quick_ends(moved, coordinates, samples)

        return shift

    hypotheses = tuple(
        Hypothesis(f"zero of {name}", "zero", 0.0, 1.0, rank("zero"), "", shift_of(index), 1.0)
        for index, name in enumerate(model.coordinates)
    )
    slopes = [_slope(h.shift, NUDGE) for h in hypotheses]
    return Suspects(hypotheses, np.array(slopes).reshape(len(hypotheses), len(base)))


@dataclass(frozen=True)
class _Seen:
    """A model whose coordinate `index` reads sign * (its own - offset)."""

    model: Model
    index: int
    sign: float
    offset: float

    @property
    def coordinates(self) -> tuple[str, ...]:
        return self.model.coordinates

    @property
    def step(self) -> float:
        return self.model.step

    @property
    def integrator(self) -> str:
        return self.model.integrator

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return self.model.exponents(varying_input)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        sign = np.ones(q.shape[1])
        sign[self.index] = self.sign
        offset = np.zeros(q.shape[1])
        offset[self.index] = self.offset
        if isinstance(force, StateForce):
            inner = force

            def reversed_at(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
                seen = [(a - o) * s for a, s, o in zip(z, sign, offset, strict=True)]
                return [f * s for f, s in zip(inner.at(seen, u), sign, strict=True)]

            force = StateForce(inner.inputs, reversed_at)
        elif force is not None:
            force = force * sign
        z, w = self.model.rollout(q * sign + offset, v * sign, h, n, force, every)
        return (z - offset) * sign, w * sign
