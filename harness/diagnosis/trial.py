"""Trials of a model: with many perturbations at once, in its engine and in its equations."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.engines.protocol import EngineError, Force, LoadedModel, StateForce
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import locate, with_literals
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.segments import Segments
from physics_crosscheck.reference.solving.variants import Variants
from .fit import Faults, Hypothesis, Perturbation
from .samples import RUNGS_OF_SLOPES, RUNGS_USED, quick_ends, reference_ends, variant_ends

NUDGE = 1e-4
"""Relative change of a number to measure its slope."""

REFUSED = 1e6
"""Placeholder for ends that an engine rejects; it explains nothing."""


@dataclass(frozen=True, kw_only=True)
class TrialModel:
    """A model, its equations, and hypotheses on it.

    Attributes:
        task: the unmodified model, and its equations.
        model, coordinates: the model in its engine.
        samples: the segments.
        ends: the model's end states, scaled and flat, (N,).
        hypotheses: H hypotheses.
        folder: for copies of the model.
        known_slopes: slopes of the literals, if known from a similar model.
    """

    task: SystemTask
    model: LoadedModel
    coordinates: CoordinateMap
    samples: Sequence[Segments]
    ends: Array
    hypotheses: tuple[Hypothesis, ...]
    folder: Path
    known_slopes: Mapping[CauseId, Array] = field(default_factory=dict)
    _engine_ends: dict[object, Array] = field(default_factory=dict, repr=False)
    _reference_ends: dict[bytes, Array] = field(default_factory=dict, repr=False)

    @property
    def variants(self) -> Variants:
        """The equations with free parameters."""
        return self.task.target.variants

    def defect(self, faults: Faults) -> Array:
        """Return engine - reference at the ends with repaired faults, scaled and flat, (N,)."""
        return self._repaired(faults, RUNGS_USED) - self._moved(self.point(faults))

    def slopes(self, faults: Faults, indices: Sequence[int] | None = None) -> Array:
        """Return the defect per unit of each fault, near these faults, (len(indices), N)."""
        indices = range(len(self.hypotheses)) if indices is None else indices
        rows = np.zeros((len(indices), len(self.ends)))
        free: dict[int, int] = {}
        for row, index in enumerate(indices):
            hypothesis = self.hypotheses[index]
            parameters = hypothesis.repair.parameters
            if not hypothesis.switch and parameters:
                (free[row],) = parameters
            elif hypothesis.switch:
                rows[row] = self.defect(faults) - self.defect({**faults, index: 1.0})
            elif not faults and hypothesis.id in self.known_slopes:
                rows[row] = self.known_slopes[hypothesis.id]
            else:
                rows[row] = self._slope(faults, index)
        if free:
            point = self.point(faults)
            rows[list(free)] = self._parameter_slopes(point, list(free.values()))
        return rows

    def _slope(self, faults: Faults, index: int) -> Array:
        """Return the slope by a difference, downwards if the engine rejects the larger number."""
        base = self._repaired(faults, RUNGS_OF_SLOPES)
        step = NUDGE * self.hypotheses[index].size
        for delta in (step, -step):
            moved = {**faults, index: faults.get(index, 0.0) + delta}
            change = base - self._repaired(moved, RUNGS_OF_SLOPES)
            if np.max(np.abs(change)) < REFUSED / 2:
                slope: Array = change / delta
                return slope
        return np.zeros_like(base)

    def _parameter_slopes(self, point: Array, indices: list[int]) -> Array:
        steps = NUDGE * self.variants.sizes[indices]
        moves = np.zeros((len(indices), len(point)))
        moves[np.arange(len(indices)), indices] = steps
        try:
            both = variant_ends(
                self.variants, np.concatenate([point + moves, point - moves]), self.samples
            )
        except ReferenceError:
            # The equations may be too stiff with one of them, such as friction: skip only that one.
            if len(indices) == 1:
                return np.zeros((1, len(self.ends)))
            return np.concatenate([self._parameter_slopes(point, [index]) for index in indices])
        upper, lower = np.split(both, 2)
        slopes: Array = (upper - lower) / (2 * steps[:, None])
        return slopes

    def point(self, faults: Faults) -> Array:
        """Return parameters of the equations with repaired faults, (P,)."""
        point = self.variants.nominal.copy()
        for row, fault in faults.items():
            for index, unit in self.hypotheses[row].repair.parameters.items():
                point[index] += fault * unit
        return point

    def _moved(self, point: Array) -> Array:
        key = point.tobytes()
        if key not in self._reference_ends:
            self._reference_ends[key] = self._equations(point)
        return self._reference_ends[key]

    def _equations(self, point: Array) -> Array:
        if np.array_equal(point, self.variants.nominal):
            return reference_ends(self.samples)
        try:
            with np.errstate(all="ignore"):
                ends: Array = variant_ends(self.variants, point[None], self.samples)[0]
        except ReferenceError:
            return np.full(len(self.ends), REFUSED)
        return ends if np.isfinite(ends).all() else np.full_like(ends, REFUSED)

    def repaired(self, faults: Faults) -> LoadedModel | None:
        """Return the model with repaired faults, or None if that is impossible.

        Raises:
            EngineError: if the engine rejects it.
        """
        return self._load(self._repair(faults))

    def _repaired(self, faults: Faults, rungs: tuple[int, ...]) -> Array:
        """Return the engine's end states with repaired faults, or `REFUSED` if it rejects them."""
        repair = self._repair(faults)
        key = (repair.key, rungs)
        if key not in self._engine_ends:
            self._engine_ends[key] = self._run(repair, rungs)
        return self._engine_ends[key]

    def _repair(self, faults: Faults) -> _Repair:
        count = len(self.model.coordinates)
        repair = _Repair(sign=np.ones(count), offset=np.zeros(count))
        for row, fault in faults.items():
            repair.take(self.hypotheses[row].repair, fault)
        return repair

    def _run(self, repair: _Repair, rungs: tuple[int, ...]) -> Array:
        if repair.nothing and rungs == RUNGS_USED:
            return self.ends
        try:
            model = self._load(repair)
            if model is not None:
                return quick_ends(model, self.coordinates, self.samples, rungs)
        except (EngineError, BlownUpError):
            pass
        return np.full_like(self.ends, REFUSED)

    def _load(self, repair: _Repair) -> LoadedModel | None:
        task, settings = self.task, repair.settings
        literals = {address: change for address, change in repair.literals.items() if change}
        if literals:
            moved = self._literals(literals)
            if moved is None:
                return None
            task = task.with_sidecar(with_literals(task.declared, moved, self.folder))
        if repair.gravity.any():
            gravity = [*self.model.gravity, 0.0][
                :3
            ]  # gravity of a planar engine has two components
            settings = {
                **settings,
                "gravity": [float(g) for g in np.array(gravity) + repair.gravity],
            }
        if settings:
            task = task.with_settings(**settings)
        model = self.model if task is self.task else engines()[task.engine].load(task.spec)
        if not repair.turned:
            return model
        return ReorientedModel(model=model, sign=repair.sign, offset=repair.offset)

    def _literals(self, changes: Mapping[str, float]) -> dict[str, float] | None:
        """Return new values, or None if one would change sign to another than its nominal's."""
        values = {}
        for address, place in locate(self.task.declared, changes).items():
            signs = {np.sign(place.value), 0.0, *self._nominal_signs(address)}
            values[address] = place.value + changes[address]
            if np.sign(values[address]) not in signs:
                # Some engines' process crashes for a negative mass.
                return None
        return values

    def _nominal_signs(self, address: str) -> Iterator[float]:
        for hypothesis in self.hypotheses:
            if address in hypothesis.repair.literals and hypothesis.expected is not None:
                yield float(np.sign(hypothesis.expected))


