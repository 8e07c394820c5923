"""Steps of bodies in a plane with contacts, limits and motors, compared with the engine's law.

The contact points are the engine's, and the order in which it corrects them; all other numbers are
those of the file. A state has no impulses; two steps from it show what the first one leaves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    LoadedModel,
    ModelSpec,
    PlanarEngineStep,
    PlanarWhole,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.numerics.ladder import floored
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.reference.laws.planar import DIGITS, PlanarModel, PlanarState, beyond
from physics_crosscheck.reference.mechanism.planar import PlanarLaws
from .law_comparison import LEAST_GAIN, LawDefect
from .prepare import Prepared, PreparedTree
from .task import ModelTask
from .whole_step import WholeStepCheck, case_whole_step

STATES, SEED = 24, 20261125
"""Number of states, and the seed of their draws."""

COMPANIONS, SAFETY = 2, 8.0
"""Solutions of the law with random rounding, and the factor of their largest spread."""

LONG = 400
"""Largest number of steps before a state: a fall onto other shapes."""

SPREAD = np.array([1.0, 1.0, 5.0])
"""Size of drawn velocities, m/s and rad/s."""

DEPTH = 0.02
"""Largest violation of a limit, as a share of its range."""

LEAST_DEPTH = 1e-4
"""Smallest depth of overlaps that draws produce, m."""

_RATES, _PLACES = ("x_dot", "y_dot", "angle_dot"), ("x", "y", "angle")


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarSample:
    """Two steps from a state: the engine's, and the law's with the engine's contacts.

    Attributes:
        velocities: at the state, (N, 3).
        engine, law: after each step.
        values: of the components by the law, (C,).
        unsure: their rounding, (C,).
    """

    velocities: Array
    engine: tuple[PlanarEngineStep, ...]
    law: tuple[PlanarState, ...]
    values: Array
    unsure: Array

    @staticmethod
    def from_state(
        law: PlanarModel, engine: PlanarWhole, places: Array, velocities: Array
    ) -> PlanarSample:
        """Evaluate both."""
        steps = engine.evaluate(places, velocities)
        start = law.at_rest(places, velocities)

        def states(noise: np.random.Generator | None) -> tuple[PlanarState, ...]:
            state, result = start, []
            for step in steps:
                state = law.advance(state, step.contacts, noise)
                result.append(state)
            return tuple(result)

        def values(after: Sequence[PlanarState]) -> Array:
            return _values([state.velocities for state in after], law.origins(after[-1]))

        exact, rng = states(None), np.random.default_rng(SEED)
        mine = values(exact)
        others = np.array([values(states(rng)) for _ in range(COMPANIONS)])
        place = np.abs(exact[-1].places).sum(axis=1, keepdims=True)
        still = _values([np.abs(state.velocities) for state in exact], place + np.zeros(3))
        unsure = SAFETY * np.max(np.abs(others - mine), axis=0)
        return PlanarSample(
            velocities=velocities,
            engine=steps,
            law=exact,
            values=mine,
            unsure=unsure + DIGITS * float(np.finfo(float).eps) * still,
        )

    def defects(self) -> Array:
        """Return engine minus law, (C,)."""
        velocities = [step.velocities for step in self.engine]
        return _values(velocities, self.engine[-1].places) - self.values


def _values(velocities: Sequence[Array], places: Array) -> Array:
    """Return the components: velocities after each step, places after the last, (C,)."""
    return np.concatenate([part.ravel() for part in (*velocities, places)])


def drawn_states(engine: PlanarWhole, laws: PlanarLaws) -> Iterator[tuple[Array, Array]]:
    """Yield places and velocities, (N, 3) each.

    In turn: near the built state; after a motion; and after one, at rest, with each limit exceeded,
    on both sides. In every other state shapes overlap more. Bodies that no force moves keep their
    velocities.
    """
    rng = np.random.default_rng(SEED)
    moves = np.array([[body.weighed] for body in laws.bodies])
    for k in range(STATES):
        places, speeds = engine.home, engine.speeds
        kick = SPREAD * rng.normal(size=speeds.shape) * moves
        if k % 3:
            places, speeds = engine.moved(places, speeds + kick, int(rng.integers(1, LONG)))
        if k % 3 == 2:
            depth = DEPTH * 10 ** rng.uniform(-2, 0)
            places, outward = beyond(laws, places, depth, upper=k // 3 % 2 == 1)
            speeds = np.where(moves, outward * rng.uniform(0, 1), speeds)
            kick = 0.1 * kick
        if k % 2:
            places = places + _pressed(laws, rng) * moves
        state = places, speeds + kick * (0.1 if k % 4 < 2 else 1.0)
        if all(np.isfinite(part).all() for part in state):
            yield state


def _pressed(laws: PlanarLaws, rng: np.random.Generator) -> Array:
    """Return displacements along gravity, (N, 3), so that overlaps exceed the slop."""
    gravity = np.array(laws.gravity)
    size = float(np.hypot(*gravity))
    along = gravity / size if size else np.array([0.0, -1.0])
    depth = max(laws.slop, LEAST_DEPTH) * rng.uniform(0, 3, (len(laws.bodies), 1))
    return np.hstack([depth * along, np.zeros_like(depth)])


def case_steps(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> WholeStepCheck | None:
    """Compare whole steps of a robot file, or of a file of bodies in a plane."""
    target = task.target
    if isinstance(target, PreparedTree):
        # Contacts of a single body whose mass is a stand-in tell nothing of the file.
        has_joint = any(link.kind != "free" for link in target.tree.links)
        if target.smooth or (has_stand_ins(task.file) and not has_joint):
            return None
    whole = case_whole_step(task, model, coordinates)
    if whole is not None or task.sidecar is None:
        return whole
    return check_planar_step(task.spec, task.spec, task.engine, task.resolution)


def check_planar_step(
    source: ModelSpec, spec: ModelSpec, engine: str, resolution: float
) -> WholeStepCheck | None:
    """Compare steps of a file; None if nothing touches, and no joint has a limit or a motor.

    Args:
        source: the file and the settings whose numbers the law takes.
        spec: what the engine loads: the same, or a changed copy.
        engine: name of the engine.
        resolution: relative discrepancy to resolve.
    """
    try:
        whole = engines()[engine].load_planar(spec)
        if whole is None or not whole.acts:
            return None
        stated = whole if source == spec else engines()[engine].load_planar(source)
        assert stated is not None
        uncovered = (*stated.uncovered, *whole.uncovered)
        if uncovered:
            return WholeStepCheck.skipped(uncovered)
        return _check(PlanarModel(laws=stated.laws), whole, resolution)
    except EngineError as error:
        return WholeStepCheck.skipped([str(error)])


def compare(samples: Sequence[PlanarSample], h: float) -> LawDefect:
    """Compare the velocities after each step and the places after the last one."""
    changes, speeds = (
        floored(np.max(sizes, axis=0).ravel())
        for sizes in (
            [np.abs(one.engine[0].velocities - one.velocities) for one in samples],
            [np.abs(one.engine[0].velocities) + np.abs(one.velocities) for one in samples],
        )
    )
    change = np.maximum(changes, LEAST_GAIN * speeds)
    scale = np.concatenate([change, change, np.maximum(h * speeds, h * change)])
    return LawDefect(
        defect=np.array([one.defects() for one in samples]) / scale,
        uncertainty=np.array([one.unsure for one in samples]) / scale,
        scale=scale,
    )


def _components(laws: PlanarLaws) -> tuple[str, ...]:
    rates = [f"{body.name}.{rate}" for body in laws.bodies for rate in _RATES]
    places = [f"{body.name}.{place}" for body in laws.bodies for place in _PLACES]
    second = [f"{name} of the second step" for name in (*rates, *places)]
    return (*rates, *second)


def planar_samples(law: PlanarModel, whole: PlanarWhole) -> list[PlanarSample]:
    """Evaluate the law and the engine at drawn states."""
    samples = [
        PlanarSample.from_state(law, whole, *state) for state in drawn_states(whole, law.laws)
    ]
    return [one for one in samples if np.isfinite(one.defects()).all()]


def _check(law: PlanarModel, whole: PlanarWhole, resolution: float) -> WholeStepCheck:
    samples = planar_samples(law, whole)
    if not samples:
        raise EngineError("no drawn state is finite")
    compared = compare(samples, law.laws.step)
    uncertainty = np.maximum(compared.uncertainty, np.finfo(float).eps)
    judged = judge(np.abs(compared.defect), uncertainty, resolution, None)
    acted = Counter[str]()
    for sample in samples:
        for state in sample.law:
            acted.update(dict(state.acted))
    return WholeStepCheck.compared(
        judged,
        resolution,
        acted,
        component=_components(law.laws)[judged.component],
        states=len(samples),
        step=number(law.laws.step),
        next_state=True,
        edits=whole.edits,
    )
