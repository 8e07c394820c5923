"""What might be wrong with a model: literals, settings, constants, axes, and missing terms."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from harness.bindings import bindings, with_literals
from harness.coordinates import CoordinateMap
from harness.diagnose import Hypothesis
from harness.engine import Engine, EngineError, Force, Model, StateForce
from harness.evidence import Sample, quick_ends, reference_ends, variant_ends
from harness.segments import BlownUpError
from harness.sidecar import Sidecar
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
            ends: Array = variant_ends(variants, point[None], samples)[0]
            return ends - base

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


def literal_suspects(
    system: System, sidecar: Sidecar, engine: Engine, coordinates: CoordinateMap,
    samples: Sequence[Sample], base: Array, into: Path,
) -> Suspects:  # fmt: skip
    """Every bound literal, moved in copies of the engine's own model.

    Args:
        base: ends of the segments with the file as it is, scaled and flat.
        into: folder for the copies.
    """

    def shift_of(address: str, value: float) -> Callable[[float], Array]:
        @lru_cache(maxsize=64)
        def shift(fault: float) -> Array:
            copy = with_literals(sidecar, {address: value - fault}, into)
            try:
                model = engine.load(copy.spec(engine.name))
                return base - quick_ends(model, coordinates, samples)
            except (EngineError, BlownUpError):
                return np.full_like(base, REFUSED)

        return shift

    hypotheses, slopes = [], []
    for binding in bindings(system, sidecar):
        size = abs(binding.value) or abs(binding.expected) or 1.0
        place = f"{binding.place.file.name}:{binding.place.line}"
        shift = shift_of(binding.address, binding.value)
        hypotheses.append(
            Hypothesis(
                binding.address, "literal", binding.value, size, rank("literal"), place, shift, -1.0
            )
        )
        slopes.append(_slope(shift, NUDGE * size))
    return Suspects(tuple(hypotheses), np.array(slopes).reshape(len(hypotheses), len(base)))


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


def at(spec_sidecar: Sidecar, **settings: object) -> Sidecar:
    """A sidecar with other settings."""
    return replace(spec_sidecar, settings={**spec_sidecar.settings, **settings})


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
            moved = [*vector]
            moved[axis] -= fault
            changed = at(sidecar, gravity=moved)
            return base - quick_ends(engine.load(changed.spec(engine.name)), coordinates, samples)

        return shift

    hypotheses = tuple(
        Hypothesis(f"gravity along {'xyz'[axis]}", "setting", value, size, rank("setting"), "",
                   shift_of(axis), -1.0)
        for axis, value in enumerate(vector)
    )  # fmt: skip
    slopes = [_slope(h.shift, NUDGE * size) for h in hypotheses]
    return Suspects(hypotheses, np.array(slopes))


def flip_suspects(
    model: Model, coordinates: CoordinateMap, samples: Sequence[Sample], base: Array
) -> Suspects:
    """Each joint turned the other way: a fault of 1 is an axis that points backwards."""
    hypotheses, slopes = [], []
    for index, name in enumerate(model.coordinates):
        flipped = quick_ends(_Flipped(model, index), coordinates, samples)
        change = base - flipped

        def shift(fault: float, change: Array = change) -> Array:
            return fault * change

        slopes.append(change)
        hypotheses.append(
            Hypothesis(f"axis of {name} reversed", "axis", 0.0, 1.0, rank("axis"), "", shift, 1.0)
        )
    return Suspects(tuple(hypotheses), np.array(slopes).reshape(len(hypotheses), len(base)))


@dataclass(frozen=True)
class _Flipped:
    """A model seen with one of its coordinates reversed."""

    model: Model
    index: int

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
        sign[self.index] = -1.0
        if isinstance(force, StateForce):
            inner = force

            def reversed_at(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
                seen = [a * s for a, s in zip(z, sign, strict=True)]
                return [f * s for f, s in zip(inner.at(seen, u), sign, strict=True)]

            force = StateForce(inner.inputs, reversed_at)
        elif force is not None:
            force = force * sign
        z, w = self.model.rollout(q * sign, v * sign, h, n, force, every)
        return z * sign, w * sign