@dataclass
class _Repair:
    """Changes of a model for all faults together."""

    sign: Array
    offset: Array
    literals: dict[str, float] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.zeros(3))
    settings: dict[str, object] = field(default_factory=dict)

    def take(self, perturbation: Perturbation, fault: float) -> None:
        """Add the repair of one fault."""
        for address, unit in perturbation.literals.items():
            self.literals[address] = self.literals.get(address, 0.0) + fault * unit
        self.gravity += fault * np.array(perturbation.gravity)
        if fault:
            self.settings |= perturbation.settings
        if perturbation.reversed >= 0 and fault:
            self.sign[perturbation.reversed] *= -1
        if perturbation.zero >= 0:
            self.offset[perturbation.zero] -= fault

    @property
    def turned(self) -> bool:
        """True if coordinates are reoriented."""
        return bool(self.offset.any() or (self.sign < 0).any())

    @property
    def nothing(self) -> bool:
        """True without any change."""
        return not (
            any(self.literals.values()) or self.gravity.any() or self.settings or self.turned
        )

    @property
    def key(self) -> object:
        """Key, equal for equal repairs."""
        return (
            tuple(sorted(self.literals.items())),
            self.gravity.tobytes(),
            repr(sorted(self.settings.items())),
            self.sign.tobytes(),
            self.offset.tobytes(),
        )


@contextmanager
def scratch() -> Iterator[Path]:
    """Yield a folder for copies of a model, and remove it afterwards."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        yield Path(folder)


class ReorientedModel(LoadedModel):
    """A model whose coordinates are sign * (the inner model's - offset), (nz,) each."""

    def __init__(self, model: LoadedModel, sign: Array, offset: Array) -> None:
        self.model, self.sign, self.offset = model, sign, offset
        self.coordinates, self.step = model.coordinates, model.step
        self.integrator, self.gravity, self.epsilon = model.integrator, model.gravity, model.epsilon

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the inner model's exponents."""
        return self.model.exponents(varying_input)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run the inner model, with reoriented states and forces."""
        sign, offset = self.sign, self.offset
        if isinstance(force, StateForce):
            inner = force

            def reversed_at(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
                read = [(a - o) * s for a, s, o in zip(z, sign, offset, strict=True)]
                return [f * s for f, s in zip(inner.evaluate(read, u), sign, strict=True)]

            force = StateForce(inner.inputs, reversed_at)
        elif force is not None:
            force = force * sign
        z, w = self.model.rollout(q * sign + offset, v * sign, h, n, force, every)
        return (z - offset) * sign, w * sign
